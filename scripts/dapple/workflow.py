"""What Snakemake's rules and scripts need: code dependencies, logs, and errors that read well."""

import os
import resource
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from dapple.code_use import files_of
from dapple.errors import InputError
from dapple.progress import duration

MOST_NAMED = 6
"""Of the files that a job made, in its log."""


def code_of(script: Path, unused: Sequence[str] = ()) -> tuple[str, ...]:
    """The files of dapple that a script's results depend on, but for modules that it does not use.

    As inputs of its rule they make an edit rerun what depends on it, and nothing else.
    """
    return tuple(sorted(short(path) for path in files_of(script, unused)))


def short(path: Path) -> str:
    """A path, relative to the working directory where it lies in it.

    A folder that moves is then not taken for other code.
    """
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


def let_jobs_import(scripts: Path) -> None:
    """Let jobs import dapple from a folder that is not the one of their scripts."""
    known = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = f"{scripts}{os.pathsep}{known}" if known else str(scripts)


def run(main: Callable[[Any], None], snakemake: Any) -> None:
    """Run the main function of a script with its output in the rule's log.

    The log ends with what was made, how long it took and with how much memory. A mistake of the
    user's (`InputError`) is one message in the log and on the terminal; everything else is a
    traceback in both. Both end the job.
    """
    begun = time.monotonic()
    with Path(snakemake.log[0]).open("w", buffering=1) as log:
        try:
            with redirect_stdout(log), redirect_stderr(log):
                main(snakemake)
                print(_end(snakemake.output, time.monotonic() - begun))
        except InputError as error:
            message = f"dapple: {error}"
            log.write(f"{message}\n")
            sys.exit(message)
        except Exception:
            log.write(traceback.format_exc())
            raise


def _end(output: Sequence[str], seconds: float) -> str:
    """The last line of a log."""
    made = [f"{Path(path).name} ({_size(Path(path))})" for path in output]
    wrote = f": wrote {', '.join(made[:MOST_NAMED])}" if made else ""
    more = f" and {len(made) - MOST_NAMED} more files" if len(made) > MOST_NAMED else ""
    return (
        f"Done in {duration(seconds)} with {peak_rss_mb():.0f} MB of memory at most{wrote}{more}."
    )


def _size(path: Path) -> str:
    n_bytes = path.stat().st_size
    units = {"MB": 1e6, "kB": 1e3, "B": 1.0}
    unit = next((one for one, size in units.items() if n_bytes >= size), "B")
    return f"{n_bytes / units[unit]:.{0 if unit == 'B' else 1}f} {unit}"


def peak_rss_mb() -> float:
    """Most memory that this process has held at a time [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def evenly(n: int, most: int) -> list[int]:
    """Indices of `most` of n things, evenly spread, or of all where there are no more."""
    return [round((k + 0.5) * n / most - 0.5) for k in range(most)] if most < n else list(range(n))


def options(params: Any) -> dict[str, Any]:
    """The named parameters of a rule, to be passed on as keyword arguments."""
    return dict(params.items())
