"""Does the same input give the same bytes? `make reproduce` runs a small experiment twice to tell.

It runs in two fresh folders, with one core and with two, and every result is compared by its
checksum. Left out is what tells the time: benchmarks, logs, tables of seconds, and the pages and
pictures that show them; they are not made. Then the results are held against
`docs/data/checksums.csv`, which has, for every platform on which it was written, the checksum of
each result, how many numbers it holds, the geometric mean of their magnitudes, their root mean
square, and how far these may move as a share of themselves. After a dependency was updated, and on
a platform that the table does not have, it names the results that moved, and the rules that moved
while nothing before them in the rule graph did.

`--folder` keeps the runs; asked again with it, a run that was broken off goes on.

`--write` renews the rows of this platform. Tolerances are measured then: a third run makes NumPy,
OpenBLAS and Numba compute as on an older processor, and a result may move ten times as far.
"""

import argparse
import json
import os
import platform
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import laspy
import numpy as np
import pandas as pd
import xarray as xr
import yaml
from rule_graph import arguments, arrows

from dapple.formats import ply
from dapple.provenance import sha256

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs/data/checksums.csv"
LIMIT_S = 3600
TELL_THE_TIME = ("benchmarks", "logs", "figures", "runtime.csv", "report.html")
OLDER_PROCESSOR = {
    "NUMBA_CPU_NAME": "nehalem",
    "OPENBLAS_CORETYPE": "Nehalem",
    "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4",
}
LEAST_TOLERANCE = 1e-6
KEY = ["platform", "experiment", "result"]
MEASURES = ["numbers", "geometric_mean", "rms"]


def this_platform() -> str:
    """Operating system, kind of processor with its widest vectors, and Python."""
    flags = set()
    if (told := Path("/proc/cpuinfo")).exists():
        flags = set(told.read_text().split())
    width = next((f" {one}" for one in ("avx512f", "avx2", "avx") if one in flags), "")
    python = ".".join(platform.python_version_tuple()[:2])
    return f"{platform.system()} {platform.machine()}{width}, Python {python}"


def compared(names: Iterable[Path]) -> list[Path]:
    """Those of the results, relative to their folder, that do not tell the time."""
    return [name for name in names if name.parts[0] not in TELL_THE_TIME]


def checksums(folder: Path) -> dict[str, str]:
    """SHA-256 of every result that does not tell the time, by its path in the folder."""
    found = (path.relative_to(folder) for path in sorted(folder.rglob("*")) if path.is_file())
    return {str(path): sha256(folder / path) for path in compared(found)}


def numbers(path: Path) -> np.ndarray:
    """All finite numbers in a result, flat; empty where it is no table, grid, cloud or mesh."""
    found = [np.asarray(part, np.float64).ravel() for part in _arrays(path)]
    flat = np.concatenate([np.empty(0), *found])
    return flat[np.isfinite(flat)]


def _arrays(path: Path) -> Iterator[Any]:
    """Arrays and numbers that a file holds."""
    if path.suffix in (".csv", ".parquet"):
        table = pd.read_csv(path) if path.suffix == ".csv" else pd.read_parquet(path)
        yield from (table[name] for name in table.select_dtypes("number"))
    elif path.suffix == ".nc":
        with xr.open_dataset(path, decode_times=False) as dataset:
            for variable in dataset.variables.values():
                # uint64: checksums of what was traced, of which no digit means much or little
                if variable.dtype.kind in "iuf" and variable.dtype != np.uint64:
                    yield variable.to_numpy()
    elif path.suffix == ".laz":
        cloud = laspy.read(path)
        yield from (cloud[name] for name in cloud.point_format.dimension_names)
    elif path.suffix == ".ply":
        yield from ply.read(path)
    elif path.suffix in (".json", ".yaml"):
        read = json.loads if path.suffix == ".json" else yaml.safe_load
        yield from _plain(read(path.read_text()))


def _plain(value: Any) -> Iterator[float]:
    """Numbers in lists and mappings."""
    if isinstance(value, int | float):
        yield value
    elif isinstance(value, Mapping):
        yield from (number for inner in value.values() for number in _plain(inner))
    elif isinstance(value, list):
        yield from (number for inner in value for number in _plain(inner))


def measures(path: Path) -> dict[str, float]:
    """How many numbers a result holds, and how large they are."""
    found = numbers(path)
    sizes = np.abs(found[found != 0])
    return {
        "numbers": len(found),
        "geometric_mean": float(np.exp(np.log(sizes).mean())) if len(sizes) else 0.0,
        "rms": float(np.sqrt((found**2).mean())) if len(found) else 0.0,
    }


def described(folder: Path, experiment: str, rule_of: Mapping[str, str]) -> pd.DataFrame:
    """One row per result of a run."""
    rows = [
        {
            "platform": this_platform(),
            "experiment": experiment,
            "rule": rule_of.get(name, ""),
            "result": name,
            "sha256": digest,
        }
        | measures(folder / name)
        for name, digest in checksums(folder).items()
    ]
    return pd.DataFrame(rows)


def moved(known: pd.DataFrame, found: pd.DataFrame) -> pd.DataFrame:
    """Results whose checksum is another than the known one, gone and new ones among them.

    Returns
    -------
    DataFrame
        `result`, `rule`, and `share`: by how much their numbers moved as a share of themselves, or
        infinite where there is nothing to compare; `tolerance` of the known one, 0 where new.
    """
    both = known.merge(found, on="result", how="outer", suffixes=("_known", ""))
    both = both[both["sha256_known"] != both["sha256"]]
    before = both[[f"{name}_known" for name in MEASURES]].to_numpy(float)
    now = both[MEASURES].to_numpy(float)
    with np.errstate(divide="ignore", invalid="ignore"):
        shares = np.where(now == before, 0.0, np.abs(now - before) / np.abs(before))
    told = np.isfinite(shares).all(axis=1) & (now[:, 0] > 0)
    return pd.DataFrame(
        {
            "result": both["result"],
            "rule": both["rule"].fillna(both["rule_known"]),
            "share": np.where(told, shares.max(axis=1), np.inf),
            "tolerance": both["tolerance"].fillna(0.0) if "tolerance" in both else 0.0,
        }
    ).sort_values("share", ascending=False)


def first_of(rules: Iterable[str], pairs: set[tuple[str, str]]) -> list[str]:
    """Those of the rules before which, in the rule graph, none of the others comes."""
    before: dict[str, set[str]] = {}
    for first, then in pairs:
        before.setdefault(then, set()).add(first)

    def needed(rule: str) -> set[str]:
        return set().union(*({one} | needed(one) for one in before.get(rule, ())))

    given = set(rules)
    return sorted(rule for rule in given if not given & needed(rule))


def snakemake(folder: Path, *words: str, cores: int = 1, **variables: str) -> str:
    """Run Snakemake on this clone with its results in a folder; what it prints."""
    command = [sys.executable, "-m", "snakemake", "-s", str(ROOT / "Snakefile")]
    command += ["--directory", str(folder), "--cores", str(cores), *words]
    done = subprocess.run(
        command,
        cwd=ROOT,
        env={key: value for key, value in os.environ.items() if key != "PYTHONPATH"} | variables,
        stdin=subprocess.DEVNULL,
        capture_output=True,
        text=True,
        timeout=LIMIT_S,
    )
    if done.returncode:
        sys.exit(f"{' '.join(command)}\n{done.stderr[-4000:]}")
    return done.stdout


def rules_of_results(folder: Path, configured: list[str], experiment: str) -> dict[str, str]:
    """Which rule made a result, as Snakemake tells."""
    rows = snakemake(folder, "--summary", *configured).splitlines()
    cells = (row.split("\t") for row in rows[1:])
    start = f"results/{experiment}/"
    return {row[0].removeprefix(start): row[2] for row in cells if row[0].startswith(start)}


def tell(title: str, changes: pd.DataFrame, pairs: set[tuple[str, str]]) -> bool:
    """Print what moved; whether all of it lies within its tolerance."""
    print(f"{title}: {len(changes)} results moved")
    for row in changes.itertuples():
        verdict = "within" if row.share <= row.tolerance else "beyond"
        print(f"  {row.result} ({row.rule}) by {row.share:.2g}, {verdict} {row.tolerance:.2g}")
    if len(changes):
        print(f"  moved first: {', '.join(first_of(changes['rule'], pairs))}")
    return bool((changes["share"] <= changes["tolerance"]).all())


def main() -> None:
    """Run, compare, tell, and end with an error where results moved further than they may."""
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--experiment", default="virtual-apple-small", help="of config/")
    options.add_argument("--write", action="store_true", help="renew the rows of this platform")
    options.add_argument("--folder", type=Path, help="keep the runs here")
    asked = options.parse_args()
    configured = ["--configfile", str(ROOT / f"config/{asked.experiment}.yaml")]
    known = pd.read_csv(TABLE) if TABLE.exists() else pd.DataFrame(columns=KEY)
    here = (known["platform"] == this_platform()) & (known["experiment"] == asked.experiment)
    of_rules = snakemake(ROOT, *arguments(asked.experiment))
    pairs = arrows(of_rules)
    kept = nullcontext(asked.folder.resolve()) if asked.folder else None
    with kept or tempfile.TemporaryDirectory(prefix="reproduce-") as scratch:

        def run(name: str, cores: int, **variables: str) -> pd.DataFrame:
            folder = Path(scratch, name)
            rule_of = rules_of_results(folder, configured, asked.experiment)
            results = Path("results", asked.experiment)
            wanted = (str(results / name) for name in compared(map(Path, rule_of)))
            snakemake(folder, *wanted, "--quiet", "all", *configured, cores=cores, **variables)
            return described(folder / results, asked.experiment, rule_of)

        one, two = run("one core", 1), run("two cores", 2)
        print(f"{len(one)} results on {this_platform()}")
        same = tell("two cores against one", moved(one, two), pairs)
        if asked.write:
            older = moved(one, run("older processor", 2, **OLDER_PROCESSOR))
            tell("an older processor", older, pairs)
            shares = older.set_index("result")["share"].reindex(one["result"]).fillna(0.0)
            tolerance = np.maximum(10 * shares.to_numpy(), LEAST_TOLERANCE)
            rows = pd.concat([known[~here], one.assign(tolerance=tolerance)])
            rows.sort_values(KEY).to_csv(TABLE, index=False, float_format="%.9g")
        elif len(known):
            elsewhere = known[known["experiment"] == asked.experiment]
            of = (
                known[here]
                if here.any()
                else elsewhere[elsewhere["platform"] == elsewhere["platform"].iloc[0]]
            )
            name = of["platform"].iloc[0]
            same &= tell(f"the table's {name}", moved(of, one), pairs)
    sys.exit(0 if same else 1)


if __name__ == "__main__":
    main()
