"""What a run is going to do, how long it takes, and why: from what is planned and what lies there.

The standard library and YAML alone, as in `planned`.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import yaml

from dapple.estimate import forecast, speed, telling
from dapple.estimate.forecast import Forecast
from dapple.estimate.planned import Job

CODE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Known:
    """What is known of a run before it begins.

    Attributes
    ----------
    folder : Path
        Of its results.
    cores : int
        That it may use.
    now : mapping
        Its sizes, as `sizes.sizes` tells them.
    earlier : mapping or None
        Those of the run before it in the same folder.
    edits : tuple of str or None
        What was changed in the configuration since; None where there was no run.
    """

    folder: Path
    cores: int
    now: Mapping[str, float]
    earlier: Mapping[str, float] | None = None
    edits: tuple[str, ...] | None = None


def configuration_before(folder: Path) -> dict | None:
    """The configuration of the run before, as it lies beside its results."""
    path = folder / "config.yaml"
    try:
        found = yaml.safe_load(path.read_text())
    except (OSError, yaml.YAMLError, UnicodeDecodeError):
        return None
    return found if isinstance(found, dict) else None


def expected(jobs: Sequence[Job], known: Known) -> Forecast | None:
    """Forecast of jobs; None where nothing is known of this machine."""
    costs = forecast.read()
    slowness = _slowness(known.folder / "machine.json", jobs, known.earlier, costs)
    if slowness is None:
        return None
    return forecast.forecast(
        jobs,
        known.now,
        costs,
        cores=known.cores,
        slowness=slowness,
        earlier=known.earlier,
        compiled=any(CODE.rglob("*.nbi")),
    )


def tell(jobs: Sequence[Job], total: int, known: Known) -> str:
    """One sentence: how many steps of how many, for how long, and why."""
    found = expected(jobs, known)
    is_first = known.edits is None
    return telling.sentence(jobs, total, found, known.edits or (), is_first)


def _slowness(
    measured: Path,
    jobs: Sequence[Job],
    earlier: Mapping[str, float] | None,
    costs: Mapping[tuple[str, str], forecast.Cost],
) -> float | None:
    """Of this machine: measured, or told by what jobs took in the run before."""
    if measured.is_file():
        return speed.slowness(json.loads(measured.read_text()))
    here = there = 0.0
    for job in jobs:
        cost = forecast.cost_of(job, costs)
        if job.before and cost and earlier:
            here += job.before[0]
            there += cost.seconds(earlier[forecast.DRIVERS.get(job.rule, "one")])
    return here / there if there else None
