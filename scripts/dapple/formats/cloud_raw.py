"""What the readers of single formats hand over, before it is checked and made local."""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

KNOWN_NAMES = (
    "Intensity",
    "RelativeIntensity",
    "Reflectance",
    "Amplitude",
    "Deviation",
    "Classification",
    "ReturnNumber",
    "NumberOfReturns",
    "PointSourceId",
    "GpsTime",
    "ScanAngle",
    "UserData",
    "Red",
    "Green",
    "Blue",
)

_BY_LETTERS = {name.lower(): name for name in KNOWN_NAMES} | {
    "targetindex": "ReturnNumber",
    "targetcount": "NumberOfReturns",
    "scananglerank": "ScanAngle",
    "r": "Red",
    "g": "Green",
    "b": "Blue",
}

MISSED = "shot that met nothing"
AT_SCANNER = "at the scanner's own place"
"""Points 0 0 0 in a scanner's own frame: shots that met nothing, written as points."""


@dataclass(frozen=True)
class ScanFacts:
    """One scan position as its file tells it.

    Attributes
    ----------
    number : int
        As in `PointSourceId`, from 1.
    position_m : (3,) float64 or None
        World coordinates of the scanner, in the file's unit; None where the file does not say.
    points : int
        Returns of the scan.
    shots : int or None
        Shots of the scan, those that met nothing included; None where they are not recorded.
    rotation : (3, 3) float64 or None
        From the scanner's own frame to the world's; None where the file does not say.
    """

    number: int
    position_m: np.ndarray | None
    points: int
    shots: int | None = None
    rotation: np.ndarray | None = None


@dataclass(frozen=True)
class Units:
    """Units of coordinates: metres of one unit, degrees, or axes through the earth's centre.

    Attributes
    ----------
    horizontal_m, vertical_m : float
        Metres of a unit of east and north, and of a unit of height.
    degrees : bool
        East and north are longitude and latitude.
    geocentric : bool
        z points to the pole, not up.
    """

    horizontal_m: float = 1.0
    vertical_m: float = 1.0
    degrees: bool = False
    geocentric: bool = False


@dataclass(frozen=True)
class Source:
    """What a file says of itself, and what of it was not taken.

    Attributes
    ----------
    in_file : int
        Points that the file holds.
    crs : str
        Its coordinate system as WKT or "EPSG:…"; empty where it names none.
    units : Units
        Of its coordinates, as its coordinate system has them.
    step : float or None
        Coordinates are whole multiples of it, in the file's unit; None where that is not known.
    left_out : dict of str to int
        Points that were not taken, by reason.
    notes : tuple of str
        What else a user should know, a sentence each.
    scans : tuple of ScanFacts
        Empty where the file does not know scans.
    """

    in_file: int = 0
    crs: str = ""
    units: Units = Units()
    step: float | None = None
    left_out: Mapping[str, int] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    scans: tuple[ScanFacts, ...] = ()


@dataclass(frozen=True)
class RawCloud:
    """Points minus the origin that the file names; `final` forbids to choose another origin."""

    xyz_m: np.ndarray
    origin_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    attributes: dict[str, np.ndarray] = field(default_factory=dict)
    final: bool = False
    source: Source = Source()


@dataclass(frozen=True)
class Fired:
    """Shots as a file tells them one by one, in its coordinates; returns as in `shots.Shots`.

    Attributes
    ----------
    origin_m, direction : (n, 3) float64
        Where each shot starts [m], and unit vectors.
    first : (n + 1,) int64
        Index of each shot's first return; a miss has none.
    range_m : (m,) float64
        Distance of each return, near to far [m].
    attributes : dict of str to (m,) array
        Of the returns.
    """

    origin_m: np.ndarray
    direction: np.ndarray
    first: np.ndarray
    range_m: np.ndarray
    attributes: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def return_xyz_m(self) -> np.ndarray:
        """(m, 3) place of each return [m]."""
        shot = np.repeat(np.arange(len(self.direction)), np.diff(self.first))
        return self.origin_m[shot] + self.direction[shot] * self.range_m[:, None]

    def in_metres(self, unit_m: float, turn: np.ndarray) -> "Fired":
        """The same from units of so many metres, in a world turned by a rotation (3, 3)."""
        return replace(
            self,
            origin_m=self.origin_m @ turn.T * unit_m,
            direction=self.direction @ turn.T,
            range_m=self.range_m * unit_m,
        )

    def to_raw(self) -> "RawCloud":
        """The returns as points; shots without return are counted as left out."""
        counts = np.diff(self.first)
        attributes = dict(self.attributes)
        if counts.max(initial=0) > 1:
            shot = np.repeat(np.arange(len(counts)), counts)
            number = np.arange(len(shot)) - self.first[shot] + 1
            attributes["ReturnNumber"] = number.astype(np.uint8)
            attributes["NumberOfReturns"] = counts[shot].astype(np.uint8)
        missed = int((counts == 0).sum())
        source = Source(len(self.range_m) + missed, left_out={MISSED: missed})
        return RawCloud(self.return_xyz_m, attributes=attributes, source=source)


def attribute_name(name: str) -> str:
    """Our name of an attribute: `scalar_return_number` is `ReturnNumber`; others stay as found.

    A unit in brackets goes: `Reflectance[dB]` is `Reflectance`.
    """
    name = name.strip().strip('"').removeprefix("scalar_").removeprefix("Scalar_")
    name = re.sub(r"\s*[\[(][^\])]*[\])]\s*$", "", name) or name
    return _BY_LETTERS.get(re.sub(r"[\s_.-]", "", name).lower(), name)


def distinct(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Names that differ from each other and from those taken: the second `a` is `a_2`.

    Letters count whatever their case, because programs further on may not tell them apart.
    """
    used = {name.lower() for name in taken}
    found = []
    for name in names:
        chosen, number = name, 1
        while chosen.lower() in used:
            number += 1
            chosen = f"{name}_{number}"
        used.add(chosen.lower())
        found.append(chosen)
    return found


def columns(name: str, values: np.ndarray) -> dict[str, np.ndarray]:
    """An attribute of several numbers a point as one attribute each: `Normal_1`, `Normal_2`, …"""
    if values.ndim == 1:
        return {name: values}
    return {f"{name}_{k + 1}": values[:, k] for k in range(values.shape[1])}


def joined(pieces: list[dict[str, np.ndarray]]) -> dict[str, np.ndarray]:
    """Attributes of all pieces one after the other, those that every piece has.

    Pieces are emptied on the way, so that memory holds one attribute twice and not all of them.
    """
    if not pieces:
        return {}
    common = [name for name in pieces[0] if all(name in piece for piece in pieces)]
    return {name: np.concatenate([piece.pop(name) for piece in pieces]) for name in common}
