"""Density of voxels as light meets it: leaves that stand in clumps let more light through.

A turbid voxel spreads its leaves evenly. Real ones stand in clumps with gaps between: the mean
transmittance of many beams is higher than that of one beam through the mean density (Jensen's
inequality). The effective density is the one at which an even medium lets as much through.
"""

import numpy as np
import xarray as xr
from numba import njit, prange

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure import leaf_angles, occlusion, returns
from dapple.structure.returns import Kinds
from dapple.structure.summary import voxel_area_m2
from dapple.structure.traversal import (
    HIT,
    entry_and_exit,
    nearest_facet,
    next_facet,
    start_march,
)
from dapple.structure.voxel_data import CAPPED, DENSITY, ESTIMATED

"""What was estimated, kept beside the effective density in corrected voxels."""


def correct(
    voxels: xr.Dataset,
    finer: xr.Dataset | None = None,
    shots: Shots | None = None,
    *,
    kinds: Kinds = None,
    fill_range_m: float | None = 0.5,
    min_filled_share: float = 0.05,
    max_shots: int = 200_000,
    bounds: tuple[float, float] = (0.5, 2.0),
) -> xr.Dataset:
    """Replace plant area density by the effective density for light.

    1. The density with the transmittance of the laser's own beams in the voxel
       (`pad_transmittance_m2_m3`); at the cap, which says "at least", from the share of beams that
       the voxel let through (`uncapped`).
    2. From `finer`, where given, the density with the mean transmittance through the fine voxels
       of each large one (`effective_density`), where it is lower: it leaves out the clumps within
       fine voxels, and beams those that are seen from other sides.
    3. Unknown voxels inside the crown, which light would cross freely, take the density around.
    4. Where much was filled and `shots` are given, one factor for all: the clumping index at
       which beams of the scan get through the crown as often as they did (`clumping_index`). The
       likelihood of densities that are known sees to it by itself.

    Parameters
    ----------
    voxels : xarray.Dataset
        As `voxels.plant_area_density` gives it.
    finer : xarray.Dataset or None
        The same scan in voxels a whole number of times smaller, facets aligned.
    shots : Shots or None
        The scan.
    kinds : callable, (m,) uint8 or None
        What each return is, as in `voxels.accumulate`.
    fill_range_m : float or None
        As in `occlusion.fill`; None leaves unknown voxels unknown.
    min_filled_share : float
        Share of plant area in filled voxels above which the clumping index is applied.
    max_shots : int
        Shots that are followed, evenly spread over all.
    bounds : tuple of float
        Smallest and largest clumping index that is applied.

    Returns
    -------
    xarray.Dataset
        A copy with another `plant_area_density_m2_m3`, the one given in
        `plant_area_density_estimated_m2_m3`; attributes `clumping_index` (1 without
        shots) and `leaf_area_before_m2`. These densities are for light: their sum is no longer
        the leaf area.

    Raises
    ------
    InputError
        Sizes or facets of `finer` do not fit.
    """
    density = voxels[DENSITY].transpose("x", "y", "z")
    size = float(voxels.attrs["voxel_size_m"])
    effective = uncapped(voxels)
    if finer is not None:
        fine = finer[DENSITY].transpose("x", "y", "z")
        finer = finer.assign({DENSITY: fine.copy(data=uncapped(finer))})
        effective = np.minimum(effective, effective_density(voxels, finer))
    known = np.isfinite(effective)
    if fill_range_m is not None:
        effective = np.where(known, effective, occlusion.fill(effective, size, fill_range_m))
    corrected = voxels.assign({DENSITY: density.copy(data=effective), ESTIMATED: density})
    corrected[DENSITY].attrs["long_name"] = "effective plant area density for light"
    guessed = effective[~known].sum() > min_filled_share * np.nansum(effective)
    index = 1.0
    if shots is not None and len(shots) and guessed:
        found = clumping_index(corrected, shots, kinds=kinds, max_shots=max_shots)
        index = float(np.clip(found, *bounds))
        corrected[DENSITY] = density.copy(data=effective * index)
    before = voxel_area_m2(voxels)
    corrected.attrs |= {"clumping_index": index, "leaf_area_before_m2": before}
    return corrected


def uncapped(voxels: xr.Dataset) -> np.ndarray:
    """Density by the transmittance of beams, without a cap.

    Where the estimator stopped at its cap, the transmittance is (passed + 1)/(entered + 2), which
    few beams that were all stopped do not make 0 (Laplace), and the density -ln of it over G times
    the mean path.

    Parameters
    ----------
    voxels : xarray.Dataset
        As `voxels.plant_area_density` gives it, weights being shares of beams.

    Returns
    -------
    (nx, ny, nz) float64
        [m² m⁻³]; NaN where unknown.
    """
    data = voxels.transpose("x", "y", "z")
    name = "pad_transmittance_m2_m3" if "pad_transmittance_m2_m3" in data else DENSITY
    density = np.where(np.isnan(data[DENSITY]), np.nan, data[name]).astype(np.float64)
    at = (data["flag"].to_numpy() & CAPPED) > 0
    if at.any():
        number, path, zenith, entered, stopped = (
            data[name].to_numpy()[at].astype(np.float64)
            for name in ("n_shots", "path_length_m", "mean_zenith_deg", "entering", "intercepted")
        )
        angles = str(voxels.attrs.get("leaf_angle_distribution", "spherical")).lower()
        share = np.clip((entered - stopped) / entered, 0, 1) * number
        depth = -np.log((share + 1) / (number + 2))
        # Beams that were stopped have crossed a part: a chord is the mean of whole paths.
        found = depth / (leaf_angles.projection(angles, np.radians(zenith)) * path / number)
        density[at] = np.maximum(found, density[at])
    return density


def effective_density(
    voxels: xr.Dataset, finer: xr.Dataset, *, min_known: float = 0.9
) -> np.ndarray:
    """Density at which even voxels have the mean transmittance of the finer voxels in them.

    Along each axis, beams pass every column of fine voxels; -ln(mean transmittance)/(G·size) is
    the effective density along it, and the mean over the three axes is taken. Unknown fine voxels
    are like the mean of the known ones in the same large voxel.

    Parameters
    ----------
    voxels, finer : xarray.Dataset
        The size of `voxels` is a multiple of that of `finer`, facets are aligned.
    min_known : float
        Smallest share of fine voxels that must be known: few beams make poor fine densities.

    Returns
    -------
    (nx, ny, nz) float64
        [m² m⁻³]; where too few fine voxels are known, the density of `voxels`.

    Raises
    ------
    InputError
        Sizes or facets do not fit.
    """
    coarse = voxels[DENSITY].transpose("x", "y", "z")
    size, fine_size = float(voxels.attrs["voxel_size_m"]), float(finer.attrs["voxel_size_m"])
    blocks = _blocks(coarse, finer[DENSITY].transpose("x", "y", "z"), size, fine_size)
    known = np.isfinite(blocks)
    n_known = known.sum(axis=(3, 4, 5))
    mean = np.where(known, blocks, 0).sum(axis=(3, 4, 5)) / np.maximum(n_known, 1)
    blocks = np.where(known, blocks, mean[..., None, None, None])
    angles = str(voxels.attrs.get("leaf_angle_distribution", "spherical")).lower()
    total = np.zeros(coarse.shape)
    for axis in range(3):
        across = float(leaf_angles.projection(angles, np.array(0.0 if axis == 2 else np.pi / 2)))
        depth = across * blocks.sum(axis=3 + axis) * fine_size
        total += -np.log(np.exp(-depth).mean(axis=(3, 4))) / (across * size)
    enough = n_known >= max(min_known * blocks[0, 0, 0].size, 1)
    return np.where(enough, total / 3, coarse.to_numpy())


def _blocks(coarse: xr.DataArray, fine: xr.DataArray, size: float, fine_size: float) -> np.ndarray:
    """Fine voxels by the large voxel they lie in: (nx, ny, nz, k, k, k), 0 outside the fine grid.

    A grid ends where the cloud does: there is nothing beyond.
    """
    k = round(size / fine_size)
    low = np.array([float(coarse[a][0]) - size / 2 for a in "xyz"])
    fine_low = np.array([float(fine[a][0]) - fine_size / 2 for a in "xyz"])
    shift = (fine_low - low) / fine_size
    if k < 2 or abs(size / fine_size - k) > 1e-6 or np.abs(shift - np.round(shift)).max() > 1e-3:
        raise InputError(
            "voxels.subvoxel_clumping",
            f"voxels of {size:g} m over voxels of {fine_size:g} m",
            "a whole number of small voxels in each large one, facets aligned",
            "Choose sizes of which one is a multiple of the other.",
        )
    shift = np.round(shift).astype(int)
    whole = np.zeros(np.array(coarse.shape) * k)
    begin = np.maximum(shift, 0)
    end = np.minimum(shift + fine.shape, whole.shape)
    to = tuple(slice(b, e) for b, e in zip(begin, end, strict=True))
    whole[to] = fine.to_numpy()[
        tuple(slice(b - s, e - s) for b, e, s in zip(begin, end, shift, strict=True))
    ]
    nx, ny, nz = coarse.shape
    return whole.reshape(nx, k, ny, k, nz, k).transpose(0, 2, 4, 1, 3, 5)


def clumping_index(
    voxels: xr.Dataset,
    shots: Shots,
    *,
    kinds: Kinds = None,
    max_shots: int = 200_000,
    n_bins: int = 24,
) -> float:
    """Factor on all densities at which beams of the scan get through as often as they did.

    For every beam the optical depth of the voxels on its way is added up. The rate at which
    beams meet leaves per unit of this depth would be 1 in a medium as the voxels say; counted in
    bins of depth passed so far, with beams leaving the count where wood stopped them, it gives the
    share that gets through (as in a life table, Kaplan and Meier 1958). The index is the factor at
    which exp(-index·depth) has the same mean over the depths of all beams.

    Parameters
    ----------
    voxels : xarray.Dataset
        Unknown densities count as 0.
    shots, kinds, max_shots
        As in `correct`.
    n_bins : int
        Bins of optical depth.

    Returns
    -------
    float
        Below 1: leaves are clumped. 1 where no beam met the voxels.
    """
    density = voxels[DENSITY].transpose("x", "y", "z")
    size = float(voxels.attrs["voxel_size_m"])
    corner = np.array([float(density[a][0]) - size / 2 for a in "xyz"])
    angles = str(voxels.attrs.get("leaf_angle_distribution", "spherical")).lower()
    some = np.unique(np.linspace(0, len(shots) - 1, min(max_shots, len(shots))).astype(np.int64))
    zenith = np.arccos(np.minimum(np.abs(shots.direction[some, 2]), 1.0))
    kind = returns.kinds_of_chunk(kinds, shots, 0)
    depth, whole = depths_at_returns(
        shots, some, leaf_angles.projection(angles, zenith), density, corner, size
    )
    met = whole > 1e-6
    if not met.any():
        return 1.0
    rate, edges = _hazard(shots, some, kind, depth, whole, n_bins)
    passed = np.concatenate([[0.0], np.cumsum(rate * np.diff(edges))])
    observed = np.exp(-np.interp(whole[met], edges, passed)).mean()
    return _matching(whole[met], observed)


def depths_at_returns(
    shots: Shots,
    some: np.ndarray,
    g: np.ndarray,
    density: xr.DataArray,
    corner_m: np.ndarray,
    size_m: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Optical depth of voxels up to every return, and along the whole beam.

    Parameters
    ----------
    shots : Shots
    some : (n,) int64
        Shots that are followed.
    g : (n,) float64
        Projection of the leaves along each of them.
    density : DataArray (x, y, z)
        NaN counts as 0.
    corner_m : (3,) float64
    size_m : float

    Returns
    -------
    depth : (m,) float64
        At all returns of `shots`; NaN at those of shots that are not followed.
    whole : (n,) float64
        Through the whole grid, as if nothing stopped the beam.
    """
    depth, whole = np.full(len(shots.range_m), np.nan), np.zeros(len(some))
    _depths(
        np.ascontiguousarray(shots.origin_m, np.float64),
        np.ascontiguousarray(shots.direction, np.float64),
        np.asarray(shots.first, np.int64),
        np.asarray(shots.range_m, np.float64),
        some,
        np.asarray(g, np.float64),
        np.nan_to_num(np.ascontiguousarray(density.to_numpy(), np.float64), nan=0.0),
        np.asarray(corner_m, np.float64),
        float(size_m),
        depth,
        whole,
    )
    return depth, whole


@njit(cache=True, parallel=True)
def _depths(origin, direction, first, range_m, some, g, density, corner, size, depth, whole):
    """Follow beams from voxel to voxel; no two beams write to the same place."""
    shape = np.array(density.shape)
    for n in prange(len(some)):
        i = some[n]
        inverse, facet, index = np.empty(3), np.empty(3), np.empty(3, np.int64)
        j, end = first[i], first[i + 1]
        near, far = entry_and_exit(origin[i], direction[i], corner, shape, size)
        total = 0.0
        if near < far:
            start_march(origin[i], direction[i], corner, shape, size, near, inverse, index, facet)
            while True:
                k = nearest_facet(facet)
                leave = max(facet[k], near)
                sigma = g[n] * density[index[0], index[1], index[2]]
                while j < end and range_m[j] < leave:
                    depth[j] = total + sigma * max(range_m[j] - near, 0.0)
                    j += 1
                total += sigma * (leave - near)
                near = leave
                index[k] += 1 if inverse[k] > 0.0 else -1
                if index[k] < 0 or index[k] >= shape[k]:
                    break
                facet[k] = next_facet(origin[i], inverse, corner, size, index[k], k)
        while j < end:
            depth[j] = total
            j += 1
        whole[n] = total


def _hazard(
    shots: Shots,
    some: np.ndarray,
    kind: np.ndarray,
    depth: np.ndarray,
    whole: np.ndarray,
    n_bins: int,
) -> tuple[np.ndarray, np.ndarray]:
    """Leaf hits per optical depth travelled, by bins of depth; and the bins' edges."""
    n_returns = shots.n_returns[some]
    misses = n_returns == 0
    wanted = np.isfinite(depth)
    share = np.repeat(1.0 / np.maximum(n_returns, 1), n_returns)
    inside = np.repeat(whole > 1e-6, n_returns)
    ends = np.concatenate([depth[wanted][inside], whole[misses & (whole > 1e-6)]])
    weight = np.concatenate([share[inside], np.ones(int((misses & (whole > 1e-6)).sum()))])
    is_hit = np.zeros(len(ends), bool)
    is_hit[: int(inside.sum())] = kind[wanted][inside] == HIT
    # Bins of equal numbers of hits: where hits are few, rates would be noise.
    hits = np.sort(ends[is_hit])
    if len(hits) < 10:
        return np.ones(1), np.array([0.0, np.inf])
    edges = np.unique(np.quantile(hits, np.linspace(0, 1, n_bins + 1)))
    edges = np.unique(np.concatenate([[0.0], edges[1:-1], [max(whole.max(), hits[-1]) + 1e-9]]))
    number = np.clip(np.searchsorted(edges, ends[is_hit], side="right") - 1, 0, len(edges) - 2)
    events = np.bincount(number, weight[is_hit], len(edges) - 1)
    order = np.argsort(ends)
    ends, weight = ends[order], weight[order]
    left = np.concatenate([np.cumsum(weight[::-1])[::-1], [0.0]])
    moved = np.concatenate([[0.0], np.cumsum(weight * ends)])
    at = np.searchsorted(ends, edges)
    # Travelled up to depth e: those that ended before, and e for each that went on.
    travelled = moved[at] + left[at] * edges
    exposure = np.diff(travelled)
    return np.divide(events, exposure, out=np.ones_like(events), where=exposure > 0), edges


def _matching(depth: np.ndarray, mean: float) -> float:
    """The factor at which exp(-factor·depth) has the given mean; by bisection."""
    low, high = 0.0, 20.0
    if mean <= np.exp(-high * depth).mean():
        return high
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if np.exp(-middle * depth).mean() > mean else (low, middle)
    return 0.5 * (low + high)
