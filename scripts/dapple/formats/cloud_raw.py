"""What the readers of single formats hand over, before it is checked and made local."""

from dataclasses import dataclass, field

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
    "class": "Classification",
    "label": "Classification",
}


@dataclass(frozen=True)
class RawCloud:
    """Points minus the origin that the file names; `final` forbids to choose another origin."""

    xyz_m: np.ndarray
    origin_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    attributes: dict[str, np.ndarray] = field(default_factory=dict)
    final: bool = False


def attribute_name(name: str) -> str:
    """Our name of an attribute: `scalar_return_number` is `ReturnNumber`; others stay as found."""
    name = name.strip().strip('"').removeprefix("scalar_").removeprefix("Scalar_")
    return _BY_LETTERS.get(name.replace("_", "").replace(" ", "").lower(), name)
