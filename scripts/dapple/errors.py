"""The one kind of error that a user can mend: it says where, what, and what to do."""

from pathlib import Path


class InputError(ValueError):
    """Something given to dapple (a file, a key, a value) is not what it has to be.

    Parameters
    ----------
    where : str or Path
        The file or configuration key.
    found : str
        The value or state that was met.
    expected : str
        What would have been right.
    remedy : str
        What the user can do about it.
    """

    def __init__(self, where: str | Path, found: str, expected: str, remedy: str):
        super().__init__(f"{where}: found {found}; expected {expected}. {remedy}")
        self.where, self.found, self.expected, self.remedy = where, found, expected, remedy


class EmptyCloudError(InputError):
    """A cloud that has no point left: there is nothing to work on."""


class MissingMissesError(InputError):
    """Shots without a return are not recorded, so that plant area density has no denominator."""
