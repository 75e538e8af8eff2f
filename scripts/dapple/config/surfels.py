"""Leaves as discs on the surfaces that points lie on."""

from __future__ import annotations

from dapple.config.base import RIEGL, NotNegative, Positive, Section, key


class Surfels(Section):
    """Discs on the local surfaces of leaf points, as large as the scan's shots allow."""

    reach_spacings: Positive = key(
        3.0, "farthest points that tell of a point's surface, in median distances of neighbours"
    )
    noise_m: Positive = key(0.005, "standard deviation of points across their surface", RIEGL)
    spacing_m: Positive = key(0.012, "of the points that carry discs")
    overlap: Positive = key(1.2, "area of a disc over its point's share of the surface")
    beam_diameter_m: NotNegative = key(0.007, "beam's diameter at the scanner", RIEGL)
    beam_divergence_mrad: NotNegative = key(0.35, "full angle of the beam", RIEGL)
