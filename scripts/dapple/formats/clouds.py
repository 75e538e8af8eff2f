"""Point clouds in the local frame: read and write, with their origin and attributes."""

from dataclasses import dataclass, field

import numpy as np

LEAF, WOOD = 4, 0
"""ASPRS-like class codes: 4 leaf, 0 wood."""


@dataclass(frozen=True)
class Cloud:
    """Points with attributes.

    Attributes
    ----------
    xyz_m : (n, 3) float64
        Local frame: east, north, up [m].
    origin_m : (3,) float64
        World coordinates of the local origin [m].
    attributes : dict of str to (n,) array
        By name, as in the file: `Reflectance` [dB], `Deviation`, `Classification`,
        `ReturnNumber`, `NumberOfReturns`, `PointSourceId` (scan position), ...
    """

    xyz_m: np.ndarray
    origin_m: np.ndarray = field(default_factory=lambda: np.zeros(3))
    attributes: dict[str, np.ndarray] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.xyz_m)

    def select(self, chosen: np.ndarray) -> "Cloud":
        """The points that a mask or an index array chooses, in the same frame."""
        attributes = {name: values[chosen] for name, values in self.attributes.items()}
        return Cloud(self.xyz_m[chosen], self.origin_m, attributes)
