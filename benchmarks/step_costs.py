"""What steps cost: growth of time and memory with size, and how well that tells a run beforehand.

    PYTHONPATH=scripts .venv/bin/python benchmarks/step_costs.py FOLDER [--docs docs/data]

Runs three configurations in FOLDER (where their results are not there yet), fits a straight line
over its driver to each step and writes `step_costs.csv` and `machine.csv` of
`scripts/dapple/estimate/`. Then three others, which the fit has not seen, are run and compared with
what the table tells of them: `estimate.csv`. Seconds are those of the processor, because other
programs may share the machine. The first run is made in a clone that has compiled nothing and
then once more: the difference is what compiling takes.
"""

import argparse
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import yaml
from scipy.optimize import nnls

from dapple.config.settings import Settings, validate
from dapple.estimate import forecast, machine, speed
from dapple.estimate.planned import Job
from dapple.estimate.sizes import ONE, sizes
from dapple.stats import runtime

ROOT = Path(__file__).parents[1]
COLD = "small-tree-cold"
FITTED: dict[str, dict] = {
    "small-tree": {
        "plant": {
            "height_m": 3.5,
            "crown_base_m": 1.0,
            "crown_radius_m": 1.6,
            "dbh_m": 0.09,
            "leaf_area_m2": 15.0,
        },
        "scan": {"positions": 4, "radius_m": 6.0, "angular_step_deg": 0.2},
        "sensors": {"columns": 4, "rows": 4, "spacing_m": 0.7},
        "time": {"step_min": 20},
    },
    "large-tree": {
        "plant": {
            "height_m": 7.5,
            "crown_radius_m": 4.2,
            "dbh_m": 0.22,
            "leaf_area_m2": 130.0,
        },
        "scan": {"positions": 10, "angular_step_deg": 0.11},
        "sensors": {"columns": 12, "rows": 10, "spacing_m": 0.6},
        "time": {"step_min": 5},
    },
    "own-scan": {
        "source": "cloud",
        "data_dir": "results/large-tree",
        "reconstructions": ["polygons", "surfels"],
        "cloud": {"path": "scan/points.laz"},
        "sensors": {"columns": 8, "rows": 9, "spacing_m": 0.6},
        "measured": {"kind": "none"},
    },
}
COMPARED = {
    "virtual-apple-small": "config/virtual-apple-small.yaml",
    "virtual-apple": "config/config.yaml",
    "leafy-tree": "config/leafy-tree.yaml",
}
RENAMED = {"summary": "voxels_summary"}
"""Rules whose benchmarks have another name."""


def processor_s() -> float:
    usage = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in usage)


def run(folder: Path, configfile: Path, *arguments: str) -> None:
    command = [sys.executable, "-m", "snakemake", "--snakefile", str(ROOT / "Snakefile")]
    command += ["--directory", str(folder), "--cores", "1", "--quiet", "all", *arguments]
    command += ["--workflow-profile", str(ROOT / "profiles/default")]
    data = ["--config", f"data_dir={(ROOT / Settings().data_dir).resolve()}"]
    own = [] if configfile.parent == folder else data
    subprocess.run([*command, "--configfile", str(configfile), *own], check=True)


def made(folder: Path, name: str, configfile: Path) -> None:
    """A run, unless its report is there."""
    if (folder / f"results/{name}/report.html").exists():
        return
    run(folder, configfile)
    if name == "small-tree":
        results = folder / "results"
        shutil.copytree(results / name / "benchmarks", results / COLD / "benchmarks")
        run(folder, configfile, "--forceall")


def measured(folder: Path, name: str, settings: Settings) -> pd.DataFrame:
    """Rule, kind of reconstruction, sizes, processor seconds and memory of every job of a run."""
    benchmarks = folder / f"results/{name}/benchmarks"
    rows = []
    for path in sorted(benchmarks.rglob("*.tsv")):
        parts = path.relative_to(benchmarks).as_posix().removesuffix(".tsv")
        step, reconstruction = runtime.name_parts(parts, settings.reconstructions)
        taken = runtime.read(path)
        rows.append(
            {
                "rule": RENAMED.get(step, step),
                "reconstruction": reconstruction,
                "kind": forecast.kind_of(reconstruction),
                "seconds": taken["cpu_s"],
                "megabytes": taken["peak_rss_mb"],
            }
        )
    return pd.DataFrame(rows).fillna(0.0)


def line(size: np.ndarray, values: np.ndarray) -> tuple[float, float]:
    """Constant and slope, none below zero, by relative errors."""
    if np.ptp(size) == 0 or not values.any():
        return float(values.mean()), 0.0
    weight = 1 / np.maximum(values, 1e-3)
    scale = size.max()
    (start, slope), _ = nnls(
        np.column_stack([weight, weight * size / scale]), weight * values, maxiter=1000
    )
    return start, slope / scale


def fitted(runs: list[tuple[pd.DataFrame, dict[str, float]]]) -> pd.DataFrame:
    """The table of costs."""
    jobs = pd.concat(
        [
            table.assign(size=[of[forecast.DRIVERS.get(rule, ONE)] for rule in table["rule"]])
            for table, of in runs
        ]
    )
    rows = []
    for (rule, kind), group in jobs.groupby(["rule", "kind"]):
        size = group["size"].to_numpy()
        start_s, second_each = line(size, group["seconds"].to_numpy())
        start_mb, mb_each = line(size, group["megabytes"].to_numpy())
        rows.append([rule, kind, start_s, second_each, start_mb, mb_each])
    return pd.DataFrame(
        rows, columns=["rule", "kind", "start_s", "second_each", "start_mb", "mb_each"]
    )


def compiling(folder: Path) -> float:
    """Seconds that a clone takes once."""
    sums = []
    for name in (COLD, "small-tree"):
        files = (folder / f"results/{name}/benchmarks").rglob("*.tsv")
        sums.append(sum(np.nan_to_num(runtime.read(path)["cpu_s"]) for path in files))
    return max(sums[0] - sums[1], 0.0)


def snakemake_itself(folder: Path) -> float:
    """Processor seconds of a dry run: reading the rules and what lies there."""
    started = processor_s()
    run(folder, folder / "small-tree.yaml", "--dry-run")
    return processor_s() - started


def compare(folder: Path, name: str, settings: Settings) -> dict[str, float | str]:
    """Seconds and memory of a run, told beforehand and measured."""
    table = measured(folder, name, settings)
    jobs = [Job(*row) for row in table[["rule", "reconstruction"]].to_numpy().tolist()]
    told = forecast.forecast(jobs, sizes(settings), forecast.read(), cores=1, slowness=1.0)
    around = forecast.read()[forecast.SNAKEMAKE, ""].seconds(len(jobs))
    real_s, real_mb = table["seconds"].sum() + around, table["megabytes"].max()
    return {
        "run": name,
        "steps": len(jobs),
        "told_s": told.seconds,
        "measured_s": real_s,
        "ratio_s": told.seconds / real_s,
        "told_mb": told.peak_mb,
        "measured_mb": real_mb,
        "ratio_mb": told.peak_mb / real_mb,
        "unknown": " ".join(told.unknown),
    }


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("folder", type=Path)
    arguments.add_argument("--docs", type=Path)
    options = arguments.parse_args()
    folder = options.folder.resolve()
    runs = []
    for name, keys in FITTED.items():
        path = folder / f"{name}.yaml"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(yaml.safe_dump({"experiment": name} | keys, sort_keys=False))
        made(folder, name, path)
        settings = in_folder(yaml.safe_load(path.read_text()), folder)
        runs.append((measured(folder, name, settings), sizes(settings)))
    table = fitted(runs)
    per_run = snakemake_itself(folder)
    table.loc[len(table)] = [forecast.SNAKEMAKE, "", per_run, 0.0, 0.0, 0.0]
    table.loc[len(table)] = [forecast.COMPILING, "", compiling(folder), 0.0, 0.0, 0.0]
    table.to_csv(forecast.TABLE, index=False, float_format="%.4g")
    reference = machine.measure(processor_s)
    pd.DataFrame(reference.items(), columns=["work", "seconds"]).to_csv(
        speed.REFERENCE, index=False, float_format="%.3g"
    )
    rows = []
    for name, configfile in COMPARED.items():
        made(folder, name, ROOT / configfile)
        keys = yaml.safe_load((ROOT / configfile).read_text())
        data = {"data_dir": str((ROOT / Settings().data_dir).resolve())}
        rows.append(compare(folder, name, in_folder(keys | data, folder)))
    found = pd.DataFrame(rows)
    print(found.to_string(index=False))
    if options.docs:
        found.to_csv(options.docs / "estimate.csv", index=False, float_format="%.4g")


def in_folder(keys: dict, folder: Path) -> Settings:
    """Settings of a run in a folder, whose data lie below it."""
    settings = validate(keys)
    return settings.model_copy(update={"data_dir": str(folder / settings.data_dir)})


if __name__ == "__main__":
    main()
