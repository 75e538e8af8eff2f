"""What each step cost: Snakemake's benchmark files as one table."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import pandas as pd

from dapple.errors import InputError

COLUMNS = ["step", "reconstruction", "wall_s", "cpu_s", "peak_rss_mb"]
SOURCES = {"s": "wall_s", "cpu_time": "cpu_s", "max_rss": "peak_rss_mb"}


def read(path: str | Path) -> dict[str, float]:
    """Read one benchmark file: wall-clock time, CPU time and peak resident memory.

    Repeats are averaged. A job that ended before Snakemake could sample it has no CPU time and
    no memory (`NA` or `-`): these are NaN, not zero.

    Returns
    -------
    dict
        `wall_s`, `cpu_s`, `peak_rss_mb`.

    Raises
    ------
    InputError
        The file is not a benchmark file of Snakemake.
    """
    try:
        table = pd.read_csv(path, sep="\t", na_values=["-"])
    except (pd.errors.ParserError, pd.errors.EmptyDataError, UnicodeDecodeError) as error:
        raise _not_a_benchmark(path, f"an unreadable table ({error})") from error
    if missing := [name for name in SOURCES if name not in table]:
        raise _not_a_benchmark(path, f"no column {', '.join(missing)}")
    if table.empty:
        raise _not_a_benchmark(path, "no row")
    try:
        means = table[list(SOURCES)].astype(float).mean()
    except ValueError as error:
        raise _not_a_benchmark(path, f"a cell that is no number ({error})") from error
    return {ours: float(means[theirs]) for theirs, ours in SOURCES.items()}


def name_parts(name: str, reconstructions: Sequence[str]) -> tuple[str, str]:
    """Split the name of a benchmark into step and reconstruction ("" where it has none).

    Parameters
    ----------
    name : str
        Path below the folder of benchmarks, without `.tsv`: `light/voxels_0.2`,
        `light/voxels_0.2/batch_3`, `light.polygons`, `scan`.
    reconstructions : sequence of str
        The names to look for.

    Notes
    -----
    A step that is called as a reconstruction makes it: `polygons` is step polygons of
    reconstruction polygons, `voxels_0.2` is step voxels of reconstruction voxels_0.2.
    """
    for reconstruction in sorted(reconstructions, key=len, reverse=True):
        if name == reconstruction:
            return reconstruction.split("_")[0], reconstruction
        for separator in "/.-_":
            marked = f"{separator}{reconstruction}"
            if name.endswith(marked):
                return name.removesuffix(marked), reconstruction
            if (cut := name.find(f"{marked}/")) > 0:
                return name[:cut], reconstruction
    return name, ""


def collect(
    paths: Iterable[str | Path], folder: str | Path, reconstructions: Sequence[str]
) -> pd.DataFrame:
    """Gather benchmark files into one table.

    Parameters
    ----------
    paths : iterable of path
        Benchmark files below `folder`.
    folder : path
        Folder of the benchmarks of one experiment.
    reconstructions : sequence of str
        Names of the reconstructions of the experiment.

    Returns
    -------
    DataFrame
        `step, reconstruction, wall_s, cpu_s, peak_rss_mb`, sorted. Files of one step and
        reconstruction (batches of one job) are added up; their memory is the largest.
    """
    rows = []
    for path in map(Path, paths):
        name = path.relative_to(folder).as_posix().removesuffix(".tsv")
        step, reconstruction = name_parts(name, reconstructions)
        rows.append({"step": step, "reconstruction": reconstruction, **read(path)})
    table = pd.DataFrame(rows, columns=COLUMNS)
    groups = table.groupby(["step", "reconstruction"], sort=True)
    # A sum with a missing part is unknown, not smaller.
    sums = groups[["wall_s", "cpu_s"]].agg(lambda parts: parts.sum(skipna=False))
    return sums.join(groups["peak_rss_mb"].max()).reset_index()[COLUMNS]


def _not_a_benchmark(path: str | Path, found: str) -> InputError:
    return InputError(
        path,
        found,
        f"a benchmark of Snakemake with columns {', '.join(SOURCES)}",
        "Delete the file and run the step again (snakemake --force with its target).",
    )
