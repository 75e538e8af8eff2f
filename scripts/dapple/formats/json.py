"""Small tables of facts as JSON."""

import json
from pathlib import Path

from dapple.formats.atomic import atomic


def write(path: str | Path, facts: dict) -> None:
    """Write `facts` as indented JSON; NumPy scalars and arrays become plain numbers and lists."""
    with atomic(path) as partial:
        partial.write_text(json.dumps(facts, indent=2, default=lambda value: value.tolist()) + "\n")


def read(path: str | Path) -> dict:
    """Read a JSON object."""
    return json.loads(Path(path).read_text())
