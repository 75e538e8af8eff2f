"""How surfels hold under stress, and whether the verdict tells, in one world.

    snakemake --cores 1 --configfile config/stability-surfels.yaml
    python benchmarks/stability_surfels.py results/stability-surfels/stability/batches

Writes r and error by stressor and level (docs/data/stability_surfels.csv), those where another
reconstruction errs less (docs/data/stability_surfels_lost.csv), and how the stored verdict does on
surfels (docs/data/verdict_surfels.csv): its models were fitted to other worlds, without surfels.
"""

import argparse
import sys
from pathlib import Path

import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.verdict import fitting, judgement  # noqa: E402

OWN = "surfels"
BESIDE = ("polygons", "voxels_0.2", "voxels_1.0")
KEY = ["stressor", "level", "label"]
RATES = ("runs", "failures", "failed_levels", "detection", "detection_traced", "false_alarms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--docs", type=Path, default=ROOT / "docs")
    options = parser.parse_args()
    tables = [pd.read_csv(path, dtype={"label": str}) for path in sorted(options.folder.glob("*"))]
    points = pd.concat(tables, ignore_index=True)
    every, told = levels(points), []
    for signals in ("scan", "records"):
        models = judgement.load(with_records=signals == "records")
        runs = fitting.prepared(points[points["reconstruction"] == OWN])
        alarm = fitting.flagged(runs, models)
        rates = fitting.rates(runs, alarm)
        told.append({"signals": signals} | {name: rates[name] for name in RATES})
        runs = points[points["reconstruction"] == OWN]
        raised = runs.assign(alarm=fitting.flagged(runs, models)).set_index(KEY)["alarm"]
        every[f"alarm_{signals}"] = raised.groupby(KEY).max().reindex(every.index)
    every = every.reset_index()
    data = options.docs / "data"
    every.to_csv(data / "stability_surfels.csv", index=False, float_format="%.4g")
    loses = every[every["best"] != OWN]
    loses.to_csv(data / "stability_surfels_lost.csv", index=False, float_format="%.4g")
    pd.DataFrame(told).to_csv(data / "verdict_surfels.csv", index=False, float_format="%.3g")
    print(pd.DataFrame(told).to_string())


def levels(points: pd.DataFrame) -> pd.DataFrame:
    """r and relative RMSE of every level, of surfels and of what stands beside them."""
    values = ["r", "rmse_rel", "leaf_area_m2"]
    wide = points.pivot_table(index=KEY, columns="reconstruction", values=values, sort=False)
    found = pd.DataFrame(index=wide.index)
    for name in (OWN, *BESIDE):
        column = name.replace(".", "")
        found[f"r_{column}"] = wide["r"][name]
        found[f"rmse_{column}"] = wide["rmse_rel"][name]
    found["leaf_area_m2"] = wide["leaf_area_m2"][OWN]
    found["best"] = wide["rmse_rel"][[OWN, *BESIDE]].idxmin(axis=1)
    return found


if __name__ == "__main__":
    main()
