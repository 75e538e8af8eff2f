"""Drive PDAL's command line with JSON pipelines.

The pipelines run unchanged on PDAL 2.2 (Debian 11) and on current releases.
"""

import json
import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from dapple import programs

REMEDY = "Run the set-up of the README, install pdal with conda, or configure the path of pdal."

OUTLIER_CLASS = 255
"""Marks outliers inside a pipeline: 7, PDAL's default, would take along noise known before."""


@dataclass(frozen=True)
class Result:
    """What a pipeline did.

    Attributes
    ----------
    counts : tuple of int
        Number of points at each `count()` stage, in order.
    metadata : dict
        PDAL's metadata by stage type.
    """

    counts: tuple[int, ...]
    metadata: dict


def find(program: str = "pdal") -> str:
    """Return PDAL's executable: the given path, the project's own `.tools`, or one on PATH."""
    own = programs.PROJECT_ROOT / ".tools" / "pdal" / "bin" / "pdal"
    return programs.find(program, REMEDY, beside=[own])


def version(program: str = "pdal") -> str:
    """Return PDAL's version, as in `2.2.0`."""
    printed = programs.run([find(program), "--version"])
    match = re.search(r"pdal\s+(\d[\d.]*)", printed)
    return match.group(1) if match else "unknown"


def count() -> dict:
    """A stage that counts the points that pass it."""
    return {"type": "filters.stats", "dimensions": "X"}


def keep(dimension: str, interval: str) -> dict:
    """A stage that keeps points whose `dimension` lies in `interval`, as in `(-15:]` or `[:15)`.

    A square bracket includes the bound, a round one does not; NaN lies in no interval.
    """
    return {"type": "filters.range", "limits": f"{dimension}{interval}"}


def remove_outliers(neighbours: int, multiplier: float) -> list[dict]:
    """Stages that remove statistical outliers (mean distance to the nearest neighbours)."""
    find_them = {
        "type": "filters.outlier",
        "method": "statistical",
        "mean_k": neighbours,
        "multiplier": multiplier,
        "class": OUTLIER_CLASS,
    }
    return [find_them, keep("Classification", f"![{OUTLIER_CLASS}:{OUTLIER_CLASS}]")]


def write_las(path: str | Path, offset_m, scale_m: float = 1e-4) -> dict:
    """A stage that writes LAS 1.4, point format 6, with every extra dimension and header record.

    Parameters
    ----------
    path : str or Path
        `.laz` is compressed, `.las` is not.
    offset_m : (3,) array_like
        Header offset: the world coordinates of the local origin [m].
    scale_m : float
        Resolution of the coordinates [m].
    """
    axes = dict(zip("xyz", map(float, offset_m), strict=True))
    return {
        "type": "writers.las",
        "filename": str(path),
        "compression": "laszip" if Path(path).suffix == ".laz" else "none",
        "minor_version": 4,
        "dataformat_id": 6,
        "extra_dims": "all",
        "forward": "vlr",
        **{f"offset_{axis}": offset for axis, offset in axes.items()},
        **{f"scale_{axis}": scale_m for axis in axes},
    }


def uncompress(laz: str | Path, las: str | Path, program: str = "pdal") -> None:
    """Write a LAZ file, of whatever age, as LAS with every extra dimension.

    Raises
    ------
    ProgramError
        PDAL cannot read it.
    """
    reader = {"type": "readers.las", "filename": str(laz)}
    writer = {"type": "writers.las", "filename": str(las), "forward": "all", "extra_dims": "all"}
    run([reader, writer], program)


def run(stages: list[dict | str], program: str = "pdal") -> Result:
    """Run a pipeline.

    Parameters
    ----------
    stages : list of dict or str
        As in PDAL's JSON; a bare string is a file to read or write.
    program : str
        PDAL's executable, see `find`.

    Raises
    ------
    ProgramError
        PDAL failed: the message has the command, the exit code and the end of what it printed.
    """
    with tempfile.TemporaryDirectory(prefix="pdal-") as folder:
        pipeline, metadata = Path(folder, "pipeline.json"), Path(folder, "metadata.json")
        pipeline.write_text(json.dumps(stages))
        programs.run([find(program), "pipeline", pipeline, "--metadata", metadata])
        found = json.loads(metadata.read_text())["stages"]
    statistics = found.get("filters.stats", [])
    statistics = statistics if isinstance(statistics, list) else [statistics]
    return Result(tuple(_points_seen(entry) for entry in statistics), found)


def _points_seen(statistics: dict) -> int:
    entry = statistics["statistic"]
    return int((entry[0] if isinstance(entry, list) else entry)["count"])
