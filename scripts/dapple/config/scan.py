"""The virtual terrestrial scanner."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le

from dapple.config.base import FREY, RIEGL, Count, NotNegative, Positive, Section, Share, key


class Scan(Section):
    """The virtual terrestrial scanner, after the RIEGL VZ-400i."""

    program: Literal["dapple", "less"] = key(
        "dapple", "dapple's own scanner, or that of LESS 3, which shares no code with it"
    )
    positions: Count = key(8, "scan positions on a circle around the stem", FREY)
    radius_m: Positive = key(10.0, "distance of the positions from the stem", FREY)
    height_m: Positive = key(1.6, "height of the scanner above the ground")
    angular_step_deg: Annotated[float, Ge(0.005), Le(2)] = key(
        0.12, "angle between neighbouring shots; 0.04 in the field", FREY
    )
    beam_divergence_mrad: NotNegative = key(0.35, "full angle of the beam", RIEGL)
    exit_aperture_m: NotNegative = key(0.007, "diameter of the beam at the scanner", RIEGL)
    sub_rays: Annotated[int, Ge(1), Le(64)] = key(7, "rays that sample one beam")
    range_noise_m: NotNegative = key(0.005, "standard deviation of a range", RIEGL)
    min_separation_m: NotNegative = key(0.8, "nearer targets merge into one mixed return")
    max_returns: Annotated[int, Ge(1), Le(255)] = key(5, "returns of one shot")
    noise_points_per_shot: Share = key(0.001, "isolated noise points")
    leaf_reflectance_db: tuple[float, float] = key((-8.0, 1.5), "mean and deviation over leaves")
    wood_reflectance_db: tuple[float, float] = key((-2.5, 1.1), "mean and deviation over wood")
    window_margin_m: NotNegative = key(1.0, "shots that pass the tree within it are fired")
