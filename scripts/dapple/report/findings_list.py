"""What was noticed about the files that a run was given."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from dapple.formats import json
from dapple.report.blocks import Block, Listing

NOTICED = ("sky/radiation.json", "sky/optics.json", "sky/sensors.json", "statistics/records.json")
LEVELS = ("error", "warning", "note")


def of_run(folder: Path) -> list[Block]:
    """Findings about radiation, spectra, sensors and records of a run."""
    return noticed(json.read(path) for name in NOTICED if (path := folder / name).is_file())


def noticed(facts: Iterable[Mapping[str, Any]]) -> list[Block]:
    """Findings of several files of facts as a list, errors first; nothing where there are none."""
    facts = list(facts)
    items = list(_findings(facts))
    share = next((t["modelled_share_of_day"] for t in facts if "modelled_share_of_day" in t), 0.0)
    if share:
        text = (
            f"Radiation is modelled, not measured, at {100 * share:.0f} % of the times with the "
            "sun up."
        )
        items.append(("note", text))
    return [Listing(items)] if items else []


def _findings(facts: Iterable[Mapping[str, Any]]) -> Iterator[tuple[str, str]]:
    rows = [one for some in facts for one in some.get("findings", ())]
    for one in sorted(rows, key=lambda one: LEVELS.index(one["level"])):
        expected = f"; expected {one['expected']}" if one["expected"] else ""
        yield one["level"], f"{one['where']}: {one['found']}{expected}. {one['remedy']}"
