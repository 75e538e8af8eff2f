"""Drive PDAL's command line with JSON pipelines.

The pipelines run unchanged on PDAL 2.2 (Debian 11) and on current releases.
"""

import json
import re
import tempfile
from pathlib import Path

from dapple import programs

REMEDY = "Run the set-up of the README, install pdal with conda, or configure the path of pdal."

OUTLIER_CLASS = 255
"""Marks outliers inside a pipeline: 7, PDAL's default, would take along noise known before."""


def find(program: str = "pdal") -> str:
    """Return PDAL's executable: the given path, the project's own `.tools`, or one on PATH."""
    own = programs.PROJECT_ROOT / ".tools" / "pdal" / "bin" / "pdal"
    return programs.find(program, REMEDY, beside=[own])


def version(program: str = "pdal") -> str:
    """Return PDAL's version, as in `2.2.0`."""
    printed = programs.run([find(program), "--version"], limit_s=programs.SHORT_S)
    match = re.search(r"pdal\s+(\d[\d.]*)", printed)
    return match.group(1) if match else "unknown"


def remove_outliers(neighbours: int, multiplier: float) -> list[dict]:
    """Stages that remove statistical outliers (mean distance to the nearest neighbours)."""
    find_them = {
        "type": "filters.outlier",
        "method": "statistical",
        "mean_k": neighbours,
        "multiplier": multiplier,
        "class": OUTLIER_CLASS,
    }
    return [
        find_them,
        {
            "type": "filters.range",
            "limits": f"Classification![{OUTLIER_CLASS}:{OUTLIER_CLASS}]",
        },
    ]


def write_las(path: str | Path) -> dict:
    """A stage that writes LAS 1.4, point format 6, with every extra dimension."""
    return {
        "type": "writers.las",
        "filename": str(path),
        "minor_version": 4,
        "dataformat_id": 6,
        "extra_dims": "all",
        "forward": "scale,offset",
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
    limit_s = programs.limit_s(Path(laz).stat().st_size)  # a point has a few bytes
    run([reader, writer], program, limit_s=limit_s)


def run(stages: list[dict | str], program: str = "pdal", *, limit_s: float) -> None:
    """Run a pipeline.

    Parameters
    ----------
    stages : list of dict or str
        As in PDAL's JSON; a bare string is a file to read or write.
    program : str
        PDAL's executable, see `find`.
    limit_s : float
        PDAL is ended after this time [s].

    Raises
    ------
    ProgramError
        PDAL failed, did not end, or did not write what its writers should: the message has the
        command, the exit code and the end of what it printed.
    """
    with tempfile.TemporaryDirectory(prefix="pdal-") as folder:
        pipeline = Path(folder, "pipeline.json")
        pipeline.write_text(json.dumps(stages))
        command = [find(program), "pipeline", str(pipeline)]
        written = [one for one in stages if isinstance(one, dict) and "writers" in one["type"]]
        makes = [str(one["filename"]) for one in written]
        programs.run(command, limit_s=limit_s, makes=makes)
