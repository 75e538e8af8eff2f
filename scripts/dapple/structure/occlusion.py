"""Leaf area added to polygons where beams seldom came.

A polygon stands where a beam met a leaf; what hides behind other leaves has none. Voxels know
better: the likelihood of plant area density counts how far beams travelled, so that a place seen
by few beams is uncertain but not too thin. Where polygons fall short of the voxels' area, copies
of polygons nearby make up for it.
"""

import numpy as np
import xarray as xr
from scipy.ndimage import convolve
from scipy.spatial import ConvexHull, Delaunay, QhullError, cKDTree

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.structure.voxel_data import CAPPED


def correct(
    leaves: Mesh,
    voxels: xr.Dataset,
    *,
    seed: int,
    n_classes: int = 8,
    min_cells: int = 20,
    fill_range_m: float = 0.5,
    n_donors: int = 32,
) -> Mesh:
    """Add polygons where coverage by the laser is poor.

    Cells are parted into classes of equal number by their coverage (`coverage_m_m3`). In each
    class the area of polygons is compared with that of the voxels; pooled, because a single
    voxel's density is noisy and a sum over what is lacking alone would be too large. Each cell of
    a class gets the same share of its own area: copies of polygons nearby, as often as their
    area, turned about the vertical, at even chance anywhere in the cell.

    Parameters
    ----------
    leaves : Mesh
        Polygons of leaves, as `polygons.reconstruct` makes them.
    voxels : xarray.Dataset
        As `voxels.plant_area_density` gives it: edges a few times those of the polygons' voxels,
        0.2 m rather than 1 m, because coverage changes within a metre.
    seed : int
        Chooses which polygons are copied, their turn and place.
    n_classes, min_cells : int
        Most classes of coverage, and fewest cells in one.
    fill_range_m : float
        Unknown cells within the crown's convex hull take the mean density of the 16 nearest known
        ones, weighted by exp(-distance/range) [m].
    n_donors : int
        Nearest polygons of a cell from which copies are drawn, in proportion to their area.

    Returns
    -------
    Mesh
        The polygons as they were, then those added: elements from `leaves.n_elements` on.

    Raises
    ------
    InputError
        There is no polygon to copy.

    Notes
    -----
    Correction by coverage classes follows Van der Zande et al. (2008); in place of a
    contact frequency it takes maximum likelihood of free paths (Pimont et al. 2018).
    """
    if not leaves.n_elements:
        raise InputError(
            "polygons.occlusion_correction",
            "no leaf polygon",
            "some polygons, whose copies fill what was not seen",
            "Turn the correction off or check the classification.",
        )
    lacking_m2, corner_m, size_m = lacking_area(
        leaves, voxels, n_classes=n_classes, min_cells=min_cells, fill_range_m=fill_range_m
    )
    cells = np.argwhere(lacking_m2 > 0)
    if not len(cells):
        return leaves
    rng = np.random.default_rng(seed)
    area_m2, centre_m = leaves.element_area_m2, leaves.element_centre_m
    middle_m = corner_m + (cells + 0.5) * size_m
    k = min(n_donors, leaves.n_elements)
    near = cKDTree(centre_m).query(middle_m, k)[1].reshape(len(cells), k)
    weight = area_m2[near]
    typical_m2 = (weight**2).sum(axis=1) / weight.sum(axis=1)
    wanted = lacking_m2[tuple(cells.T)] / typical_m2
    copies = np.floor(wanted + rng.random(len(cells))).astype(np.int64)
    cell = np.repeat(np.arange(len(cells)), copies)
    share = np.cumsum(weight, axis=1) / weight.sum(axis=1, keepdims=True)
    pick = (share[cell] < rng.random(len(cell))[:, None]).sum(axis=1)
    donor = near[cell, np.minimum(pick, k - 1)]
    place_m = corner_m + (cells[cell] + rng.random((len(cell), 3))) * size_m
    return _append(leaves, donor, centre_m, place_m, 2 * np.pi * rng.random(len(cell)))


def lacking_area(
    leaves: Mesh,
    voxels: xr.Dataset,
    *,
    n_classes: int = 8,
    min_cells: int = 20,
    fill_range_m: float = 0.5,
) -> tuple[np.ndarray, np.ndarray, float]:
    """One-sided leaf area that polygons lack in every cell.

    Parameters
    ----------
    leaves, voxels, n_classes, min_cells, fill_range_m
        As in `correct`.

    Returns
    -------
    lacking_m2 : (nx, ny, nz) float64
        0 where polygons have as much as the voxels or more.
    corner_m : (3,) float64
        Lowest corner of the cells [m].
    size_m : float
        Their edge [m].
    """
    data = voxels.transpose("x", "y", "z")
    size_m = float(data.attrs["voxel_size_m"])
    corner_m = np.array([float(data[axis][0]) - 0.5 * size_m for axis in "xyz"])
    density = data["plant_area_density_m2_m3"].to_numpy().astype(np.float64)
    known = np.isfinite(density)
    filled = fill(density, size_m, fill_range_m)
    expected_m2 = filled * size_m**3
    polygons_m2 = area_by_cell(leaves, corner_m, size_m, density.shape)
    coverage = np.where(known, coverage_m_m3(data), 0.0)
    capped = (data["flag"].to_numpy() & CAPPED) > 0
    leafy = (expected_m2 > 0) | (polygons_m2 > 0)
    lacking = np.zeros(density.shape)
    number = _classes(coverage, leafy & known & ~capped, n_classes, min_cells)
    for k in range(number.max() + 1):
        members = leafy & known & (number == k)
        # A density at its cap says "at least": it would make polygons look better than they are.
        judged = members & ~capped
        total = expected_m2[judged].sum()
        share = 1 - polygons_m2[judged].sum() / total if total > 0 else 0.0
        lacking[members] = max(share, 0.0) * expected_m2[members]
    unseen = leafy & ~known
    lacking[unseen] = np.maximum(expected_m2[unseen] - polygons_m2[unseen], 0.0)
    return lacking, corner_m, size_m


def coverage_m_m3(voxels: xr.Dataset) -> np.ndarray:
    """Length that beams travelled in a voxel before they were stopped, per volume [m m⁻³].

    It is the number of beams that cross a unit of area there. What an intercepted beam did not
    travel is taken as half its path.
    """
    data = voxels.transpose("x", "y", "z")
    n, entering = data["n_shots"].to_numpy(), data["entering"].to_numpy().astype(np.float64)
    stopped = data["intercepted"].to_numpy().astype(np.float64)
    path = data["path_length_m"].to_numpy().astype(np.float64)
    remaining = np.divide(entering - 0.5 * stopped, n, out=np.zeros(n.shape), where=n > 0)
    return path * remaining / float(data.attrs["voxel_size_m"]) ** 3


def fill(density: np.ndarray, size_m: float, range_m: float) -> np.ndarray:
    """Give unknown cells inside the convex hull of leafy ones the mean of those around them.

    Parameters
    ----------
    density : (nx, ny, nz) float64
        NaN where unknown.
    size_m, range_m : float
        Edge of a cell, and length over which weights fall to 1/e [m].

    Returns
    -------
    (nx, ny, nz) float64
        Unknown cells outside the hull are 0.
    """
    known, result = np.isfinite(density), np.nan_to_num(density, nan=0.0)
    unknown = np.argwhere(in_crown(density) & ~known)
    if len(unknown):
        donors = np.argwhere(known)
        k = min(16, len(donors))
        distance, near = cKDTree(donors).query(unknown, k)
        weight = np.exp(-distance.reshape(-1, k) * size_m / range_m)
        values = density[tuple(donors[near.reshape(-1, k)].transpose(2, 0, 1))]
        result[tuple(unknown.T)] = (weight * values).sum(axis=1) / weight.sum(axis=1)
    return result


def in_crown(density: np.ndarray) -> np.ndarray:
    """Leafy cells and unknown ones within their convex hull.

    Cells that stand alone, with less than three leafy neighbours among 26, are noise points rather
    than leaves: they are left out, lest one of them widen the hull.

    Parameters
    ----------
    density : (nx, ny, nz) float64
        NaN where unknown.

    Returns
    -------
    (nx, ny, nz) bool
    """
    leafy = np.nan_to_num(density, nan=0.0) > 0
    inside = leafy & (convolve(leafy.astype(np.int16), np.ones((3, 3, 3)), mode="constant") > 3)
    if not inside.any():
        inside = leafy
    index, unknown = np.argwhere(inside), np.argwhere(np.isnan(density))
    if not len(unknown) or len(index) < 5:
        return inside
    try:
        hull = Delaunay(index[ConvexHull(index).vertices])
    except QhullError:  # all leaves in one plane of cells: nothing is inside
        return inside
    within = unknown[hull.find_simplex(unknown) >= 0]
    inside = inside.copy()
    inside[tuple(within.T)] = True
    return inside


def area_by_cell(
    mesh: Mesh, corner_m: np.ndarray, size_m: float, shape: tuple[int, ...]
) -> np.ndarray:
    """One-sided area of the triangles whose middle lies in each cell of a grid [m²]."""
    middle_m = mesh.vertices_m[mesh.faces].mean(axis=1)
    index = np.floor((middle_m - corner_m) / size_m).astype(np.int64)
    inside = ((index >= 0) & (index < shape)).all(axis=1)
    flat = np.ravel_multi_index(tuple(index[inside].T), shape)
    area = np.bincount(flat, mesh.triangle_area_m2[inside], int(np.prod(shape)))
    return area.reshape(shape)


def _classes(
    coverage: np.ndarray, judged: np.ndarray, n_classes: int, min_cells: int
) -> np.ndarray:
    """Number of each cell's class; cut so that cells that can be judged are shared evenly."""
    values = coverage[judged]
    n = int(np.clip(len(values) // min_cells, 1, n_classes))
    cuts = np.quantile(values, np.arange(1, n) / n) if n > 1 else np.zeros(0)
    return np.searchsorted(cuts, coverage, side="right")


def _append(
    mesh: Mesh, donor: np.ndarray, centre_m: np.ndarray, place_m: np.ndarray, turn: np.ndarray
) -> Mesh:
    """Add copies of elements, turned about the vertical and moved, triangle by triangle."""
    first = np.searchsorted(mesh.element, np.arange(mesh.n_elements + 1))
    count = np.diff(first)[donor]
    copy = np.repeat(np.arange(len(donor)), count)
    step = np.arange(len(copy)) - np.repeat(np.cumsum(count) - count, count)
    corners = mesh.vertices_m[mesh.faces[first[donor][copy] + step]]
    corners = corners - centre_m[donor[copy]][:, None]
    cosine, sine = (f(turn)[copy][:, None] for f in (np.cos, np.sin))
    x, y = corners[..., 0], corners[..., 1]
    turned = np.stack([x * cosine - y * sine, x * sine + y * cosine, corners[..., 2]], axis=-1)
    vertices = (turned + place_m[copy][:, None]).reshape(-1, 3)
    faces = len(mesh.vertices_m) + np.arange(len(vertices)).reshape(-1, 3)
    return Mesh(
        np.concatenate([mesh.vertices_m, vertices]),
        np.concatenate([mesh.faces, faces]).astype(np.int32),
        np.concatenate([mesh.element, mesh.n_elements + copy]).astype(np.int32),
    )
