"""The jobs that Snakemake is about to run, and what makes it run them.

The standard library alone: Snakemake's own process reads this, and it may have nothing else.
"""

import csv
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

INTERRUPTED = "an earlier run was interrupted"
MISSING = "results are missing"
ASKED = "it was asked for"


@dataclass(frozen=True)
class Job:
    """A job that is to run.

    Attributes
    ----------
    rule : str
    reconstruction : str
        That it works on; empty where it has none.
    threads : int
        Most cores that it takes.
    causes : tuple of str
        Why it runs, but for jobs before it that run: files that changed, or one of the texts above.
    before : tuple of float or None
        Seconds and peak memory [MB] of an earlier run of it.
    """

    rule: str
    reconstruction: str = ""
    threads: int = 1
    causes: tuple[str, ...] = ()
    before: tuple[float, float] | None = None


def planned(dag: Any) -> list[Job]:
    """The jobs of Snakemake's graph that are to run, without those that only collect."""
    return [
        Job(
            job.rule.name,
            str(job.wildcards_dict.get("reconstruction", "")),
            int(job.threads),
            tuple(_causes(dag.reason(job))),
            _before(job.benchmark),
        )
        for job in dag.needrun_jobs(exclude_finished=False)
        if job.output or job.log
    ]


def total(dag: Any) -> int:
    """Jobs of the whole graph, without those that only collect."""
    return sum(1 for job in dag.jobs if job.output or job.log)


def _causes(reason: Any) -> Iterator[str]:
    if reason.forced:
        yield ASKED
    if reason.incomplete_output:
        yield INTERRUPTED
    if reason.missing_output:
        yield MISSING
    yield from sorted(str(file) for file in reason.updated_input - reason.updated_input_run)


def _before(benchmark: Any) -> tuple[float, float] | None:
    """Seconds and memory [MB] of Snakemake's benchmark file, if it has them."""
    path = Path(str(benchmark)) if benchmark else None
    if path is None or not path.is_file():
        return None
    with path.open(newline="") as file:
        rows = list(csv.DictReader(file, delimiter="\t"))
    try:
        return float(rows[0]["s"]), float(rows[0]["max_rss"])
    except (IndexError, KeyError, TypeError, ValueError):
        return None


def flat(section: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Keys and values of a configuration, as in `optics.leaf.n`."""
    for name, value in section.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{name}.")
        else:
            yield f"{prefix}{name}", value


def edited(before: Mapping[str, Any], now: Mapping[str, Any]) -> list[str]:
    """What differs between two configurations, in words."""
    old, new = dict(flat(before)), dict(flat(now))
    names: Iterable[str] = [*new, *(name for name in old if name not in new)]
    return [
        f"{name} is {_shown(new.get(name))} (was {_shown(old.get(name))})"
        for name in names
        if _plain(old.get(name)) != _plain(new.get(name))
    ]


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value


def _shown(value: Any) -> str:
    return "not set" if value in (None, "") else str(value)
