"""Leaf or wood by reflectance: water absorbs at 1550 nm, so that leaves are darker than bark."""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from sklearn.mixture import GaussianMixture

from dapple.errors import InputError
from dapple.formats.clouds import Cloud

MIN_SEPARATION = 2.0
"""Ashman's D above which two normal distributions are seen as two (Ashman et al. 1994)."""

MIN_SHARE = 0.01
"""A component with less of the points than this is a tail, not a class."""


@dataclass(frozen=True)
class Threshold:
    """Where two normal distributions of reflectance part.

    Attributes
    ----------
    threshold_db : float
        Between the means both components are equally likely here [dB].
    separation : float
        Ashman's D: difference of the means over the root mean square of the standard
        deviations; above 2 the two are distinct.
    mean_db, sd_db, share : (2,) float64
        Of the darker and of the brighter component.
    """

    threshold_db: float
    separation: float
    mean_db: np.ndarray
    sd_db: np.ndarray
    share: np.ndarray


class NotSeparableWarning(UserWarning):
    """The reflectances do not show two classes clearly."""


def fixed_threshold(
    cloud: Cloud, settings: Mapping[str, Any], seed: int
) -> tuple[np.ndarray, dict[str, float]]:
    """Leaves are the points at or below `threshold_db`; see `classifiers.Method`."""
    threshold_db = settings["threshold_db"]
    leaf = by_reflectance(cloud.attributes["Reflectance"], threshold_db)
    return leaf, {"threshold_db": threshold_db}


def own_threshold(
    cloud: Cloud, settings: Mapping[str, Any], seed: int
) -> tuple[np.ndarray, dict[str, float]]:
    """Leaves are the points at or below the threshold that parts the data themselves."""
    reflectance_db = cloud.attributes["Reflectance"]
    found = find_threshold(reflectance_db, seed=seed)
    facts = {"threshold_db": found.threshold_db, "ashman_d": found.separation}
    return by_reflectance(reflectance_db, found.threshold_db), facts


def by_reflectance(reflectance_db: np.ndarray, threshold_db: float = -5.4) -> np.ndarray:
    """Leaves are the points at or below a reflectance.

    Leaf water absorbs at 1550 nm, so that leaves are darker than bark; -5.4 dB is the threshold
    of Frey et al. (2025), Silva Fennica 59, 24027, for a RIEGL VZ-400i.

    Parameters
    ----------
    reflectance_db : (n,) array
        Range-corrected reflectance [dB].
    threshold_db : float
        Brighter points are wood [dB].

    Returns
    -------
    (n,) bool
        Whether it is a leaf.

    Raises
    ------
    InputError
        A reflectance is not a number: such a point is neither.
    """
    unknown = int(np.count_nonzero(np.isnan(reflectance_db)))
    if unknown:
        raise InputError(
            "Reflectance",
            f"{unknown} points without a value",
            "a reflectance in dB for every point",
            "Filter the cloud by reflectance first, or classify by geometry.",
        )
    return np.asarray(reflectance_db) <= threshold_db


def find_threshold(
    reflectance_db: np.ndarray, *, seed: int = 0, max_points: int = 200_000
) -> Threshold:
    """Find the reflectance that parts leaf and wood from the data themselves.

    Two normal distributions are fitted to the decibels; the threshold lies where a point between
    their means belongs to either with the same probability.

    Parameters
    ----------
    reflectance_db : (n,) array
        Reflectance [dB]; NaN does not count.
    seed : int
        Draws the points that are fitted, where there are more than `max_points`.
    max_points : int
        Number of points that are fitted at most.

    Returns
    -------
    Threshold

    Warns
    -----
    NotSeparableWarning
        Ashman's D is at or below 2: the components overlap so much that the threshold is weak.

    Raises
    ------
    InputError
        There is no threshold: too few values, or one component swallows the other.
    """
    values = np.asarray(reflectance_db, np.float64)
    values = values[np.isfinite(values)]
    if len(values) < 100 or np.ptp(values) == 0:
        raise _no_threshold(f"{len(values)} values, {len(np.unique(values))} of them different")
    if len(values) > max_points:
        values = np.random.default_rng(seed).choice(values, max_points, replace=False)
    start = np.percentile(values, [15, 85])[:, None]
    fit = GaussianMixture(2, means_init=start, random_state=0, max_iter=500).fit(values[:, None])
    order = np.argsort(fit.means_.ravel())
    mean, share = fit.means_.ravel()[order], fit.weights_[order]
    sd = np.sqrt(fit.covariances_.ravel()[order])
    separation = np.sqrt(2) * (mean[1] - mean[0]) / np.hypot(*sd)
    crossing = _crossing(mean, sd, share)
    if crossing is None or share.min() < MIN_SHARE:
        raise _no_threshold(
            f"components at {mean[0]:.2f} and {mean[1]:.2f} dB with shares "
            f"{share[0]:.3f} and {share[1]:.3f}, one inside the other"
        )
    if separation <= MIN_SEPARATION:
        warnings.warn(
            f"Reflectance: Ashman's D of the two components is {separation:.2f}, at or below "
            f"{MIN_SEPARATION}; leaf and wood overlap and the threshold {crossing:.2f} dB is weak. "
            "Compare it with a known one or classify by geometry.",
            NotSeparableWarning,
            stacklevel=2,
        )
    return Threshold(crossing, float(separation), mean, sd, share)


def _crossing(mean: np.ndarray, sd: np.ndarray, share: np.ndarray) -> float | None:
    """Where share × density of both normal distributions is equal between their means."""
    weight = np.log(share / sd)
    roots = np.roots(
        [
            0.5 / sd[1] ** 2 - 0.5 / sd[0] ** 2,
            mean[0] / sd[0] ** 2 - mean[1] / sd[1] ** 2,
            0.5 * (mean[1] / sd[1]) ** 2 - 0.5 * (mean[0] / sd[0]) ** 2 + weight[0] - weight[1],
        ]
    )
    between = [r.real for r in roots if abs(r.imag) < 1e-9 and mean[0] < r.real < mean[1]]
    return float(between[0]) if len(between) == 1 else None


def _no_threshold(found: str) -> InputError:
    return InputError(
        "Reflectance",
        found,
        "two overlapping but distinct groups, leaf and wood",
        "Give a threshold in dB, or classify by geometry.",
    )
