"""Parts of crowns, sub-crowns cut into height layers: their space, plant area and facets."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from dapple.cloud import crowns as segments
from dapple.cloud.ground import heights
from dapple.formats.meshes import Mesh
from dapple.structure import alpha_shapes, facets
from dapple.structure.path_length import PartGrid

OUTSIDE = -1


@dataclass(frozen=True)
class Parts:
    """The space of all parts as tetrahedra of the crowns' alpha shapes, sorted by part.

    Attributes
    ----------
    corners_m : (t, 4, 3) float64
        Local frame [m].
    volumes_m3 : (t,) float64
    first : (p + 1,) int64
        Tetrahedra of part i are `first[i]` to `first[i + 1] - 1`.
    grid : PartGrid
        The same space as voxels.
    """

    corners_m: np.ndarray
    volumes_m3: np.ndarray
    first: np.ndarray
    grid: PartGrid

    @property
    def part_volume_m3(self) -> np.ndarray:
        """(p,) [m³]"""
        sums = np.concatenate([[0.0], np.cumsum(self.volumes_m3)])
        return np.diff(sums[self.first])


class Division:
    """Which part a place belongs to: by the map of sub-crowns, and by height above the ground.

    Parameters
    ----------
    labels : Raster
        Bands "crown" and "sub_crown", world coordinates.
    dem : Raster
    origin_m : (3,) array
        World coordinates of the local origin [m].
    n_layers : int
    base_share : float
        Share of a crown's points below its lowest layer's base (see `crowns.layer_limits`).
    min_height_m : float
        Lower points belong to no part [m].
    """

    def __init__(self, labels, dem, origin_m, *, n_layers, base_share, min_height_m):
        self.labels, self.dem, self.origin_m = labels, dem, np.asarray(origin_m)
        self.n_layers, self.base_share, self.min_height_m = n_layers, base_share, min_height_m
        self.sub_map = np.nan_to_num(labels.values[labels.bands.index("sub_crown")]).astype(int)
        crown_map = np.nan_to_num(labels.values[labels.bands.index("crown")]).astype(int)
        self.n_sub = int(self.sub_map.max(initial=0))
        # Sub-crown 0 (none) belongs to crown 0.
        self.crown_of_sub = np.zeros(self.n_sub + 1, int)
        self.crown_of_sub[self.sub_map.ravel()] = crown_map.ravel()
        self.limits_m = np.zeros((0, n_layers - 1))

    @property
    def n_parts(self) -> int:
        return self.n_sub * self.n_layers

    def sub_and_height(self, xyz_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Sub-crown (0: none) above whose pixels points lie, and their height [m]."""
        world = xyz_m + self.origin_m
        row, column = self.labels.pixel_of(world[:, :2])
        rows, columns = self.sub_map.shape
        inside = (row >= 0) & (row < rows) & (column >= 0) & (column < columns)
        sub = np.zeros(len(xyz_m), int)
        sub[inside] = self.sub_map[row[inside], column[inside]]
        return sub, heights(world, self.dem)

    def learn_layers(self, sub: np.ndarray, height_m: np.ndarray) -> None:
        """Set the limits of layers from the heights of points."""
        used = (sub > 0) & (height_m >= self.min_height_m)
        self.limits_m = segments.layer_limits(
            height_m[used],
            self.crown_of_sub[sub[used]],
            n_layers=self.n_layers,
            base_share=self.base_share,
        )

    def part(self, sub: np.ndarray, height_m: np.ndarray) -> np.ndarray:
        """(n,) part from 0, or `OUTSIDE`."""
        part = np.full(len(sub), OUTSIDE)
        used = (sub > 0) & (height_m >= self.min_height_m)
        layer = segments.layer_of(height_m[used], self.crown_of_sub[sub[used]], self.limits_m)
        part[used] = (sub[used] - 1) * self.n_layers + layer
        return part

    def table(self) -> pd.DataFrame:
        """One row a part: `subcrown`, `crown`, `layer` (1 is the lowest)."""
        sub = np.repeat(np.arange(1, self.n_sub + 1), self.n_layers)
        layer = np.tile(np.arange(1, self.n_layers + 1), self.n_sub)
        return pd.DataFrame({"subcrown": sub, "crown": self.crown_of_sub[sub], "layer": layer})

    def area_m2(self) -> np.ndarray:
        """(n_sub,) area of each sub-crown on the map [m²]."""
        counts = np.bincount(self.sub_map.ravel(), minlength=self.n_sub + 1)[1:]
        return counts * self.labels.pixel_m**2


def enclose(
    xyz_m: np.ndarray, part: np.ndarray, division: Division, *, alpha_m: float, voxel_m: float
) -> Parts:
    """Alpha shapes of the crowns, each divided among the crown's parts.

    A crown is enclosed as a whole and then cut: shapes of single parts would leave gaps as wide as
    the distance of points between neighbours, with no plants in them.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Points of crowns, local frame [m].
    part : (n,) int
        Their parts; `OUTSIDE` is left out.
    division : Division
    alpha_m : float
        Radius of the alpha shapes [m].
    voxel_m : float
        Points are thinned to one a voxel, and parts are drawn into voxels, of this edge [m].
    """
    crown = np.where(part >= 0, division.crown_of_sub[part // division.n_layers + 1], 0)
    corner = np.floor(xyz_m.min(axis=0) / voxel_m) * voxel_m
    cell = np.floor((xyz_m - corner) / voxel_m).astype(np.int64)
    shape = cell.max(axis=0) + 1
    grid = PartGrid(np.full(shape, OUTSIDE, np.int32), corner, voxel_m)
    key = np.ravel_multi_index(cell.T, shape) + crown * int(np.prod(shape))
    _, thinned = np.unique(key, return_index=True)
    thinned = thinned[crown[thinned] > 0]
    order = thinned[np.argsort(crown[thinned], kind="stable")]
    corners, volumes, parts = [], [], []
    ends = np.flatnonzero(np.diff(crown[order])) + 1
    for members in np.split(order, ends) if len(order) else []:
        shape_ = alpha_shapes.build(xyz_m[members], alpha_m)
        if not len(shape_):
            continue
        own = _parts_of(shape_.corners_m.mean(axis=1), int(crown[members[0]]), division)
        alpha_shapes.draw(shape_.corners_m, own, grid.part, corner, voxel_m)
        corners.append(shape_.corners_m)
        volumes.append(shape_.volumes_m3)
        parts.append(own)
    if not parts:
        return Parts(
            np.zeros((0, 4, 3)), np.zeros(0), np.zeros(division.n_parts + 1, np.int64), grid
        )
    number = np.concatenate(parts)
    by_part = np.argsort(number, kind="stable")
    first = np.searchsorted(number[by_part], np.arange(division.n_parts + 1))
    return Parts(np.concatenate(corners)[by_part], np.concatenate(volumes)[by_part], first, grid)


def _parts_of(xyz_m: np.ndarray, crown: int, division: Division) -> np.ndarray:
    """Parts of places in one crown; beyond its pixels that of the nearest pixel."""
    sub, height = division.sub_and_height(xyz_m)
    foreign = division.crown_of_sub[sub] != crown
    if foreign.any():
        pixels = np.argwhere(division.crown_of_sub[division.sub_map] == crown)
        y, x = division.labels.centres_m()
        centres = np.column_stack([x[pixels[:, 1]], y[pixels[:, 0]]]) - division.origin_m[:2]
        _, nearest = cKDTree(centres).query(xyz_m[foreign, :2])
        sub[foreign] = division.sub_map[tuple(pixels[nearest].T)]
    return division.part(sub, np.maximum(height, division.min_height_m))


def fill_unknown(
    density_m2_m3: np.ndarray, volume_m3: np.ndarray, table: pd.DataFrame
) -> np.ndarray:
    """Give parts of unknown density the mean of their crown's layer, crown, or all crowns.

    Means are over volume. Parts without any known neighbour in a scene without any get 0.
    """
    frame = table.assign(
        known=np.isfinite(density_m2_m3) & (volume_m3 > 0),
        volume=volume_m3,
        area=np.nan_to_num(density_m2_m3) * volume_m3,
    )
    frame[["volume", "area"]] = frame[["volume", "area"]].where(frame.known, 0.0)
    filled = np.where(frame.known, density_m2_m3, np.nan)
    for group in (["crown", "layer"], ["crown"], []):
        if group:
            sums = frame.groupby(group)[["volume", "area"]].transform("sum")
        else:
            sums = frame[["volume", "area"]].sum()
        with np.errstate(divide="ignore", invalid="ignore"):
            mean = np.asarray(sums["area"], float) / np.asarray(sums["volume"], float)
        filled = np.where(np.isnan(filled), mean, filled)
    return np.nan_to_num(filled)


def facet_meshes(
    parts: Parts,
    counts: np.ndarray,
    *,
    wood_share: float,
    facet_area_m2: float,
    rng: np.random.Generator,
) -> tuple[Mesh, Mesh]:
    """Fill parts with random squares of leaf and wood, uniform over their volume.

    Parameters
    ----------
    parts : Parts
    counts : (p,) int
        Squares of each part.
    wood_share : float
        Chance of a square to be wood, 0 to 1: pulses cannot tell twigs from leaves.
    facet_area_m2 : float
    rng : Generator

    Returns
    -------
    leaves, wood : Mesh
    """
    centres = [
        alpha_shapes.sample(parts.corners_m[a:b], parts.volumes_m3[a:b], int(n), rng)
        for a, b, n in zip(parts.first[:-1], parts.first[1:], counts, strict=True)
        if n
    ]
    centre = np.concatenate(centres) if centres else np.zeros((0, 3))
    is_wood = rng.random(len(centre)) < wood_share
    leaves, wood = (
        facets.squares(centre[chosen], facet_area_m2=facet_area_m2, rng=rng)
        for chosen in (~is_wood, is_wood)
    )
    return leaves, wood
