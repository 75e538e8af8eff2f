"""Find and run external programs; when one fails, say which command, how, and its last words."""

import os
import shlex
import shutil
import subprocess
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from dapple.errors import InputError

PROJECT_ROOT = Path(__file__).parents[2]
TAIL_CHARACTERS = 2000
SHORT_S = 60.0
"""Time for a question such as that for the version [s]."""


class ProgramError(InputError):
    """An external program failed, or reported success without doing what it was asked."""


def find(program: str, remedy: str, *, beside: Sequence[Path] = ()) -> str:
    """Return the path of an executable.

    Parameters
    ----------
    program : str
        A path, or a bare name to be looked for.
    remedy : str
        What the user can do when it is absent.
    beside : sequence of Path
        Places that go before PATH when `program` is a bare name.

    Raises
    ------
    InputError
        No such executable.
    """
    candidates = [program] if os.sep in program else [*map(str, beside), program]
    for candidate in candidates:
        if found := shutil.which(candidate):
            return found
    raise InputError(program, "no such program", f"one of {', '.join(candidates)}", remedy)


def limit_s(n_points: int) -> float:
    """Time that a program gets for so many points: many times what it takes on a busy machine [s].

    Some searches for neighbours go round in circles where many points share few places.
    """
    return 600.0 + 600e-6 * n_points


def run(
    command: Sequence[str | Path],
    *,
    limit_s: float,
    makes: Sequence[str | Path] = (),
    environment: dict[str, str] | None = None,
) -> str:
    """Run a command to its end and return its standard output.

    Parameters
    ----------
    command : sequence of str or Path
        Program and arguments; no shell is involved.
    limit_s : float
        The program is ended after this time [s].
    makes : sequence of path
        Files that it has to leave, not empty.
    environment : dict, optional
        Variables to set on top of the current environment.

    Raises
    ------
    ProgramError
        The exit code is not zero, the time is over, or a file was not made.
    """
    words = [str(word) for word in command]
    try:
        done = subprocess.run(
            words,
            env=os.environ | (environment or {}),
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            errors="replace",
            timeout=limit_s,
        )
    except subprocess.TimeoutExpired:
        raise failure(words, f"no end after {limit_s:,.0f} s", "") from None
    if done.returncode:
        raise failure(words, f"exit code {done.returncode}", done.stderr.strip() or done.stdout)
    check_made(words, makes, done.stderr.strip() or done.stdout)
    return done.stdout


def check_made(command: Sequence[str], makes: Sequence[str | Path], output: str) -> None:
    """Raise where a command that printed `output` left no file of those, or an empty one."""
    for path in map(Path, makes):
        if not path.is_file() or not path.stat().st_size:
            raise failure(command, f"no output file {path.name}", output)


def failure(command: Sequence[str | Path], state: str, output: str) -> ProgramError:
    """The error of a command that ended in `state` after printing `output`."""
    tail = output.strip()[-TAIL_CHARACTERS:] or "no output"
    return ProgramError(
        shlex.join(str(word) for word in command),
        f"{state}: {tail}",
        "exit code 0 and a result",
        "Run the command by hand to see more; check the input file and the free disk space.",
    )


@contextmanager
def silenced(descriptor: int) -> Iterator[None]:
    """Send what a compiled library prints past Python's own output (1 or 2) into nothing."""
    kept = os.dup(descriptor)
    try:
        with tempfile.TemporaryFile() as nothing:
            os.dup2(nothing.fileno(), descriptor)
            yield
    finally:
        os.dup2(kept, descriptor)
        os.close(kept)
