"""Fill cells that no beam reached from their neighbours, and say that they are filled."""

import numpy as np
from scipy.spatial import cKDTree

from dapple.errors import InputError


def krige(
    values: np.ndarray,
    standard_error: np.ndarray,
    *,
    cell_size_m: float,
    range_m: float = 2.0,
    neighbours: int = 16,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Ordinary kriging of unknown cells, donors having known errors.

    Parameters
    ----------
    values : (nx, ny, nz) float64
        Density; NaN where unknown.
    standard_error : (nx, ny, nz) float64
        Of the known densities; its square is the donors' variance.
    cell_size_m : float
        Edge of a cell [m].
    range_m : float
        Covariance falls as exp(-distance/range) [m].
    neighbours : int
        Nearest known cells that a cell is made of.

    Returns
    -------
    filled : (nx, ny, nz) float64
        Known values as they were; the others filled, none below 0.
    error : (nx, ny, nz) float64
        Standard error: the donors' own, or that of kriging.
    is_filled : (nx, ny, nz) bool

    Raises
    ------
    InputError
        Fewer than three cells are known.

    Notes
    -----
    Kriging with known error variances of the data: Delhomme (1978), Advances in Water Resources 1,
    251-266. The sill is the variance of known values less their mean error variance.
    """
    known = np.isfinite(values)
    if known.sum() < 3:
        raise InputError(
            "survey.density_step_deg",
            f"{known.sum()} known cells",
            "at least three",
            "Scan with more beams or from more positions.",
        )
    place = np.argwhere(known) * cell_size_m
    donors = values[known]
    noise = np.nan_to_num(standard_error[known] ** 2)
    sill = max(donors.var() - min(noise.mean(), 0.9 * donors.var()), 1e-9)
    filled, error = values.copy(), standard_error.copy()
    targets = np.argwhere(~known) * cell_size_m
    if len(targets):
        k = min(neighbours, len(donors))
        estimate, variance = _solve(place, donors, noise, targets, k, sill, range_m)
        filled[~known], error[~known] = np.maximum(estimate, 0.0), np.sqrt(variance)
    return filled, error, ~known


def _solve(place, donors, noise, targets, k, sill, range_m):
    """Estimates and variances at the targets, from k neighbours each, all systems at once."""
    distance, near = cKDTree(place).query(targets, k=k)
    apart = np.linalg.norm(place[near][:, :, None] - place[near][:, None], axis=-1)
    system = np.ones((len(targets), k + 1, k + 1))
    system[:, :k, :k] = sill * np.exp(-apart / range_m)
    system[:, np.arange(k), np.arange(k)] += noise[near] + 1e-9 * sill
    system[:, k, k] = 0.0
    right = np.ones((len(targets), k + 1))
    right[:, :k] = sill * np.exp(-distance / range_m)
    weights = np.linalg.solve(system, right[..., None])[..., 0]
    estimate = (weights[:, :k] * donors[near]).sum(axis=1)
    variance = sill - (weights * right).sum(axis=1)
    return estimate, np.maximum(variance, 0.0)
