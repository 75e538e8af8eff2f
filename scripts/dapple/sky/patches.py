"""Subdivisions of the sky: 1, 145 (Tregenza), 577 and 2305 (Reinhart) patches."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from dapple.errors import InputError
from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, Response

# Patches in each row of Tregenza's sky, from the horizon up; the zenith patch comes last.
TREGENZA_ROWS = (30, 30, 24, 24, 18, 12, 6)
SUBDIVISIONS = {1: 0, 145: 1, 577: 2, 2305: 4}


@dataclass(frozen=True)
class Patches:
    """A sky cut into rows of equal height, and rows into patches of equal width.

    Patches are counted from the horizon up and in each row clockwise from north; the first
    patch of a row is centred on north. The last patch is the cap around the zenith.

    Attributes
    ----------
    row_count : (r,) int
        Patches in each row, the cap included.
    row_sine : (r + 1,) float
        Sines of the altitudes that bound the rows, from 0 to 1.
    """

    row_count: np.ndarray
    row_sine: np.ndarray

    @property
    def n(self) -> int:
        """Number of patches."""
        return int(self.row_count.sum())

    @cached_property
    def row_start(self) -> np.ndarray:
        """(r,) index of the first patch of each row."""
        return np.cumsum(self.row_count) - self.row_count

    @cached_property
    def solid_angle_sr(self) -> np.ndarray:
        """(n,) solid angles [sr], in sum 2π."""
        return self._per_patch(2 * np.pi * np.diff(self.row_sine))

    @cached_property
    def projected_solid_angle_sr(self) -> np.ndarray:
        """(n,) solid angles weighted with the cosine of the zenith angle [sr], in sum π."""
        return self.seen_solid_angle_sr(COSINE)

    def seen_solid_angle_sr(self, response: Response) -> np.ndarray:
        """(n,) solid angles weighted with the response of a level sensor [sr]."""
        share = np.diff(sensor_response.share_below(response, self.row_sine))
        return self._per_patch(sensor_response.integral_sr(response) * share)

    @cached_property
    def directions(self) -> np.ndarray:
        """(n, 3) unit vectors (east, north, up) to the middle of the patches; the cap's is up."""
        return self.sample(np.array([[0.5, 0.5]]))[:, 0]

    def sample(self, uv: np.ndarray) -> np.ndarray:
        """Directions in every patch, uniform in projected solid angle for uniform `uv`.

        Parameters
        ----------
        uv : (s, 2) float
            Points in the unit square, used in every patch.

        Returns
        -------
        (n, s, 3) float64
            Unit vectors (east, north, up).
        """
        low, high = (np.repeat(bound, self.row_count) for bound in _bounds(self.row_sine**2))
        width = 2 * np.pi / np.repeat(self.row_count, self.row_count)
        middle = (np.arange(self.n) - np.repeat(self.row_start, self.row_count)) * width
        sine_squared = low[:, None] + (high - low)[:, None] * uv[:, 0]
        azimuth = middle[:, None] + width[:, None] * (uv[:, 1] - 0.5)
        cap = np.arange(self.n) == self.n - 1
        if len(uv) == 1:
            sine_squared[cap] = 1.0
        sine, cosine = np.sqrt(sine_squared), np.sqrt(1 - sine_squared)
        return np.stack([cosine * np.sin(azimuth), cosine * np.cos(azimuth), sine], axis=-1)

    def index(self, directions: np.ndarray) -> np.ndarray:
        """Find the patch of each direction.

        Parameters
        ----------
        directions : (..., 3) float
            Vectors (east, north, up), unit length.

        Returns
        -------
        (...) int64
            Patch index, -1 below the horizon.
        """
        east, north, up = np.moveaxis(np.asarray(directions, float), -1, 0)
        row = np.searchsorted(self.row_sine, up, side="right") - 1
        row = np.clip(row, 0, len(self.row_count) - 1)
        count = self.row_count[row]
        turn = np.arctan2(east, north) / (2 * np.pi)
        column = np.floor(turn * count + 0.5).astype(np.int64) % count
        return np.where(up < 0, -1, self.row_start[row] + column)

    def _per_patch(self, per_row: np.ndarray) -> np.ndarray:
        return np.repeat(per_row / self.row_count, self.row_count)


@cache
def patches(n: int) -> Patches:
    """Cut the sky into n patches.

    Parameters
    ----------
    n : {1, 145, 577, 2305}
        1: the whole sky; 145: Tregenza (1987); 577 and 2305: each patch but the zenith's cut
        into 2 × 2 or 4 × 4 (Reinhart), with rows as in Radiance, where the cap's radius is
        half the height of a row.

    Raises
    ------
    InputError
        Another number.
    """
    if n not in SUBDIVISIONS:
        raise InputError(
            "sky patches", f"{n}", f"one of {', '.join(map(str, SUBDIVISIONS))}", "Choose one."
        )
    factor = SUBDIVISIONS[n]
    if factor == 0:
        return Patches(np.array([1]), np.array([0.0, 1.0]))
    rows = np.repeat(np.array(TREGENZA_ROWS) * factor, factor)
    height_deg = 90.0 / (len(rows) + 0.5)
    altitude_deg = np.append(np.arange(len(rows) + 1) * height_deg, 90.0)
    return Patches(np.append(rows, 1), np.sin(np.radians(altitude_deg)))


def _bounds(edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return edges[:-1], edges[1:]
