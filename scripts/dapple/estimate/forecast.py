"""Seconds and memory of jobs before they run: their growth with size, times the machine's speed.

The standard library alone, as in `planned`.
"""

import csv
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from dapple.estimate.planned import Job

TABLE = Path(__file__).with_name("step_costs.csv")
"""Made by benchmarks/step_costs.py."""
DRIVERS = {
    "scan": "shots",
    "ingest": "points",
    "find_ground": "points",
    "one_tree": "points",
    "inspect_input": "points",
    "clean": "points",
    "classify": "kept",
    "polygons": "kept",
    "surfels": "kept",
    "cloud_to_mesh": "kept",
    "tree_figure": "kept",
    "page": "kept",
    "voxels": "shots",
    "verdict": "shots",
    "transport": "sensors",
    "light": "sensor_times",
    "timesteps": "checked",
    "less_timesteps": "checked",
    "record_statistics": "sensor_times",
    "ground_map": "ground_map",
}
"""What a rule's time grows with; of rules that are not named, with nothing."""
SNAKEMAKE, COMPILING = "(snakemake)", "(compiling)"
"""Rows of the table: what Snakemake itself takes, and what a fresh clone takes once."""


@dataclass(frozen=True)
class Cost:
    """Growth of a step: a constant, and a slope over its driver."""

    start_s: float
    second_each: float
    start_mb: float
    mb_each: float

    def seconds(self, size: float) -> float:
        return self.start_s + self.second_each * size

    def megabytes(self, size: float) -> float:
        return self.start_mb + self.mb_each * size


@dataclass(frozen=True)
class Forecast:
    """What jobs are expected to take.

    Attributes
    ----------
    rows : tuple of (str, int, float, float)
        Rule, number of jobs, seconds of them all, most memory of one [MB]; the longest first.
    seconds : float
        Of the run on so many cores, with what Snakemake takes.
    peak_mb : float
        Most memory at a time.
    unknown : tuple of str
        Rules whose cost was never measured; their jobs count nothing.
    unmeasured : int
        Jobs of these rules.
    """

    rows: tuple[tuple[str, int, float, float], ...]
    seconds: float
    peak_mb: float
    unknown: tuple[str, ...]
    unmeasured: int


def kind_of(reconstruction: str) -> str:
    """Voxels are lit in another way than meshes."""
    return "voxels" if reconstruction.startswith("voxels") else ""


def read(path: Path = TABLE) -> dict[tuple[str, str], Cost]:
    """Costs of steps on the machine of the table, by rule and kind of reconstruction."""
    with path.open(newline="") as file:
        return {
            (row["rule"], row["kind"]): Cost(
                *(float(row[name]) for name in ("start_s", "second_each", "start_mb", "mb_each"))
            )
            for row in csv.DictReader(file)
        }


def cost_of(job: Job, costs: Mapping[tuple[str, str], Cost]) -> Cost | None:
    return costs.get((job.rule, kind_of(job.reconstruction))) or costs.get((job.rule, ""))


def forecast(
    jobs: Sequence[Job],
    now: Mapping[str, float],
    costs: Mapping[tuple[str, str], Cost],
    *,
    cores: int,
    slowness: float,
    earlier: Mapping[str, float] | None = None,
    compiled: bool = True,
) -> Forecast:
    """What jobs will take.

    Parameters
    ----------
    jobs : sequence of Job
    now : mapping
        Sizes of the run, as `sizes.sizes` tells them.
    costs : mapping
        As `read` gives them.
    cores : int
        That Snakemake may use.
    slowness : float
        Seconds here for a second of the table's machine.
    earlier : mapping
        Sizes of the run that came before, if one did: what a job took then counts more than the
        table, which only tells how it grew.
    compiled : bool
        Whether the clone has compiled its loops before.
    """
    sums: dict[str, list[float]] = {}
    peaks: list[tuple[float, int]] = []
    work = 0.0
    for job in jobs:
        cost = cost_of(job, costs)
        driver = DRIVERS.get(job.rule, "one")
        if job.before and (cost is None or earlier is None):
            seconds, megabytes = job.before
        elif cost is None:
            sums.setdefault(job.rule, [0, 0.0, 0.0])[0] += 1
            continue
        else:
            seconds = slowness * cost.seconds(now[driver])
            megabytes = cost.megabytes(now[driver])
            then = 0.0 if earlier is None else cost.seconds(earlier[driver])
            if job.before and then > 0.0:  # 0: there was nothing to do
                seconds = job.before[0] * cost.seconds(now[driver]) / then
        one = sums.setdefault(job.rule, [0, 0.0, 0.0])
        one[0], one[1], one[2] = one[0] + 1, one[1] + seconds, max(one[2], megabytes)
        width = min(job.threads, cores)
        peaks.append((megabytes, width))
        work += seconds * width / cores
    around = costs[SNAKEMAKE, ""]
    work += slowness * around.seconds(len(jobs)) if jobs else 0.0
    work += 0.0 if compiled or not jobs else slowness * costs[COMPILING, ""].start_s
    rows = [(rule, int(n), s, mb) for rule, (n, s, mb) in sums.items() if mb]
    return Forecast(
        tuple(sorted(rows, key=lambda row: -row[2])),
        work,
        _together(peaks, cores),
        tuple(rule for rule, (_, _, mb) in sums.items() if not mb),
        sum(int(n) for n, _, mb in sums.values() if not mb),
    )


def _together(peaks: Iterable[tuple[float, int]], cores: int) -> float:
    """Most memory of jobs that fit the cores side by side [MB]."""
    free, total = cores, 0.0
    for megabytes, width in sorted(peaks, reverse=True):
        if width <= free:
            free, total = free - width, total + megabytes
    return total
