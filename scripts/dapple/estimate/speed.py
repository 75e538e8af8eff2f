"""The speed of this machine, in that of the machine of the table of costs."""

import csv
from collections.abc import Mapping
from pathlib import Path

REFERENCE = Path(__file__).with_name("machine.csv")
"""Made by benchmarks/step_costs.py."""


def slowness(measured: Mapping[str, float]) -> float:
    """Seconds here for a second there: the mean over the kinds of work.

    Parameters
    ----------
    measured : mapping
        As `machine.measure` gives it.
    """
    with REFERENCE.open(newline="") as file:
        there = {row["work"]: float(row["seconds"]) for row in csv.DictReader(file)}
    return sum(measured[name] / there[name] for name in there) / len(there)
