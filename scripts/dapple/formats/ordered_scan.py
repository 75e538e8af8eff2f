"""Ordered scans, as of PTX and E57: returns that know the column and the row of their shot."""

from dataclasses import dataclass, field, replace

import numpy as np


@dataclass(frozen=True)
class OrderedScan:
    """One scan position whose shots lie on a grid of columns (azimuth) and rows (zenith).

    Attributes
    ----------
    xyz_m : (n, 3) float64
        Returns in the scanner's frame [m].
    column, row : (n,) int64
        Cell of each return; a cell without return is a shot that met nothing.
    shape : (int, int)
        Columns and rows.
    rotation : (3, 3) float64
        world = rotation @ scanner + position.
    position_m : (3,) float64
        Scanner in the world [m].
    attributes : dict of str to (n,) array
    """

    xyz_m: np.ndarray
    column: np.ndarray
    row: np.ndarray
    shape: tuple[int, int]
    rotation: np.ndarray
    position_m: np.ndarray
    attributes: dict[str, np.ndarray] = field(default_factory=dict)

    @property
    def world_xyz_m(self) -> np.ndarray:
        """(n, 3) returns in the world [m]."""
        return self.xyz_m @ self.rotation.T + self.position_m

    @property
    def cell(self) -> np.ndarray:
        """(n,) number of each return's cell, column by column."""
        return self.column * self.shape[1] + self.row

    @property
    def hit(self) -> np.ndarray:
        """(columns, rows) whether a shot has a return."""
        found = np.zeros(self.shape, bool)
        found[self.column, self.row] = True
        return found

    def in_metres(self, unit_m: float, turn: np.ndarray) -> "OrderedScan":
        """The same from units of so many metres, in a world turned by a rotation (3, 3)."""
        return replace(
            self,
            xyz_m=self.xyz_m * unit_m,
            rotation=turn @ self.rotation,
            position_m=turn @ self.position_m * unit_m,
        )

    def transposed(self) -> "OrderedScan":
        """The same with columns for rows: some writers number them the other way."""
        return OrderedScan(
            self.xyz_m,
            self.row,
            self.column,
            self.shape[::-1],
            self.rotation,
            self.position_m,
            self.attributes,
        )
