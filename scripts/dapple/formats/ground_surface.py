"""The ground under a tree or a plot as heights on a grid, flat or not."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from scipy import ndimage

from dapple.formats import netcdf
from dapple.formats.meshes import Mesh

FLAT_M = 0.02
"""Ground whose heights differ by less is flat."""
PIECE = 1_000_000
"""Places whose height is looked up at once."""
_HEIGHT = "ground_z_m"


@dataclass(frozen=True)
class GroundSurface:
    """Heights of the ground, bilinear between nodes, level beyond the outermost.

    Attributes
    ----------
    x_m, y_m : (c,), (r,) float64
        Nodes, ascending and evenly spaced, local frame [m].
    z_m : (r, c) float64
        Heights at the nodes, local frame [m].
    found_by : str
        Where they come from, in words.
    """

    x_m: np.ndarray
    y_m: np.ndarray
    z_m: np.ndarray
    found_by: str = "configuration"

    @property
    def is_flat(self) -> bool:
        return bool(np.ptp(self.z_m) < FLAT_M)

    @property
    def lowest_m(self) -> float:
        """Height of the lowest node [m]."""
        return float(self.z_m.min())

    @property
    def slope(self) -> float:
        """Rise per metre of the mean plane."""
        if min(self.z_m.shape) < 2:
            return 0.0
        x, y = np.meshgrid(self.x_m - self.x_m.mean(), self.y_m - self.y_m.mean())
        east, north = (float((axis * self.z_m).sum() / (axis * axis).sum()) for axis in (x, y))
        return float(np.hypot(east, north))

    def height_m(self, xy_m: np.ndarray) -> np.ndarray:
        """(n,) height of the ground at places (n, 2) of the local frame [m]."""
        xy = np.asarray(xy_m, np.float64)
        if self.z_m.size == 1:
            return np.full(len(xy), self.z_m[0, 0])
        height = np.empty(len(xy))
        for at in range(0, len(xy), PIECE):
            row = (xy[at : at + PIECE, 1] - self.y_m[0]) / _step(self.y_m)
            column = (xy[at : at + PIECE, 0] - self.x_m[0]) / _step(self.x_m)
            height[at : at + PIECE] = ndimage.map_coordinates(
                self.z_m, [row, column], order=1, mode="nearest"
            )
        return height

    def mesh(self, most_nodes: int | None = None) -> Mesh:
        """Two triangles and one element for each square of nodes; normals point up.

        With more than `most_nodes` along an edge, as many as that, evenly spaced.
        """
        x_m, y_m = (_thinned(axis, most_nodes) for axis in (self.x_m, self.y_m))
        x, y = np.meshgrid(x_m, y_m)
        rows, columns = x.shape
        z = self.height_m(np.column_stack([x.ravel(), y.ravel()]))
        at = np.arange(rows * columns).reshape(rows, columns)
        a, b = at[:-1, :-1].ravel(), at[:-1, 1:].ravel()
        d, c = at[1:, :-1].ravel(), at[1:, 1:].ravel()
        faces = np.stack([a, b, c, a, c, d], axis=1).reshape(-1, 3).astype(np.int32)
        vertices = np.column_stack([x.ravel(), y.ravel(), z])
        return Mesh(vertices, faces, np.repeat(np.arange(len(a), dtype=np.int32), 2))


def flat(z_m: float, found_by: str = "configuration") -> GroundSurface:
    """Level ground at a height of the local frame [m]."""
    return GroundSurface(np.zeros(1), np.zeros(1), np.full((1, 1), float(z_m)), found_by)


def write(path: str | Path, ground: GroundSurface, origin_m: np.ndarray, crs: str = "") -> None:
    """Write NetCDF with the world origin of the local frame and its coordinate system."""
    attributes = {"long_name": "height of the ground", "units": "m"}
    axes = {"long_name": "local coordinate", "units": "m"}
    dataset = xr.Dataset(
        {_HEIGHT: (("y", "x"), ground.z_m, attributes)},
        {"x": ("x", ground.x_m, axes), "y": ("y", ground.y_m, axes)},
        {
            "found_by": ground.found_by,
            "origin_m": np.asarray(origin_m, float),
            "crs": crs,
        },
    )
    netcdf.write(path, dataset)


def read(path: str | Path) -> GroundSurface:
    """Read what `write` wrote.

    Raises
    ------
    InputError
        The file is missing or holds something else.
    """
    dataset = netcdf.read(path, variables=[_HEIGHT], attributes=["found_by"])
    return GroundSurface(
        dataset["x"].to_numpy(),
        dataset["y"].to_numpy(),
        dataset[_HEIGHT].transpose("y", "x").to_numpy(),
        dataset.attrs["found_by"],
    )


def _thinned(nodes_m: np.ndarray, most: int | None) -> np.ndarray:
    if most is None or len(nodes_m) <= most:
        return nodes_m
    return np.linspace(nodes_m[0], nodes_m[-1], most)


def _step(nodes_m: np.ndarray) -> float:
    return (nodes_m[-1] - nodes_m[0]) / (len(nodes_m) - 1) if len(nodes_m) > 1 else 1.0
