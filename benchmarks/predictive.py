"""How far light under reconstructions is from the truth: the table of predictive intervals, tried.

    python benchmarks/predictive.py worlds FOLDER [--seeds 101 201 ...]
    python benchmarks/predictive.py table FOLDER [--apple results/apple/statistics/records.csv]

`worlds` grows small virtual apple trees of config/stability-small.yaml, with half, once and twice
the leaf area, scans and rebuilds each and writes true and simulated light of 25 sensors, a file a
tree.
`table` makes scripts/dapple/stats/reconstruction_errors.csv of the trees with seeds below 200, and
tries the interval on records of the others, which it did not see, and of the apple's reporting
sensors (docs/data/predictive.csv); without `--apple` the rows of the apple stay as they are.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.config.settings import Settings, validate  # noqa: E402
from dapple.formats import tables  # noqa: E402
from dapple.stability.chain import Chain  # noqa: E402
from dapple.stability.stressors import Conditions  # noqa: E402
from dapple.stability.world import Setup  # noqa: E402
from dapple.stats import predictive  # noqa: E402
from dapple.stats.predictive import SensorError  # noqa: E402

RECONSTRUCTIONS = ("polygons", "surfels", "voxels_0.2", "voxels_1.0", "virtual_leaves")
LEAF_AREA_FACTORS = (1.0, 0.5, 2.0)
"""By the number of the seed, in turn."""
FIRST_UNSEEN, DARK = 200, 0.02
ERRORS = ROOT / "scripts/dapple/stats/reconstruction_errors.csv"


SEEDS = (101, 201, 102, 202, 103, 203, 104, 204, 105, 205, 206)


def setup(settings: Settings) -> Setup:
    """The small tree's run, with sun, disc and spectra in few bands."""
    tracing = settings.light.transport
    names = ("tolerance", "sky_rays", "paths", "max_shadow_rays", "sun_kernel_deg")
    return Setup(
        plant=settings.plant.model_dump(),
        scan=settings.scan.model_dump(),
        clean=settings.clean.model_dump(exclude={"distance_points"})
        | {"pdal": settings.tools.pdal, "cloudcompare": settings.tools.cloudcompare},
        classify=settings.classify.model_dump(),
        polygons=settings.polygons.model_dump() | {"voxel_size_m": settings.polygons.nominal_m},
        surfels=settings.surfels.model_dump() | {"max_deviation": settings.clean.max_deviation},
        voxels=settings.voxels.model_dump(exclude={"sizes_m"}),
        leaves=settings.leaves.model_dump(exclude={"path"}),
        sensors=settings.sensors.grid(),
        site=settings.site.model_dump(exclude={"timezone", "crs"}),
        time=dict(settings.time) | {"step_min": 15.0},
        radiation={"linke_turbidity": settings.radiation.linke_turbidity},
        atmosphere={"model": settings.radiation.sky},
        light={
            "variant": "llvm_ad_mono",
            "model": {"bands": 3, "sky_patches": 145, "max_orders": 6},
            "tracing": {name: getattr(tracing, name) for name in names}
            | {"sun_diameter_deg": settings.light.sun_diameter_deg},
            "truth_factor": 4,
        },
    )


def of_world(settings: Settings, seed: int) -> pd.DataFrame:
    """True and simulated light of one tree, a row a reconstruction, sensor and time."""
    chain = Chain(setup(settings), seed)
    conditions = Conditions(leaf_area_factor=LEAF_AREA_FACTORS[seed % 3])
    truth, open_sky = chain.light("truth", conditions).par, chain.open_sky(conditions)
    sensor, time = np.indices(truth.shape)
    parts = []
    for name in RECONSTRUCTIONS:
        light = chain.light(name, conditions)
        parts.append(
            pd.DataFrame(
                {
                    "reconstruction": name,
                    "seed": seed,
                    "sensor": sensor.ravel(),
                    "time": time.ravel(),
                    "measured": truth.ravel(),
                    "simulated": light.par.ravel(),
                    "standard_error": light.standard_error.ravel(),
                    "baseline": np.broadcast_to(open_sky, truth.shape).ravel(),
                }
            )
        )
    return pd.concat(parts, ignore_index=True)


def table(folder: Path, apple: Path | None, docs: Path) -> None:
    """The table of errors of the first worlds, and how many records of the others it holds."""
    worlds = pd.concat([tables.read(path) for path in sorted(folder.glob("*.csv"))])
    # A sensor in the dark all day stands within the stem.
    most = (worlds["measured"] / worlds["baseline"]).groupby([worlds["seed"], worlds["sensor"]])
    worlds = worlds[most.transform("max") > DARK]
    seen = worlds["seed"] < FIRST_UNSEEN
    errors = predictive.error_table(worlds[seen])
    tables.write(ERRORS, errors, "%.4f")
    sensor = SensorError()
    rng = np.random.default_rng(1)
    unseen = worlds[~seen].reset_index(drop=True)
    # A run's radiation and each sensor's factor err as a whole, a record on its own.
    size = sensor.radiation_relative, sensor.calibration_relative
    runs, sensors = (unseen.groupby(by).ngroup() for by in (["seed"], ["seed", "sensor"]))
    for group, deviation in zip((runs, sensors), size, strict=True):
        unseen["measured"] *= 1 + deviation * rng.normal(size=group.max() + 1)[group]
    noise = np.hypot(sensor.noise_relative * unseen["measured"], sensor.noise_umol_m2_s)
    unseen["measured"] = np.maximum(unseen["measured"] + noise * rng.normal(size=len(unseen)), 0)
    bounds = predictive.interval(unseen, errors, sensor)
    rows = [
        {"records": f"tree {seed}", "reconstruction": name} | held(one, bounds.loc[one.index])
        for (seed, name), one in unseen.groupby(["seed", "reconstruction"])
    ]
    single = [row["held"] for row in rows]
    rows += [
        {"records": "single trees", "reconstruction": name, "held": value}
        for name, value in (("least", min(single)), ("most", max(single)))
    ]
    rows += [
        {"records": "all unseen trees", "reconstruction": name} | held(one, bounds.loc[one.index])
        for name, one in unseen.groupby("reconstruction")
    ]
    if apple:
        records = tables.read(apple)
        records = records[records["part"] == "reporting"].drop(
            columns=["low", "high"], errors="ignore"
        )
        bounds = predictive.interval(records, errors, sensor, leaves_by_chance=True)
        rows += [
            {"records": "apple", "reconstruction": name} | held(one, bounds.loc[one.index])
            for name, one in records.groupby("reconstruction")
        ]
    found = pd.DataFrame(rows)
    if not apple:  # a run of its own: its rows stay as they are
        before = tables.read(docs / "data/predictive.csv")
        found = pd.concat([found, before[before["records"] == "apple"]])
    tables.write(docs / "data/predictive.csv", found)
    print(found.to_string(float_format=lambda value: f"{value:.3f}"))


def held(records: pd.DataFrame, bounds: pd.DataFrame) -> dict[str, float]:
    """Share of records within their bounds, below and above, and the bounds' mean distance.

    `held_partial_shade` is that of records for which 10 to 80 % of the open sky's light was
    simulated; `held_by_error` that of 1.645 standard errors of rays and placements.
    """
    measured = records["measured"]
    inside = measured.between(bounds["low"], bounds["high"])
    partial = (records["simulated"] / records["baseline"]).between(0.1, 0.8)
    found = {
        "n": len(records),
        "held": inside.mean(),
        "below": (measured < bounds["low"]).mean(),
        "above": (measured > bounds["high"]).mean(),
        "held_partial_shade": inside[partial].mean(),
        "width_rel": ((bounds["high"] - bounds["low"]) / records["baseline"]).mean(),
    }
    if "standard_error" in records:
        distance = (measured - records["simulated"]).abs()
        found["held_by_error"] = (distance <= predictive.NORMAL * records["standard_error"]).mean()
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("what", choices=("worlds", "table"))
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=SEEDS)
    parser.add_argument("--apple", type=Path, help="records.csv of a run of config/apple.yaml")
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    if options.what == "table":
        table(options.folder, options.apple, options.docs)
        return
    options.folder.mkdir(parents=True, exist_ok=True)
    settings = validate(yaml.safe_load((ROOT / "config/stability-small.yaml").read_text()))
    for seed in options.seeds:
        tables.write(options.folder / f"{seed}.csv", of_world(settings, seed), "%.3f")
        print(seed, flush=True)


if __name__ == "__main__":
    main()
