"""Ground that is not flat: a tilted plane with a few long waves."""

from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError
from dapple.formats.meshes import Mesh


@dataclass(frozen=True)
class Terrain:
    """Height of the ground as a smooth function of place.

    Attributes
    ----------
    gradient : (2,) float64
        Rise per metre to the east and to the north.
    wave_number_m : (k, 2) float64
        Wave vectors [rad/m].
    amplitude_m, phase_rad : (k,) float64
        Of the waves.
    """

    gradient: np.ndarray
    wave_number_m: np.ndarray
    amplitude_m: np.ndarray
    phase_rad: np.ndarray

    def height_m(self, xy_m: np.ndarray) -> np.ndarray:
        """Height (n,) at places (n, 2) of the local frame [m]."""
        xy = np.asarray(xy_m, np.float64)
        waves = np.sin(xy @ self.wave_number_m.T + self.phase_rad) @ self.amplitude_m
        return xy @ self.gradient + waves

    def mesh(self, low_m: np.ndarray, high_m: np.ndarray, step_m: float) -> Mesh:
        """Triangles between grid points that fill a rectangle; each one is an element.

        Parameters
        ----------
        low_m, high_m : (2,) float
            Corners, east and north, local frame [m].
        step_m : float
            Greatest distance between grid points along the axes [m].
        """
        axes = [
            np.linspace(low, high, int(np.ceil((high - low) / step_m - 1e-9)) + 1)
            for low, high in zip(low_m, high_m, strict=True)
        ]
        x, y = (grid.ravel() for grid in np.meshgrid(*axes, indexing="ij"))
        vertices = np.column_stack([x, y, self.height_m(np.column_stack([x, y]))])
        rows, columns = len(axes[0]), len(axes[1])
        corner = np.arange(rows * columns).reshape(rows, columns)
        a, b, c, d = (
            part.ravel()
            for part in (corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:])
        )
        faces = np.stack([np.stack([a, b, c], 1), np.stack([a, c, d], 1)], axis=1).reshape(-1, 3)
        return Mesh(vertices, faces.astype(np.int32), np.arange(len(faces), dtype=np.int32))


def undulating(
    *,
    slope: float = 0.04,
    wave_height_m: float = 1.5,
    wave_length_m: float = 30.0,
    n_waves: int = 6,
    seed: int,
) -> Terrain:
    """Draw a terrain.

    Parameters
    ----------
    slope : float
        Rise per metre of the mean plane, towards a direction drawn by chance.
    wave_height_m : float
        Greatest height of the waves above or below the plane [m]: the sum of all amplitudes.
    wave_length_m : float
        Longest wave; the shortest is half as long [m].
    n_waves : int
        Waves of different direction, length and height.
    seed : int
        Same seed, same terrain.

    Raises
    ------
    InputError
        Waves without length, or heights that are negative.
    """
    if wave_length_m <= 0 or wave_height_m < 0 or n_waves < 1:
        raise InputError(
            "chlorophyll.world.wave_length_m",
            f"{n_waves} waves of {wave_length_m:g} m, {wave_height_m:g} m high",
            "at least one wave with a length above 0",
            "Set the height to 0 for ground without waves.",
        )
    rng = np.random.default_rng(seed)
    towards = rng.uniform(0, 2 * np.pi)
    direction = rng.uniform(0, 2 * np.pi, n_waves)
    length_m = wave_length_m * rng.uniform(0.5, 1.0, n_waves)
    share = rng.uniform(0.3, 1.0, n_waves) * length_m
    return Terrain(
        slope * np.array([np.sin(towards), np.cos(towards)]),
        2 * np.pi / length_m[:, None] * np.stack([np.sin(direction), np.cos(direction)], axis=1),
        wave_height_m * share / share.sum(),
        rng.uniform(0, 2 * np.pi, n_waves),
    )
