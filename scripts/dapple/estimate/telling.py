"""What a run will do, in a sentence and in a table."""

from collections.abc import Sequence

from dapple.estimate.forecast import Forecast
from dapple.estimate.planned import ASKED, INTERRUPTED, MISSING, Job
from dapple.progress import duration

MOST_CAUSES = 3


def sentence(
    jobs: Sequence[Job],
    total: int,
    forecast: Forecast | None,
    edits: Sequence[str],
    is_first: bool,
) -> str:
    """How many steps will run, for how long, and why.

    Parameters
    ----------
    jobs : sequence of Job
        That are to run.
    total : int
        Jobs that the run has in all.
    forecast : Forecast or None
        None where nothing is known of this machine.
    edits : sequence of str
        What was changed in the configuration since the last run.
    is_first : bool
        Whether nothing of this run has been made yet.
    """
    if not jobs:
        return "Nothing to do: all results are there, and nothing that they depend on has changed."
    steps = f"{len(jobs)} of {_steps(total)}" if len(jobs) < total else _steps(total)
    about = "" if forecast is None else f", {_time(forecast)}"
    if forecast and forecast.unmeasured:
        about += f", without {_steps(forecast.unmeasured)} that were never measured"
    if is_first:
        return f"{steps}{about}: nothing of this run has been made yet."
    return f"{steps}{about}, because {_listed(causes(jobs, edits))}."


def causes(jobs: Sequence[Job], edits: Sequence[str]) -> list[str]:
    """Why jobs run: edits of the configuration and of files first."""
    found = list(dict.fromkeys(cause for job in jobs for cause in job.causes))
    files = [cause for cause in found if cause not in (MISSING, INTERRUPTED, ASKED)]
    said = [*edits, *(f"{file} changed" for file in files)]
    said += [cause for cause in (ASKED, INTERRUPTED) if cause in found]
    if MISSING in found and not said:
        said.append(MISSING)
    return said or ["a rule or its settings changed"]


def table(forecast: Forecast, cores: int) -> str:
    """The forecast, a line for each step, and what it adds up to."""
    lines = [f"{'step':24}{'jobs':>6}{'time':>12}{'memory':>10}"]
    lines += [
        f"{rule:24}{jobs:6d}{duration(seconds):>12}{megabytes / 1000:7.1f} GB"
        for rule, jobs, seconds, megabytes in forecast.rows
    ]
    plural = "cores" if cores > 1 else "core"
    bound = "at least" if forecast.unmeasured else "up to"
    lines.append(
        f"In all {_time(forecast)} on {cores} {plural}, "
        f"and {bound} {forecast.peak_mb / 1000:.1f} GB of memory."
    )
    if forecast.unknown:
        lines.append(
            f"Not counted, because never measured: {_steps(forecast.unmeasured)} "
            f"({', '.join(sorted(forecast.unknown))})."
        )
    return "\n".join(lines)


def _time(forecast: Forecast) -> str:
    """A lower bound where some steps were never measured."""
    return f"{'at least' if forecast.unmeasured else 'about'} {duration(forecast.seconds)}"


def _steps(count: int) -> str:
    return "1 step" if count == 1 else f"{count} steps"


def _listed(parts: Sequence[str]) -> str:
    shown = list(parts[:MOST_CAUSES])
    if len(parts) > MOST_CAUSES:
        shown.append(f"{len(parts) - MOST_CAUSES} more")
    return shown[0] if len(shown) == 1 else f"{', '.join(shown[:-1])} and {shown[-1]}"
