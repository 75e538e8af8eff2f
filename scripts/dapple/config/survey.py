"""The survey of scanning designs."""

from __future__ import annotations

from typing import Annotated, Any

from annotated_types import Ge, Gt, Le

from dapple.config.base import LMS, ZANDE, Count, NotNegative, Positive, Section, Share, Some, key


class Survey(Section):
    """Where to put a scanner: designs, shadowing and correction in virtual stands."""

    stands: Some[str] = key(("fagus", "platanus"), "species of the stands", ZANDE)
    leaf_area_index: Some[Positive] = key((4.50, 5.15), "of each stand", ZANDE)
    volume_m: tuple[Positive, Positive, Positive] = key((15.0, 15.0, 30.0), "edges", ZANDE)
    trees_m: Some[tuple[float, float]] = key(
        ((3.75, 3.75), (11.25, 3.75), (3.75, 11.25), (11.25, 11.25)), "places of the trees"
    )
    grown: Count = key(2, "different trees in a stand; others are turned copies")
    replicates: Annotated[int, Ge(2)] = key(3, "stands of each species, each of other trees")
    designs: Some[str] = key(
        ("single", "diamond", "corners"), "scan designs; `list` takes positions_m", ZANDE
    )
    positions_m: tuple[tuple[float, float], ...] = key((), "positions of the design `list`")
    height_m: NotNegative = key(1.3, "height of the scanner above the ground")
    zenith_step_deg: Annotated[float, Gt(0), Le(10)] = key(0.25, "step from 0 to 90", LMS)
    azimuth_steps_deg: Some[Annotated[float, Gt(0), Le(30)]] = key(
        (0.5, 0.2, 0.1, 0.04, 0.02), "of one scan; k scans take k times these", ZANDE
    )
    beam_divergence_mrad: NotNegative = key(4.4, "full angle of the beam, 0.25°", LMS)
    exit_aperture_m: NotNegative = key(0.01, "diameter of the beam at the scanner")
    sub_rays: Annotated[int, Ge(1), Le(64)] = key(7, "rays that sample one beam")
    reflectance: Annotated[float, Gt(0), Le(1)] = key(0.45, "of leaf and wood at 905 nm")
    min_energy: Share = key(0.1, "reflected share of the beam that makes a return", ZANDE)
    pulse_m: NotNegative = key(0.5, "nearer targets reflect together")
    max_returns: Annotated[int, Ge(1), Le(15)] = key(1, "kept of a beam; 1: the first alone", ZANDE)
    voxel_size_m: Positive = key(0.1, "voxels that are hit, passed or never reached", ZANDE)
    cell_size_m: Positive = key(1.0, "cells of contact frequency and density", ZANDE)
    density_step_deg: Positive = key(0.1, "azimuth step whose beams estimate density")
    candidates: Annotated[int, Ge(2), Le(5)] = key(5, "planner: places along each edge")
    canopy: str = key(
        "", "planner: airborne cloud to plan from, relative to data_dir; empty: scans"
    )
    plan_scans: Annotated[int, Ge(2), Le(12)] = key(6, "planner: largest number of scans")
    kriging_range_m: Positive = key(2.0, "distance over which density is alike, for the fill")
    kriging_neighbours: Annotated[int, Ge(3), Le(64)] = key(16, "known cells that fill a cell")

    @property
    def scanner(self) -> dict[str, Any]:
        """What the scanner is like, as `survey.hemisphere_scanner.Hemisphere` takes it."""
        return self.model_dump(
            include={
                "zenith_step_deg",
                "azimuth_steps_deg",
                "beam_divergence_mrad",
                "exit_aperture_m",
                "sub_rays",
                "reflectance",
                "min_energy",
                "pulse_m",
                "max_returns",
            }
        )
