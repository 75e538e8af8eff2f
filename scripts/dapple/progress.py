"""How far a long step is: per cent and remaining time, in its log and on the terminal."""

import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TypeVar

EVERY_S = 10.0
"""Nothing is said of a step that takes less, and no line follows another sooner [s]."""
LEAST_SHARE = 0.01
"""What must be done between two lines, so that a step of hours says no more than a hundred."""

T = TypeVar("T")


def duration(seconds: float) -> str:
    """A duration as people say it: 40 s, 3 min, 2 h 10 min."""
    if seconds < 90:
        return f"{max(seconds, 1):.0f} s"
    minutes = round(seconds / 60)
    if minutes < 90:
        return f"{minutes} min"
    return f"{minutes // 60} h {minutes % 60:02d} min"


class Progress:
    """What is done of a step, said now and then.

    Parameters
    ----------
    what : str
        That is done, in words of the field, as in `shots through voxels`.
    total : float
        How much of it there is; may be set anew where it turns out to be less.
    clock : callable
        Seconds that go by.
    """

    def __init__(self, what: str, total: float, clock: Callable[[], float] = time.monotonic):
        self.what, self.total, self._clock = what, total, clock
        self.done = self._said_share = 0.0
        self._began = self._said = clock()

    def add(self, done: float = 1.0) -> None:
        """So much more of it is done."""
        self.done += done
        now = self._clock()
        share = self.done / self.total if self.total > 0 else 1.0
        if now - self._said < EVERY_S or share - self._said_share < LEAST_SHARE or share >= 1:
            return
        left_s = (now - self._began) * (1 - share) / share
        say(f"{self.what}: {100 * share:.0f} %, about {duration(left_s)} left")
        self._said, self._said_share = now, share

    def end(self) -> None:
        """All of it is done: a last line where others went before."""
        if self._said_share:
            say(f"{self.what}: done in {duration(self._clock() - self._began)}")


def followed(
    things: Iterable[T],
    what: str,
    total: float | None = None,
    *,
    size: Callable[[T], float] = lambda thing: 1.0,
    clock: Callable[[], float] = time.monotonic,
) -> Iterator[T]:
    """Things one after the other, with a line now and then on how far it is.

    Parameters
    ----------
    things : iterable
    what, total, clock
        Of `Progress`; None is the number of a sequence of things.
    size : callable
        How much of the total a thing is.
    """
    if total is None:
        things = things if isinstance(things, Sequence) else list(things)
        total = float(sum(map(size, things)))
    progress = Progress(what, total, clock)
    for thing in things:
        yield thing
        progress.add(size(thing))
    progress.end()


def say(line: str) -> None:
    """Print a line into the log of the step, and on the terminal with the step's name."""
    print(line, flush=True)
    log = getattr(sys.stdout, "name", None)
    if isinstance(log, str) and log.endswith(".log") and sys.__stderr__ is not None:
        step = Path(log).with_suffix("").as_posix().rpartition("/logs/")[2]
        print(f"dapple: {step}: {line}", file=sys.__stderr__, flush=True)
