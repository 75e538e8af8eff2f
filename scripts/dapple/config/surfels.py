"""Leaves as discs on the surfaces that points lie on."""

from __future__ import annotations

from dapple.config.base import RIEGL, Positive, Section, key


class Surfels(Section):
    """Discs on the local surfaces of leaf points, as large as the scan's shots allow."""

    reach_m: Positive = key(0.025, "farthest points that tell of a point's surface")
    noise_m: Positive = key(0.005, "standard deviation of points across their surface", RIEGL)
    spacing_m: Positive = key(0.01, "of the points that carry discs")
    overlap: Positive = key(1.2, "area of a disc over its point's share of the surface")
