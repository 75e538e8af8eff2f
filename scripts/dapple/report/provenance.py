"""How a run came about: what it cost, what it ran with, and the sums of what it made."""

import hashlib
import platform
from collections.abc import Iterable, Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import pandas as pd
import yaml

from dapple.figures import style
from dapple.formats import tables
from dapple.report.blocks import Block, Code, Listing, Text, number, table

PACKAGES = (
    "dapple", "snakemake", "mitsuba", "drjit", "numpy", "pandas", "xarray", "pvlib", "prosail",
    "laspy", "less3d", "plotly", "jinja2",
)  # fmt: skip


def cost(folder: Path) -> Iterator[Block]:
    """Time and memory, in a sentence and by step."""
    path = folder / "runtime.csv"
    if not path.is_file():
        return
    found = tables.read(path)
    dear = found.loc[found["wall_s"].idxmax()]
    big = found.loc[found["peak_rss_mb"].idxmax()]
    yield Text(
        [
            f"{len(found)} steps took {number(found['cpu_s'].sum())} s of processor time. The "
            f"longest was {_step(dear)} with {number(dear['wall_s'])} s; the most memory took "
            f"{_step(big)} with {number(big['peak_rss_mb'])} MB."
        ]
    )
    yield table(
        found.sort_values("wall_s", ascending=False, kind="stable"),
        "Time and memory of every step",
        named=style.label,
    )


def _step(row: pd.Series) -> str:
    name = str(row["reconstruction"])
    of = "" if name in ("", "nan") else f" of {style.label(name)}"
    return f"{style.label(str(row['step']))}{of}"


def versions() -> Listing:
    """The programs that this page's numbers come from."""
    found = [("Python", platform.python_version()), ("machine", platform.platform(terse=True))]
    for name in PACKAGES:
        try:
            found.append((name, version(name)))
        except PackageNotFoundError:
            continue
    return Listing(found)


def configuration(folder: Path) -> Iterator[Block]:
    """The seed, and every key of the run as it was merged."""
    path = folder / "config.yaml"
    if not path.is_file():
        return
    text = path.read_text(encoding="utf-8")
    seed = yaml.safe_load(text).get("seed")
    yield Text([f"Seed {seed}: every stage draws its own stream from it."])
    yield Code(text, "configuration")


def checksums(folder: Path, names: Iterable[str]) -> Listing:
    """SHA-256 of the files that the run was asked for."""
    paths = [folder / name for name in names]
    return Listing(
        [
            (path.relative_to(folder).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest())
            for path in paths
            if path.is_file()
        ]
    )
