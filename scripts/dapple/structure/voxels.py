"""Plant area density in voxels, from shots that are followed through a grid."""

from collections.abc import Iterable

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure import densities, traversal
from dapple.structure.pad_estimators import ESTIMATORS
from dapple.structure.returns import Kinds
from dapple.structure.voxel_data import CAPPED, NOT_REACHED, TOO_FEW_SHOTS
from dapple.structure.voxel_sums import Grid, Sums, accumulate


def plant_area_density(
    chunks: Shots | Iterable[Shots],
    grid: Grid,
    *,
    kinds: Kinds = None,
    estimator: str = "fpl",
    leaf_angle_distribution: str = "spherical",
    single_leaf_area_m2: float = 0.0,
    max_pad_m2_m3: float = 5.0,
    min_shots: int = 5,
    contact_voxel_m: float = 0.05,
    beam_divergence_mrad: float = 0.0,
    beam_diameter_m: float = 0.0,
    allow_missing_misses: bool = False,
) -> xr.Dataset:
    """Estimate plant area density in the voxels of a grid.

    `accumulate`, then `estimate`: parameters, result and errors are theirs. Where wood stands
    among the leaves, `fpl` is the estimator that stays right (see `estimators`).
    """
    sums = accumulate(
        chunks,
        grid,
        kinds=kinds,
        leaf_angle_distribution=leaf_angle_distribution,
        single_leaf_area_m2=single_leaf_area_m2,
        max_pad_m2_m3=max_pad_m2_m3,
        contact_voxel_m=contact_voxel_m,
        beam_divergence_mrad=beam_divergence_mrad,
        beam_diameter_m=beam_diameter_m,
        allow_missing_misses=allow_missing_misses,
    )
    return estimate(sums, estimator=estimator, min_shots=min_shots)


def estimate(sums: Sums, *, estimator: str = "fpl", min_shots: int = 5) -> xr.Dataset:
    """Turn sums into plant area density by every estimator.

    Parameters
    ----------
    sums : Sums
    estimator : str
        The one of `ESTIMATORS` that becomes `plant_area_density_m2_m3`.
    min_shots : int
        Voxels entered by fewer shots are unknown: NaN, not zero.

    Returns
    -------
    xarray.Dataset
        Dimensions x, y, z at the voxels' centres (local frame). `pad_<estimator>_m2_m3` for each
        estimator and `plant_area_density_m2_m3`, capped; `standard_error_m2_m3` of `fpl`;
        `n_shots`, `n_hits`, `path_length_m` (sum of potential paths), `mean_zenith_deg` (between
        beams and the vertical, 0 to 90), `entering`, `intercepted` (beam shares, or sections
        [m²]), and `flag`: 1 not reached by any shot, 2 fewer than `min_shots`, 4 capped.

    Raises
    ------
    InputError
        The estimator is not known, or its sums were not asked for.
    """
    if estimator not in ESTIMATORS:
        raise InputError(
            "voxels.estimator", f"`{estimator}`", f"one of {', '.join(ESTIMATORS)}", "Choose one."
        )
    visits, hits = sums.visits, sums.hits
    n_shots, weight = visits[:, traversal.N_SHOTS], hits[:, traversal.HIT_MOMENTS]
    entering = visits[:, traversal.VISIT_MOMENTS]
    found = {name: one.load()(sums) for name, one in ESTIMATORS.items()}
    pad = {name: values for name, values in found.items() if values is not None}
    if estimator not in pad:
        raise InputError(
            "voxels.estimator",
            f"`{estimator}` with `contact_voxel_m: {sums.settings['contact_voxel_m']:g}`",
            "a size of sub-voxels",
            "Set contact_voxel_m, for example to 0.05.",
        )
    error = densities.fpl_standard_error(sums)
    unknown = n_shots < min_shots
    capped = ~unknown & (pad[estimator] >= sums.max_pad_m2_m3)
    flag = (
        NOT_REACHED * (n_shots == 0) + TOO_FEW_SHOTS * (unknown & (n_shots > 0)) + CAPPED * capped
    )
    for name, values in pad.items():
        pad[name] = np.where(unknown, np.nan, np.minimum(values, sums.max_pad_m2_m3))
    with np.errstate(invalid="ignore"):
        zenith = np.degrees(visits[:, traversal.ANGLE] / n_shots)
    variables = {
        "plant_area_density_m2_m3": (pad[estimator], f"plant area density ({estimator})"),
        **{f"pad_{k}_m2_m3": (v, f"plant area density ({k})") for k, v in pad.items()},
        "standard_error_m2_m3": (
            np.where(unknown, np.nan, error),
            "standard error of pad_fpl_m2_m3 from the finite number of beams",
        ),
        "path_length_m": (visits[:, traversal.PATH], "sum of potential path lengths"),
        "mean_zenith_deg": (zenith, "mean angle between beams and the vertical"),
        "n_shots": (n_shots.astype(np.int32), "number of shots that entered"),
        "n_hits": (hits[:, traversal.N_HITS].astype(np.int32), "number of leaf hits"),
        "entering": (entering, "sum of the shares (sections) of beams that entered"),
        "intercepted": (weight, "sum of the shares (sections) of beams that leaves intercepted"),
        "flag": (flag.astype(np.uint8), "1 not reached, 2 too few shots, 4 capped"),
    }
    return _dataset(sums, variables, estimator, min_shots)


def _dataset(sums: Sums, variables: dict, estimator: str, min_shots: int) -> xr.Dataset:
    """Give values their shape, units and the settings that made them."""
    units = {"m2_m3": "m2 m-3", "m": "m", "deg": "degree"}
    data = {
        name: (
            ("x", "y", "z"),
            values.reshape(sums.grid.shape),
            {
                "long_name": text,
                "units": next((u for end, u in units.items() if name.endswith(f"_{end}")), "1"),
            },
        )
        for name, (values, text) in variables.items()
    }
    dataset = xr.Dataset(data, coords=sums.grid.centres_m)
    for axis in "xyz":
        dataset[axis].attrs = {"long_name": f"{axis} of voxel centres, local frame", "units": "m"}
    dataset["flag"].attrs |= {
        "flag_masks": np.array([NOT_REACHED, TOO_FEW_SHOTS, CAPPED], np.uint8),
        "flag_meanings": "not_reached too_few_shots capped",
    }
    dataset.attrs = {
        "voxel_size_m": sums.grid.size_m,
        "corner_m": np.asarray(sums.grid.corner_m, np.float64),
        "origin_m": sums.world_origin_m,
        "estimator": estimator,
        "min_shots": min_shots,
        "total_shots": sums.n_shots,
        "total_misses": sums.n_misses,
        "total_scans": sums.n_scans,
        **sums.settings,
    }
    return dataset
