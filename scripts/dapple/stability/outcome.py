"""How a run came out: agreement of light with the true world, leaf area, classes, time."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from dapple.cloud.scores import scores
from dapple.errors import InputError
from dapple.formats.meshes import empty
from dapple.formats.netcdf import times
from dapple.light import light_datasets
from dapple.light.light_model import Tracing
from dapple.light.series import Light
from dapple.stability.chain import Chain, true_conditions
from dapple.stability.stressors import Conditions, Level, Stressor
from dapple.stats.agreement import rmse_rel
from dapple.streams import stream_seed
from dapple.structure.voxel_sizes import name_of
from dapple.verdict import signals
from dapple.verdict.run_data import RunData, points_per_polygon, with_light
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
    chain: Chain, stressor: Stressor, level: Level, seed: int, reconstructions: Sequence[str]
) -> list[dict[str, Any]]:
    """Run all reconstructions under one degree of a stressor.

    Parameters
    ----------
    chain : Chain
        Of the world.
    stressor, level
        What is made worse, how much.
    seed : int
        Number of the world, for the table.
    reconstructions : sequence of str
        Their names, of `reconstructions.names`.

    Returns
    -------
    list of dict
        One row a reconstruction. One that cannot be made says why in `failed`, and its r is NaN.
    """
    conditions = level.conditions
    truth = chain.light("truth", conditions)
    true_area_m2 = chain.structure("truth", conditions).leaf_area_m2
    open_sky = chain.open_sky(conditions)
    head = {
        "stressor": stressor.name,
        "level": level.value,
        "seed": seed,
        "label": level.label,
        "harmless": level.value == stressor.harmless,
    }
    scored = _tried(lambda: class_scores(chain, conditions))
    head |= scored if isinstance(scored, dict) else {}
    found, light = [], {}
    for name in reconstructions:
        row = head | {"reconstruction": name, "failed": ""}
        own = _tried(lambda n=name: chain.light(n, conditions))
        if isinstance(own, InputError):
            row["failed"] = str(own)
        else:
            light[name] = own
            area_m2 = chain.structure(name, conditions).leaf_area_m2
            row |= agreement(own.par, truth.par, open_sky)
            row |= {
                "leaf_area_m2": area_m2,
                "leaf_area_bias": area_m2 / true_area_m2 - 1,
                "wall_s": chain.seconds_of(name),
            }
        found.append(row)
    # None where there is not even a classified cloud.
    seen = _tried(lambda: signals.measure(run_data(chain, conditions, light, truth)))
    return [row | (seen if isinstance(seen, dict) else {}) for row in found]


def class_scores(chain: Chain, conditions: Conditions) -> dict[str, float]:
    """F1 of leaf and wood: of the classes in use, by a threshold of reflectance, by geometry."""
    clouds = {
        "": chain.classes(conditions),
        "_threshold": chain.classified(conditions, "reflectance"),
        "_geometry": chain.classified(conditions, "geometry"),
    }
    found: dict[str, float] = {}
    for suffix, cloud in clouds.items():
        scored = scores(cloud.attributes["Classification"], cloud.attributes["TrueClass"])
        found |= {f"f1_{kind}{suffix}": scored[kind]["f1"] for kind in ("leaf", "wood")}
    return found


def run_data(
    chain: Chain, conditions: Conditions, light: dict[str, Light], truth: Light
) -> RunData:
    """What a run leaves behind for a verdict: no truth in it but what PAR sensors recorded.

    Parameters
    ----------
    chain : Chain
    conditions : Conditions
    light : dict of str to Light
        Of the reconstructions that came through.
    truth : Light
        What sensors record, with the noise of an ordinary sensor and by the right clock.
    """
    cloud = chain.classes(conditions)
    meshes = _tried(lambda: chain.polygons(conditions))
    if isinstance(meshes, InputError):
        meshes = {"leaf": empty(), "wood": empty()}
    discs, facts = chain.surfels(conditions) if "surfels" in light else (None, {})
    voxels = {
        name_of(size_m): _tried(lambda m=size_m: chain.voxels(conditions, m))
        for size_m in chain.setup.sizes_m
    }
    run = RunData(
        shots=chain.shots(conditions),
        cloud=cloud,
        leaves=meshes["leaf"],
        wood=meshes["wood"],
        points_per_polygon=points_per_polygon(
            cloud, meshes["leaf"], chain.polygon_size_m(conditions)
        ),
        surfels=discs,
        surfel_facts=facts,
        beam={
            "exit_aperture_m": chain.setup.surfels["beam_diameter_m"],
            "beam_divergence_mrad": chain.setup.surfels["beam_divergence_mrad"],
        },
        voxels={n: grid for n, grid in voxels.items() if not isinstance(grid, InputError)},
    )
    # Records and light are stamped by the clock that is believed.
    stamps, sensors_m = times(chain.sky(true_conditions(conditions))), chain.sensors_m(conditions)
    labels = [str(number) for number in range(len(sensors_m))]
    recorded = simulate(
        light_datasets.as_dataset(truth, labels, stamps), seed=stream_seed(chain.seed, "records")
    )
    recorded["time"] = recorded["time"].dt.tz_localize(None)  # as in datasets
    tracing = Tracing(**chain.setup.light["tracing"])
    return with_light(
        run,
        {name: light_datasets.as_dataset(own, labels, stamps) for name, own in light.items()},
        lambda name: chain.loaded(name, conditions),
        sensors_m=sensors_m,
        sky=chain.sky(conditions),
        measured_umol_m2_s=recorded.set_index(["sensor", "time"])["par_umol_m2_s"].to_xarray(),
        sun_diameter_deg=tracing.sun_diameter_deg,
        aperture_m=tracing.aperture_m,
        response=tracing.response,
        seed=stream_seed(chain.seed, "shift"),
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
