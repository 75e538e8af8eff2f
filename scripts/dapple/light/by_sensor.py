"""Each sensor is traced for itself: what a former run found of it is not traced again."""

import hashlib
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, Protocol, Self, TypeVar

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.scene.facing import facing_of

POSITION = ["x_m", "y_m", "z_m"]


class OfSensors(Protocol):
    """What was traced of some sensors."""

    def of(self, sensors: np.ndarray) -> Self:
        """Of those with these numbers, in their order."""

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Of the sensors of all parts, one part after the other."""


Traced = TypeVar("Traced", bound=OfSensors)


def identities(sensors: pd.DataFrame, files: Iterable[str | Path], *settings: Any) -> np.ndarray:
    """A number for each sensor that changes with anything its light depends on.

    Parameters
    ----------
    sensors : pandas.DataFrame
        Their labels, places and where they face.
    files : iterable of path
        What else is read, and the code: their contents count.
    *settings
        What else counts, as it prints; arrays by their values.

    Returns
    -------
    (n,) uint64
    """
    whole = hashlib.sha256()
    for path in sorted(map(str, files)):
        whole.update(hashlib.sha256(Path(path).read_bytes()).digest())
    for value in settings:
        plain = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
        whole.update(hashlib.sha256(plain).digest())
    places = sensors[POSITION].to_numpy(np.float64)
    facing = facing_of(sensors)
    towards = np.tile([0.0, 0.0, 1.0], (len(places), 1)) if facing is None else facing
    # No minus zeros: they are equal numbers of other bytes.
    own = np.hstack([places, towards]) + 0.0
    found = np.empty(len(sensors), np.uint64)
    for number, label in enumerate(sensors["sensor"]):
        one = whole.copy()
        one.update(f"{label}\0".encode() + own[number].tobytes())
        found[number] = int.from_bytes(one.digest()[:8], "big")
    return found


def keys(sensors: pd.DataFrame) -> np.ndarray:
    """(n,) uint32, which random numbers sensors draw: those of their labels."""
    return np.array([zlib.crc32(str(label).encode()) for label in sensors["sensor"]], np.uint32)


def former(
    path: str | Path, read: Callable[[str | Path], tuple[np.ndarray, Traced]]
) -> tuple[np.ndarray, Traced] | None:
    """Identities and findings in the file of a former run; None where there is none to be used."""
    if not Path(path).is_file():
        return None
    try:
        return read(path)
    except InputError as error:
        print(f"traced anew: {error}")
        return None


def completed(
    wanted: np.ndarray,
    known: tuple[np.ndarray, Traced] | None,
    sensors: pd.DataFrame,
    trace: Callable[[pd.DataFrame], Traced],
) -> Traced:
    """What is known of sensors, and what is traced of those that are new.

    Parameters
    ----------
    wanted : (n,) uint64
        Identities of the sensors.
    known : ((k,) uint64, Traced) or None
        What `former` found.
    sensors : pandas.DataFrame
        All of them.
    trace : callable
        Traces some of them: level and tilted ones apart, since rays are drawn for both otherwise.

    Returns
    -------
    Traced
        In the order of the sensors.
    """
    before = {identity: k for k, identity in enumerate(known[0].tolist())} if known else {}
    place = np.array([before.get(identity, -1) for identity in wanted.tolist()])
    parts, numbers = [], []
    if known and (place >= 0).any():
        parts.append(known[1].of(place[place >= 0]))
        numbers.append(np.flatnonzero(place >= 0))
    tilted = sensors["tilt_deg"].to_numpy() > 0 if "tilt_deg" in sensors else np.zeros(len(place))
    for kind in (0, 1):
        new = np.flatnonzero((place < 0) & (tilted == kind))
        if len(new):
            parts.append(trace(sensors.iloc[new]))
            numbers.append(new)
    print(f"{(place < 0).sum()} of {len(place)} sensors traced, the others as they were")
    return parts[0].joined(parts).of(np.argsort(np.concatenate(numbers)))
