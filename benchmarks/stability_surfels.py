"""How surfels hold under stress, and the verdict's model of them, from one world.

    snakemake --cores 1 --configfile config/stability-surfels.yaml
    python benchmarks/stability_surfels.py results/stability-surfels/stability/batches

Writes r and error by stressor and level (docs/data/stability_surfels.csv), those where another
reconstruction errs less (docs/data/stability_surfels_lost.csv), how the verdict did on runs
that it was not fitted to (docs/data/verdict_surfels.csv), and the models of surfels into
scripts/dapple/verdict/verdict_model.json. The models of other reconstructions stay: they are
fitted to three worlds, without surfels (config/stability.yaml).
"""

import argparse
import sys
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.formats import json  # noqa: E402
from dapple.verdict import fitting, judgement  # noqa: E402

OWN = "surfels"
BESIDE = ("polygons", "voxels_0.2", "voxels_1.0")
RATES = ("runs", "failures", "failed_levels", "detection", "detection_traced", "false_alarms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    parser.add_argument("--model", type=Path, default=judgement.MODEL)
    options = parser.parse_args()
    tables = [pd.read_csv(path, dtype={"label": str}) for path in sorted(options.folder.glob("*"))]
    points = pd.concat(tables, ignore_index=True)
    stored = json.read(options.model)
    told = []
    for kind in ("scan", "records"):
        runs = points[points["reconstruction"] == OWN].reset_index(drop=True)
        with_records = kind == "records"
        stored[kind]["models"] |= fitting.fit(runs, with_records=with_records)
        rates = fitting.validate(runs, with_records=with_records)
        stored[kind]["rates_of_surfels"] = rates
        for check in ("halves", "unseen_stressor"):
            found = {name: rates[check][name] for name in RATES}
            told.append({"signals": kind, "check": check} | found)
    json.write(options.model, stored)
    data = options.docs / "data"
    every = levels(points)
    every.to_csv(data / "stability_surfels.csv", index=False, float_format="%.4g")
    loses = every[every["best"] != OWN]
    loses.to_csv(data / "stability_surfels_lost.csv", index=False, float_format="%.4g")
    pd.DataFrame(told).to_csv(data / "verdict_surfels.csv", index=False, float_format="%.3g")
    print(pd.DataFrame(told).to_string())


def levels(points: pd.DataFrame) -> pd.DataFrame:
    """r and relative RMSE of every level, of surfels and of what stands beside them."""
    key = ["stressor", "level", "label"]
    wide = points.pivot_table(
        index=key, columns="reconstruction", values=["r", "rmse_rel", "leaf_area_m2"], sort=False
    )
    names = [OWN, *BESIDE]
    found = pd.DataFrame(index=wide.index)
    for name in names:
        column = name.replace(".", "")
        found[f"r_{column}"] = wide["r"][name]
        found[f"rmse_{column}"] = wide["rmse_rel"][name]
    found["leaf_area_m2"] = wide["leaf_area_m2"][OWN]
    own = points[points["reconstruction"] == OWN].set_index(key)
    found["harmless"] = own["harmless"].groupby(key).first().reindex(found.index)
    best = wide["rmse_rel"][names].idxmin(axis=1)
    flagged = alarms(points)
    return found.assign(best=best, alarm=flagged.reindex(found.index)).reset_index()


def alarms(points: pd.DataFrame) -> pd.Series:
    """Whether surfels were flagged by a model that was not fitted to the stressor, by level."""
    runs = points[points["reconstruction"] == OWN].reset_index(drop=True)
    told = fitting.unseen_flagged(runs, "stressor", with_records=False)
    return runs.assign(alarm=told).groupby(["stressor", "level", "label"])["alarm"].max()


if __name__ == "__main__":
    main()
