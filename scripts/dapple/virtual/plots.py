"""Plots of virtual conifers: where trees stand, how large they are, and what they cover."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from rasterio.features import rasterize
from rasterio.transform import Affine

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.virtual.crown_outlines import area_m2
from dapple.virtual.terrain import Terrain

COVER_PIXEL_M = 0.1
TRIES_PER_TREE = 2000


@dataclass(frozen=True)
class Sizes:
    """Sizes of the trees of a plot, drawn from normal distributions cut off at 2 SD.

    Attributes
    ----------
    height_m, height_sd_m : float
    crown_radius_m, crown_radius_sd_m : float
        Of the circle as large as the crown's projection.
    correlation : float
        Between height and crown radius.
    """

    height_m: float
    height_sd_m: float
    crown_radius_m: float
    crown_radius_sd_m: float
    correlation: float = 0.6

    def draw(self, rng: np.random.Generator) -> tuple[float, float]:
        """Height and crown radius of a tree [m]."""
        own, other = np.clip(rng.standard_normal(2), -2, 2)
        mixed = self.correlation * own + np.sqrt(1 - self.correlation**2) * other
        return (
            self.height_m + self.height_sd_m * own,
            self.crown_radius_m + self.crown_radius_sd_m * np.clip(mixed, -2, 2),
        )


def rings(trees: pd.DataFrame, outlines: list[np.ndarray]) -> list[np.ndarray]:
    """Outlines (k, 2) of the crowns of a plot, in the frame of the trees' coordinates [m]."""
    found = []
    for tree in trees.itertuples():
        turn = _turn(np.radians(tree.turn_deg))
        ring = tree.stretch_across * outlines[tree.grown] @ turn[:2, :2].T
        found.append(ring + np.array([tree.x_m, tree.y_m]))
    return found


def cover(
    crowns: list[np.ndarray], size_m: tuple[float, float], pixel_m: float = COVER_PIXEL_M
) -> float:
    """Share of a plot, from 0, 0 to its size, that lies under at least one crown.

    Parameters
    ----------
    crowns : list of (k, 2) arrays
        Outlines [m].
    size_m : two floats
        Edges of the plot [m].
    pixel_m : float
        The share is counted on pixels of this size [m].
    """
    return float(_covered(crowns, size_m, pixel_m).mean())


def _covered(crowns, size_m, pixel_m=COVER_PIXEL_M) -> np.ndarray:
    shape = tuple(max(round(edge / pixel_m), 1) for edge in size_m[::-1])
    if not crowns:
        return np.zeros(shape, bool)
    shapes = [
        {"type": "Polygon", "coordinates": [np.concatenate([r, r[:1]]).tolist()]} for r in crowns
    ]
    transform = Affine(size_m[0] / shape[1], 0, 0, 0, -size_m[1] / shape[0], size_m[1])
    return rasterize(shapes, shape, transform=transform, dtype=np.uint8).astype(bool)


def plant(
    outlines: list[np.ndarray],
    grown_height_m: np.ndarray,
    sizes: Sizes,
    terrain: Terrain,
    *,
    size_m: tuple[float, float],
    margin_m: float,
    cover_share: float,
    core_share: float = 0.7,
    seed: int,
) -> pd.DataFrame:
    """Place trees until their crowns cover a plot as asked.

    Trees come one after another to places drawn evenly over plot and margin; a tree stays where
    its stem is at least `core_share` of the sum of both crown radii from every other's (a
    hard-core process), and is tried elsewhere if not. When the plot is covered, all crowns are
    made a little narrower, so that the cover is met.

    Parameters
    ----------
    outlines : list of (k, 2) float64
        Outlines of the trees that were grown [m].
    grown_height_m : (len(outlines),) float64
        Their heights [m].
    sizes : Sizes
    terrain : Terrain
    size_m : two floats
        Edges of the plot, which begins at 0, 0 [m].
    margin_m : float
        Trees stand so far beyond the plot [m].
    cover_share : float
        Canopy cover of the plot, 0 to 1: its share under crown outlines.
    core_share : float
        1: crowns do not touch; below, they overlap.
    seed : int
        Same seed, same trees.

    Returns
    -------
    DataFrame
        `tree` from 1; `x_m`, `y_m`, `z_m` of the stem's foot (local frame), `grown` (which tree
        it is a copy of), `turn_deg`, `stretch_across`, `stretch_up`, `height_m`,
        `crown_radius_m`, `crown_area_m2`, `inside` (stem inside the plot).

    Raises
    ------
    InputError
        The cover cannot be reached without crowns that are too close.
    """
    rng = np.random.default_rng(seed)
    radius = np.sqrt([area_m2(ring) / np.pi for ring in outlines])
    low, high = -margin_m, np.asarray(size_m) + margin_m
    rows: list[Any] = []
    covered = _covered([], size_m)
    while covered.mean() < cover_share:
        height_m, radius_m = sizes.draw(rng)
        place = _free_place(rows, radius_m, low, high, core_share, rng)
        if place is None:
            raise InputError(
                "chlorophyll.cover",
                f"{covered.mean():.2f} with {len(rows)} trees, and no room for another",
                f"{cover_share:g}",
                "Ask for less cover, or lower core_share so that crowns overlap.",
            )
        grown = int(rng.integers(len(outlines)))
        row = {
            "tree": len(rows) + 1,
            "x_m": place[0],
            "y_m": place[1],
            "grown": grown,
            "turn_deg": rng.uniform(0, 360),
            "stretch_across": radius_m / radius[grown],
            "stretch_up": height_m / grown_height_m[grown],
            "height_m": height_m,
            "crown_radius_m": radius_m,
        }
        rows.append(row)
        covered |= _covered(rings(pd.DataFrame([row]), outlines), size_m)
    trees = _narrowed(pd.DataFrame(rows), outlines, size_m, cover_share)
    z_m = terrain.height_m(trees[["x_m", "y_m"]].to_numpy())
    trees.insert(3, "z_m", z_m)
    trees["crown_area_m2"] = np.pi * trees.crown_radius_m**2
    trees["inside"] = trees.x_m.between(0, size_m[0]) & trees.y_m.between(0, size_m[1])
    return trees


def _free_place(rows, radius_m, low, high, core_share, rng) -> np.ndarray | None:
    stems = np.array([[row["x_m"], row["y_m"]] for row in rows]).reshape(-1, 2)
    core = core_share * (radius_m + np.array([row["crown_radius_m"] for row in rows]))
    for _ in range(TRIES_PER_TREE):
        place = rng.uniform(low, high)
        if (np.hypot(*(stems - place).T) >= core).all():
            return place
    return None


def _narrowed(trees, outlines, size_m, cover_share) -> pd.DataFrame:
    """Make all crowns narrower by the same share, by bisection, until the cover is met."""
    low, high = 0.5, 1.0
    for _ in range(16):
        middle = 0.5 * (low + high)
        now = trees.assign(stretch_across=trees.stretch_across * middle)
        if cover(rings(now, outlines), size_m) < cover_share:
            low = middle
        else:
            high = middle
    return trees.assign(
        stretch_across=trees.stretch_across * high, crown_radius_m=trees.crown_radius_m * high
    )


def place(meshes: list[Mesh], trees: pd.DataFrame) -> tuple[Mesh, np.ndarray]:
    """Put copies of grown trees where the trees stand.

    Parameters
    ----------
    meshes : list of Mesh
        A part (leaves, wood) of each tree that was grown.
    trees : DataFrame
        From `plant`.

    Returns
    -------
    mesh : Mesh
        Elements tree after tree, in the trees' order.
    tree : (n_elements,) int32
        Row of the tree that each element is part of.
    """
    used = [meshes[k] for k in trees.grown]
    vertices = np.empty((sum(len(m.vertices_m) for m in used), 3))
    faces = np.empty((sum(len(m.faces) for m in used), 3), np.int32)
    element = np.empty(len(faces), np.int32)
    v = f = e = 0
    for mesh, tree in zip(used, trees.itertuples(), strict=True):
        matrix = _turn(np.radians(tree.turn_deg)) * [
            tree.stretch_across,
            tree.stretch_across,
            tree.stretch_up,
        ]
        n_v, n_f = len(mesh.vertices_m), len(mesh.faces)
        vertices[v : v + n_v] = mesh.vertices_m @ matrix.T + [tree.x_m, tree.y_m, tree.z_m]
        faces[f : f + n_f] = mesh.faces + v
        element[f : f + n_f] = mesh.element + e
        v, f, e = v + n_v, f + n_f, e + mesh.n_elements
    owner = np.repeat(np.arange(len(used), dtype=np.int32), [m.n_elements for m in used])
    return Mesh(vertices, faces, element), owner


def stretched_area_m2(meshes: list[Mesh], trees: pd.DataFrame) -> np.ndarray:
    """Area (n,) of a part of each tree after it was stretched [m²]."""
    found = np.empty(len(trees))
    for row, tree in enumerate(trees.itertuples()):
        across, up = tree.stretch_across, tree.stretch_up
        # Normals are stretched by the other axes' product.
        normal = meshes[tree.grown].triangle_normal * [across * up, across * up, across**2]
        found[row] = 0.5 * np.linalg.norm(normal, axis=1).sum()
    return found


def sample(trees: pd.DataFrame, size_m: tuple[float, float], n: int, seed: int) -> np.ndarray:
    """Choose field trees by chance among those inside the plot.

    Parameters
    ----------
    trees : DataFrame
        From `plant`.
    size_m : two floats
        Edges of the plot [m].
    n : int
        So many, or all inside if they are fewer. Trees whose crowns lie wholly in the plot come
        first.

    Returns
    -------
    (len(trees),) bool
    """
    near = np.minimum.reduce(
        [trees.x_m, trees.y_m, size_m[0] - trees.x_m, size_m[1] - trees.y_m]
    ) - np.asarray(trees.crown_radius_m)
    chance = np.random.default_rng(seed).permutation(len(trees))
    order = np.lexsort((chance, near < 0, ~trees.inside))
    chosen = np.zeros(len(trees), bool)
    chosen[order[: min(n, int(trees.inside.sum()))]] = True
    return chosen


def _turn(angle: float) -> np.ndarray:
    cosine, sine = np.cos(angle), np.sin(angle)
    return np.array([[cosine, -sine, 0.0], [sine, cosine, 0.0], [0.0, 0.0, 1.0]])
