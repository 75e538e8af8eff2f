"""What is noticed about the files that a run is given: said, written down, or a reason to stop."""

import sys
from collections.abc import Iterable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

from dapple.errors import InputError

Level = Literal["error", "warning", "note"]


@dataclass(frozen=True)
class Finding:
    """One thing noticed.

    Attributes
    ----------
    level : {"error", "warning", "note"}
        What makes results wrong; what may; what is good to know.
    where : str
        File, column or key.
    found, expected, remedy : str
        As in `InputError`; a note has no expectation and no remedy.
    yaml : str
        Lines of a configuration that mend it, to paste; empty where no key does.
    """

    level: Level
    where: str
    found: str
    expected: str = ""
    remedy: str = ""
    yaml: str = ""

    def __str__(self) -> str:
        expected = f"; expected {self.expected}" if self.expected else ""
        return f"{self.where}: found {self.found}{expected}. {self.remedy}".strip()


def error(where: str | Path, found: str, expected: str, remedy: str, yaml: str = "") -> Finding:
    """What makes results wrong."""
    return Finding("error", str(where), found, expected, remedy, yaml)


def warning(
    where: str | Path, found: str, expected: str = "", remedy: str = "", yaml: str = ""
) -> Finding:
    """What may make results wrong."""
    return Finding("warning", str(where), found, expected, remedy, yaml)


def of(mistake: InputError, yaml: str = "") -> Finding:
    """A mistake that a reader found, as one finding among others."""
    return Finding(
        "error", str(mistake.where), mistake.found, mistake.expected, mistake.remedy, yaml
    )


def note(where: str | Path, found: str) -> Finding:
    """What is good to know."""
    return Finding("note", str(where), found)


def stop(findings: Iterable[Finding]) -> None:
    """Raise an `InputError` of the first error; the others follow in its remedy.

    The lines that mend them come last, ready to paste into the configuration.
    """
    errors = [one for one in findings if one.level == "error"]
    if errors:
        first, *others = errors
        remedy = " ".join([first.remedy, *(f"Besides, {one}" for one in others)])
        if lines := dict.fromkeys(one.yaml for one in errors if one.yaml):
            remedy = "\n".join([f"{remedy} In the configuration:", *lines])
        raise InputError(first.where, first.found, first.expected, remedy)


def say(findings: Iterable[Finding]) -> None:
    """Print warnings on the terminal, past the log of a rule, and everything into the log."""
    for one in findings:
        print(f"{one.level}: {one}")
        if one.level != "note" and sys.__stderr__ is not None:
            print(f"dapple: {one.level}: {one}", file=sys.__stderr__)


def rows(findings: Iterable[Finding]) -> list[dict[str, str]]:
    """Findings as they are written into a JSON file."""
    return [asdict(one) for one in findings]
