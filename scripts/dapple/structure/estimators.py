"""Plant area density of a voxel from the sums of the shots that entered it.

Attenuation k [m⁻¹] is PAD·G, and G may differ from shot to shot. So lengths are taken as optical
paths u = G·length, and every estimator gives plant area density at once.

Only the free path estimators stay right where wood stands in a voxel: they know how far each beam
came. The others know of a hit the path through the whole voxel, not the wood that may have stood
behind it, and come out too low.

Two estimators need more than sums: an equation over the path lengths of all shots. It is
solved from the moments of path length (`path_nodes`), which are sums again: a few path lengths
with weights stand for all of them, exact for every polynomial below the number of moments.
"""

import math

import numpy as np
from numba import njit, prange

from dapple.errors import InputError

LARGEST_OPTICAL_DEPTH = 30.0
"""Of the cap along the diagonal of a voxel; beyond it nothing passes and moments lose digits."""

_TOLERANCE, _MOST_MOMENTS = 1e-10, 40


def n_moments(depth: float) -> int:
    """Fewest moments that hold e⁻ˣ and x/(eˣ - 1) to 1e-10 for x between 0 and `depth`.

    Parameters
    ----------
    depth : float
        Greatest PAD times longest optical path in a voxel.

    Raises
    ------
    InputError
        The depth is above `LARGEST_OPTICAL_DEPTH`.
    """
    if depth > LARGEST_OPTICAL_DEPTH:
        raise InputError(
            "voxels.max_pad_m2_m3",
            f"an optical depth of {depth:.0f} along the diagonal of a voxel",
            f"at most {LARGEST_OPTICAL_DEPTH:.0f}",
            "Lower the cap of plant area density or take smaller voxels.",
        )
    fine = np.linspace(-1, 1, 401)
    for count in range(4, _MOST_MOMENTS):
        nodes = _chebyshev(count)
        error = 0.0
        for function in (lambda x: np.exp(-x), _bose):
            fit = np.polynomial.chebyshev.Chebyshev.fit(
                nodes, function(0.5 * depth * (nodes + 1)), count - 1, domain=[-1, 1]
            )
            error = max(error, np.abs(fit(fine) - function(0.5 * depth * (fine + 1))).max())
        if error < _TOLERANCE:
            return count
    return _MOST_MOMENTS


def path_nodes(moments: np.ndarray, u_max: float) -> tuple[np.ndarray, np.ndarray]:
    """Path lengths and weights that have the given moments.

    Parameters
    ----------
    moments : (v, m) float64
        Σ b·tʲ for j below m, with t = 2u/u_max - 1 and b the weight of each path.
    u_max : float
        Longest optical path.

    Returns
    -------
    u : (m,) float64
        Chebyshev nodes in 0..u_max.
    weight : (v, m) float64
        Single weights may be negative; only sums over smooth functions have a meaning.
    """
    nodes = _chebyshev(moments.shape[1])
    powers = nodes[None, :] ** np.arange(len(nodes))[:, None]
    return 0.5 * u_max * (nodes + 1), np.linalg.solve(powers, moments.T).T


def free_path(
    hits: np.ndarray, hit_free: np.ndarray, free: np.ndarray, entering: np.ndarray, n: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimate PAD from free path lengths.

    Parameters
    ----------
    hits, entering : (v,) float64
        Sum of the weights of leaf hits, and of all free paths.
    hit_free, free : (v,) float64
        Sum of weight times optical free path, of leaf hits and of all.
    n : (v,) float64
        Number of shots that entered.

    Returns
    -------
    corrected, biased, standard_error : (v,) float64
        [m² m⁻³]. The standard error is that of sampling by a finite number of beams, the bound of
        Cramér and Rao that the corrected estimator reaches, √(I/N)/mean free path with I the share
        intercepted. It does not hold the chance by which few elements lie where they do. Without
        any hit it is that of a single one.

    Notes
    -----
    Pimont et al. (2018), Remote Sensing of Environment 215, 343-370: the maximum likelihood
    estimator on free paths, and its correction for bias.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        biased = np.where(hits > 0, hits / free, 0.0)
        corrected = np.maximum(biased - hit_free * entering / free**2 / n, 0.0)
        corrected = np.where(free > 0, corrected, biased)
        intercepted = np.maximum(hits / entering, 1 / n)
        error = np.sqrt(intercepted / n) * entering / free
    return corrected, biased, error


def contact_frequency(
    n_hit: np.ndarray, n_touched: np.ndarray, factor: np.ndarray, size_m: float
) -> np.ndarray:
    """Estimate PAD from the share of the sub-voxels visited that hold a leaf hit.

    Parameters
    ----------
    n_hit, n_touched : (v,)
        Number of sub-voxels with a leaf hit, and with any beam (n₁ and n₁ + n_p).
    factor : (v,) float64
        Mean of cosθ/G(θ) of the beams that visited them, θ from the vertical.
    size_m : float
        Edge of the sub-voxels.

    Returns
    -------
    (v,) float64
        [m² m⁻³]

    Notes
    -----
    Hosoi and Omasa (2006), IEEE TGRS 44, 3610-3618: the factor over the size, times n₁/(n₁ + n_p).
    It is a share of places, not of beams: it rises with the beams that visit a sub-voxel, until
    each that holds a leaf has been hit, and with the sub-voxels' size where this is not small
    against leaves. Level beams, whose cosθ is 0, count as if there were no leaf. Take it to
    compare with studies that used it; the other estimators know how far each beam came.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(n_hit > 0, factor / size_m * n_hit / n_touched, 0.0)


def transmittance(
    u: np.ndarray, weight: np.ndarray, hits: np.ndarray, entering: np.ndarray, max_pad: float
) -> np.ndarray:
    """Estimate PAD by Beer-Lambert: the one at which the beams lose what was intercepted.

    Solves Σ b·exp(-PAD·u) = Σ b - Σ hits over the paths of all shots.

    Parameters
    ----------
    u, weight
        Optical paths (m,) and their weights (v, m), see `path_nodes`: potential paths, or the path
        up to wood or noise for the part of a beam that these stopped.
    hits, entering : (v,) float64
        Weight of leaf hits; weight of everything that entered.
    max_pad : float
        The estimate where the solution is larger or where nothing passes [m² m⁻³].

    Returns
    -------
    (v,) float64
        [m² m⁻³], to a relative 1e-12 of the equation given.
    """
    return _solve(u, weight, hits, entering - hits, max_pad, False)


def potential_path(
    u: np.ndarray, hit_weight: np.ndarray, hits: np.ndarray, passing: np.ndarray, max_pad: float
) -> np.ndarray:
    """Estimate PAD by maximum likelihood on potential path lengths.

    Solves Σ_hits b·u/(exp(PAD·u) - 1) = Σ_passing b·u: each hit is known to lie somewhere on the
    beam's way through the voxel, not where.

    Parameters
    ----------
    u, hit_weight
        Potential optical paths (m,) of the hits and their weights (v, m), see `path_nodes`.
    hits, max_pad
        As in `transmittance`.
    passing : (v,) float64
        Sum of weight times optical path of what passes or stops at wood or noise.

    Returns
    -------
    (v,) float64
        [m² m⁻³]

    Notes
    -----
    Vincent, Pimont and Verley (2021), A note on PAD/LAD estimators implemented in AMAPVox 1.7,
    doi 10.23708/1AJNMP.
    """
    return _solve(u, hit_weight, hits, passing, max_pad, True)


def _chebyshev(count: int) -> np.ndarray:
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _bose(x: np.ndarray) -> np.ndarray:
    return np.divide(x, np.expm1(x), out=np.ones_like(x), where=x > 0)


@njit(cache=True)
def _residual(u, weight, k, constant, likelihood):
    """Value and slope of the equation at k; both equations start positive and fall."""
    value = -constant * (k if likelihood else 1.0)
    slope = -constant if likelihood else 0.0
    for i in range(len(u)):
        x = k * u[i]
        if not likelihood:
            y = weight[i] * math.exp(-x)
            value += y
            slope -= u[i] * y
        elif x < 1e-3:
            value += weight[i] * (1.0 - x / 2.0 + x * x / 12.0)
            slope += weight[i] * u[i] * (-0.5 + x / 6.0)
        else:
            y = x / math.expm1(x)
            value += weight[i] * y
            slope += weight[i] * u[i] * y * (1.0 - y * math.exp(x)) / x
    return value, slope


@njit(cache=True, parallel=True)
def _solve(u, weight, hits, constant, largest, likelihood):
    """Root of each voxel's equation between 0 and `largest`: Newton's, kept in a bracket."""
    result = np.zeros(len(hits))
    for v in prange(len(hits)):
        if hits[v] <= 0.0:
            continue
        low, high, k = 0.0, largest, 0.0
        if _residual(u, weight[v], largest, constant[v], likelihood)[0] >= 0.0:
            result[v] = largest
            continue
        for _ in range(200):
            value, slope = _residual(u, weight[v], k, constant[v], likelihood)
            if value >= 0.0:
                low = k
            else:
                high = k
            step = k - value / slope if slope < 0.0 else high
            new = step if low < step < high else 0.5 * (low + high)
            if abs(new - k) <= 1e-13 * new:
                break
            k = new
        result[v] = k
    return result
