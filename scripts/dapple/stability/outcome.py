"""How a run came out: agreement of light with the true world, leaf area, classes, time."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.advice.tradeoff import rmse_rel
from dapple.errors import InputError
from dapple.formats.clouds import LEAF
from dapple.formats.netcdf import times
from dapple.light import series
from dapple.light.series import Light
from dapple.stability.chain import SHIFT_M, Chain, f1_of, true_conditions
from dapple.stability.reconstructions import METHODS, size_of
from dapple.stability.stressors import Conditions, Level, Stressor
from dapple.streams import stream_seed
from dapple.verdict import signals
from dapple.verdict.inputs import Evidence, count_points, no_mesh
from dapple.virtual.sensor_model import simulate

COLUMNS = [
    "stressor",
    "level",
    "reconstruction",
    "seed",
    "r",
    "rmse_rel",
    "flagged",
    "label",
    "harmless",
    "bias_rel",
    "mean_par_rel",
    "leaf_area_m2",
    "leaf_area_bias",
    "f1_leaf",
    "f1_wood",
    "f1_leaf_threshold",
    "f1_wood_threshold",
    "f1_leaf_geometry",
    "f1_wood_geometry",
    "wall_s",
    "failed",
]
"""Of one batch, before the signals; `flagged` is filled by the verdict."""


def agreement(par: np.ndarray, truth: np.ndarray, open_sky: np.ndarray) -> dict[str, float]:
    """Compare light with the true light.

    Parameters
    ----------
    par, truth : (s, t) float64
        PAR at the same sensors and times [µmol m⁻² s⁻¹].
    open_sky : (t,) float64
        PAR without a tree [µmol m⁻² s⁻¹].

    Returns
    -------
    dict
        `r` over all sensors and times; `rmse_rel`, `bias_rel` (par less truth) and
        `mean_par_rel` as shares of open-sky PAR. r is NaN where one of them is constant.
    """
    share = par / open_sky
    constant = min(np.ptp(par), np.ptp(truth)) == 0
    return {
        "r": np.nan if constant else float(np.corrcoef(par.ravel(), truth.ravel())[0, 1]),
        "rmse_rel": rmse_rel(par, truth, open_sky),
        "bias_rel": float((share - truth / open_sky).mean()),
        "mean_par_rel": float(share.mean()),
    }


def rows(
    chain: Chain, stressor: Stressor, level: Level, seed: int, wanted: Iterable[str]
) -> list[dict[str, Any]]:
    """Run all methods under one degree of a stressor.

    Parameters
    ----------
    chain : Chain
        Of the world.
    stressor, level
        What is made worse, how much.
    seed : int
        Number of the world, for the table.
    wanted : iterable of str
        Methods, as in `methods`.

    Returns
    -------
    list of dict
        One row a method. One that cannot run says why in `failed`, and its r is NaN.
    """
    conditions = level.conditions
    truth = chain.light("truth", conditions)[0]
    true_area_m2 = chain.structure("truth", conditions).leaf_area_m2
    open_sky = chain.open_sky(conditions)
    head = {
        "stressor": stressor.name,
        "level": level.value,
        "seed": seed,
        "label": level.label,
        "harmless": level.value == stressor.harmless,
    }
    classes = _tried(lambda: chain.classifiers(conditions) | f1_of(chain.classes(conditions)))
    head |= classes if isinstance(classes, dict) else {}
    found, light = [], {}
    for name in methods(wanted):
        row = head | {"reconstruction": name, "failed": ""}
        lit = _tried(lambda n=name: chain.light(n, conditions))
        if isinstance(lit, InputError):
            row["failed"] = str(lit)
        else:
            light[name] = lit
            area_m2 = chain.structure(name, conditions).leaf_area_m2
            row |= agreement(lit[0].par, truth.par, open_sky)
            row |= {
                "leaf_area_m2": area_m2,
                "leaf_area_bias": area_m2 / true_area_m2 - 1,
                "wall_s": chain.seconds_of(name),
            }
        found.append(row)
    seen = _signals(chain, conditions, light, truth)
    return [row | seen for row in found]


def _signals(
    chain: Chain, conditions: Conditions, light: dict[str, tuple[Light, Light]], truth: Light
) -> dict[str, float]:
    """Signals that need no truth; none where there is not even a classified cloud."""
    found = _tried(lambda: signals.measure(evidence(chain, conditions, light, truth)))
    return found if isinstance(found, dict) else {}


def evidence(
    chain: Chain, conditions: Conditions, light: dict[str, tuple[Light, Light]], truth: Light
) -> Evidence:
    """What a run leaves behind for a verdict: no truth in it but what PAR sensors recorded.

    Parameters
    ----------
    chain : Chain
    conditions : Conditions
    light : dict of str to (Light, Light)
        Of the methods that came through, as `Chain.light` gives it.
    truth : Light
        What sensors record, with the noise of an ordinary sensor and by the right clock.
    """
    cloud = chain.classes(conditions)
    leaves_m = cloud.xyz_m[cloud.attributes["Classification"] == LEAF]
    meshes = _tried(lambda: chain.polygons(conditions))
    has_polygons = isinstance(meshes, dict)
    meshes = meshes if has_polygons else {"leaf": no_mesh(), "wood": no_mesh()}
    true_sky = chain.sky(true_conditions(conditions))[0]
    sky, places_m = chain.sky(conditions)[0], chain.sensors_m(conditions)
    records = simulate(_dataset(truth, true_sky), seed=stream_seed(chain.seed, "records"))
    records["time"] = records["time"].dt.tz_localize(None)  # as in datasets
    records = records.set_index(["sensor", "time"])["par_umol_m2_s"].to_xarray()
    voxels = {
        name: _tried(lambda n=name: chain.voxels(conditions, size_of(n)))
        for name in METHODS
        if name.startswith("voxels_") and not name.endswith("_corrected")
    }
    edge_m = chain.setup.polygons["voxel_size_m"] * conditions.voxel_factor
    return Evidence(
        shots=chain.shots(conditions),
        cloud=cloud,
        leaves=meshes["leaf"],
        wood=meshes["wood"],
        points_per_polygon=count_points(leaves_m, edge_m) if has_polygons else None,
        voxels={n: grid for n, grid in voxels.items() if not isinstance(grid, InputError)},
        light={name: _dataset(pair[0], true_sky) for name, pair in light.items()},
        shifted_light={name: _dataset(pair[1], true_sky) for name, pair in light.items()},
        sensors_m=places_m,
        sun_zenith_deg=sky["sun_zenith_deg"].to_numpy(),
        sun_azimuth_deg=sky["sun_azimuth_deg"].to_numpy(),
        shift_m=SHIFT_M,
        measured_umol_m2_s=records,
    )


def _dataset(light: Light, sky: xr.Dataset) -> xr.Dataset:
    """Light as the files of a run have it, stamped by the clock that is believed."""
    parts = {name: getattr(light, name) for name in ("direct", "sky", "scattered")}
    return series.dataset(
        [str(number) for number in range(len(light.par))],
        times(sky),
        par=light.par,
        standard_error=light.standard_error,
        **parts,
    )


def _tried(make) -> Any:
    """A result, or the input error that stood in its way."""
    try:
        return make()
    except InputError as error:
        return error


def table(found: list[dict[str, Any]]) -> pd.DataFrame:
    """Rows as a table, the contract's columns first, signals last."""
    frame = pd.DataFrame(found)
    first = [name for name in COLUMNS if name in frame or name == "flagged"]
    return frame.reindex(columns=[*first, *(n for n in frame.columns if n not in first)])


def methods(wanted: Iterable[str] = ()) -> list[str]:
    """Names of the methods that are wanted; empty: of all, the truth left out.

    Raises
    ------
    InputError
        A method that there is not.
    """
    known = [name for name in METHODS if name != "truth"]
    if unknown := set(wanted) - set(known):
        raise InputError(
            "stability.reconstructions",
            ", ".join(sorted(unknown)),
            f"some of {', '.join(known)}",
            "Choose among these.",
        )
    return list(wanted) or known
