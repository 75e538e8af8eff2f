"""Signals that a run can be judged by without knowing the truth, gathered from its run."""

import math

import numpy as np
import xarray as xr

from dapple.formats.meshes import Mesh
from dapple.structure.summary import voxel_area_m2
from dapple.verdict import signals_light, signals_rescan, signals_scan, signals_structure
from dapple.verdict.run_data import RunData
from dapple.virtual import rescan

SEED = 20_240_823
"""Draws the points and beams that are looked at: the same run gives the same signals."""


def measure(run: RunData) -> dict[str, float]:
    """Measure every signal; NaN where the run does not hold it.

    Parameters
    ----------
    run : RunData

    Returns
    -------
    dict of str to float
        Keys are those of `signal_meanings.SIGNALS`, always all of them. Fine and coarse are the
        smallest and the largest voxels there are. Takes less than a second on a tree of half a
        million points and a few million shots.
    """
    sizes = sorted(run.voxels, key=lambda n: float(run.voxels[n].attrs["voxel_size_m"]))
    fine = run.voxels[sizes[0]] if sizes else None
    coarse = run.voxels[sizes[-1]] if len(sizes) > 1 else None
    names = (sizes[0] if sizes else "", sizes[-1] if len(sizes) > 1 else "")
    found = _of_scan(run, fine) | _of_structure(run, fine, coarse)
    return found | _of_surfels(run, fine) | _of_rescan(run, fine, coarse) | _of_light(run, *names)


def _of_scan(run: RunData, fine: xr.Dataset | None) -> dict[str, float]:
    rng = np.random.default_rng(SEED)
    shots, cloud = run.shots, run.cloud
    shift_m, residual_m = signals_scan.scan_fit(cloud, rng)
    found = {
        "scan_count": signals_scan.scan_count(shots, cloud),
        "largest_gap_deg": signals_scan.largest_gap_deg(shots, cloud),
        "noise_share": signals_scan.noise_share(shots, cloud, rng),
        "scan_shift_m": shift_m,
        "scan_residual_m": residual_m,
    }
    coverage = dict.fromkeys(
        ("shots_per_voxel", "unknown_share", "unknown_on_sun_beams", "seen_on_sun_beams"), math.nan
    )
    if fine is not None:
        coverage["shots_per_voxel"] = signals_scan.shots_per_voxel(fine)
        coverage["unknown_share"] = signals_scan.unknown_share(fine)
        sensors_m = run.sensors_m
        zenith_deg, azimuth_deg = run.sun_zenith_deg, run.sun_azimuth_deg
        if sensors_m is not None and zenith_deg is not None and azimuth_deg is not None:
            unknown, seen = signals_scan.on_sun_beams(fine, sensors_m, zenith_deg, azimuth_deg, rng)
            coverage |= {"unknown_on_sun_beams": unknown, "seen_on_sun_beams": seen}
        else:
            # Light may come from anywhere: what holds for the crown holds for its way, on average.
            coverage["unknown_on_sun_beams"] = coverage["unknown_share"]
            coverage["seen_on_sun_beams"] = signals_scan.seen_share(fine)
    return found | coverage | signals_scan.reflectance_classes(cloud, rng)


def _of_structure(
    run: RunData, fine: xr.Dataset | None, coarse: xr.Dataset | None
) -> dict[str, float]:
    rng = np.random.default_rng(SEED)
    leaves, number = run.leaves, run.points_per_polygon
    polygons_m2 = leaves.area_m2 if leaves.n_elements else math.nan

    def of(grid: xr.Dataset | None, signal) -> float:
        return math.nan if grid is None else signal(grid)

    area_fine, area_coarse = (of(grid, voxel_area_m2) for grid in (fine, coarse))
    mean_number = float(np.mean(number)) if number is not None and len(number) else math.nan
    return {
        "wood_share": signals_structure.wood_share(run.cloud),
        "sparse_polygons": signals_structure.sparse_share(number),
        "points_per_polygon": mean_number,
        "distance_to_polygons": signals_structure.distance_to_polygons(run.cloud, leaves, rng),
        "tilt_departure": signals_structure.tilt_departure(leaves, number),
        "lacking_area": of(fine, lambda grid: signals_structure.lacking_share(leaves, grid)),
        "area_polygons_to_fine": signals_structure.log_ratio(polygons_m2, area_fine),
        "area_fine_to_coarse": signals_structure.log_ratio(area_fine, area_coarse),
        "capped_share": of(fine, signals_structure.capped_share),
        "plant_area_index": of(fine, signals_structure.plant_area_index),
        "fine_voxel_to_crown": of(fine, signals_structure.voxels_per_crown),
        "coarse_voxel_to_crown": of(coarse, signals_structure.voxels_per_crown),
    }


def _of_surfels(run: RunData, fine: xr.Dataset | None) -> dict[str, float]:
    facts = run.surfel_facts
    # A scanner that moves has shots, but none that tell of discs.
    untold = 0.0 if run.surfels is not None and run.shots is not None else math.nan
    shots = facts.get("shots_per_disc") or untold
    surfels_m2 = run.surfels.area_m2 if run.surfels is not None else math.nan
    fine_m2 = math.nan if fine is None else voxel_area_m2(fine)
    return {
        "shots_per_surfel": shots,
        "surfels_without_surface": facts.get("without_surface", math.nan),
        "area_surfels_to_fine": signals_structure.log_ratio(surfels_m2, fine_m2),
    }


def _of_rescan(
    run: RunData, fine: xr.Dataset | None, coarse: xr.Dataset | None
) -> dict[str, float]:
    wood = {"wood": run.wood}
    made: dict[str, tuple[dict[str, Mesh], xr.Dataset | None] | None] = {
        "polygons": (wood | {"leaf": run.leaves}, None) if run.leaves.n_elements else None,
        "surfels": None if run.surfels is None else (wood | {"leaf": run.surfels}, None),
        "fine": None if fine is None else (wood, fine),
        "coarse": None if coarse is None else (wood, coarse),
    }
    found = {f"gap_error_{name}": math.nan for name in made}
    if run.shots is None or not len(run.cloud) or not len(run.shots.range_m):
        return found
    crown = rescan.crown_of(run.cloud)
    fired = signals_rescan.some_patches(run.shots, crown, np.random.default_rng(SEED))
    scanner = rescan.scanner_of(run.cloud, [run.shots], **run.beam)
    for name, one in made.items():
        if one is not None:
            meshes, voxels = one
            found[f"gap_error_{name}"] = signals_rescan.gap_error(
                meshes, voxels, fired, crown, scanner, seed=SEED
            )
    return found


def _of_light(run: RunData, fine: str, coarse: str) -> dict[str, float]:
    light, moved = run.light, run.moved_light
    zenith = run.sun_zenith_deg
    r_fine, difference_fine = signals_light.agreement(light.get("polygons"), light.get(fine))
    r_coarse, difference_coarse = signals_light.agreement(light.get(fine), light.get(coarse))
    r_surfels, difference_surfels = signals_light.agreement(light.get("surfels"), light.get(fine))
    names = ("polygons", "surfels", fine, coarse)
    some = next((light[n] for n in names if n in light), None)
    return {
        "lowest_sun_deg": 90 - float(np.max(zenith)) if zenith is not None else math.nan,
        "direct_share": signals_light.direct_share(some),
        "light_contrast": signals_light.contrast(some),
        "r_polygons_fine": r_fine,
        "difference_polygons_fine": difference_fine,
        "r_surfels_fine": r_surfels,
        "difference_surfels_fine": difference_surfels,
        "r_fine_coarse": r_coarse,
        "difference_fine_coarse": difference_coarse,
        "sensitivity_polygons": _sensitivity(light, moved, "polygons"),
        "sensitivity_surfels": _sensitivity(light, moved, "surfels"),
        "sensitivity_fine": _sensitivity(light, moved, fine),
        "sensitivity_coarse": _sensitivity(light, moved, coarse),
        "clock_lag_min": signals_light.best_lag_min(some, run.measured_umol_m2_s),
        "misplaced_share": signals_light.misplaced_share(
            some,
            next((moved[n] for n in names if n in moved), None),
            run.measured_umol_m2_s,
        ),
    }


def _sensitivity(light: dict[str, xr.Dataset], moved: dict[str, xr.Dataset], name: str) -> float:
    return signals_light.shift_sensitivity(light.get(name), moved.get(name))
