"""How far a prediction can be trusted: intervals, and bands unlike any that taught."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Interval:
    """A predictive interval as wide as errors were where predictions were alike.

    Attributes
    ----------
    edges : (k - 1,) float64
        Predictions between classes.
    width : (k,) float64
        Typical error within each.
    factor : float
        Half the interval is the width times this.
    level : float
        Share of truths that the interval should hold.
    """

    edges: np.ndarray
    width: np.ndarray
    factor: float
    level: float


def fit(
    prediction: np.ndarray,
    spread: np.ndarray,
    truth: np.ndarray,
    *,
    level: float = 0.9,
    n_classes: int = 10,
) -> Interval:
    """Set an interval on entries that taught nothing.

    Parameters
    ----------
    prediction, spread : (n,) float
        Mean and standard deviation of an ensemble.
    truth : (n,) float
        What it should have been.
    level : float
        Share of truths to hold, 0 to 1.
    n_classes : int
        Classes of prediction, of equally many entries, whose errors are described apart.

    Returns
    -------
    Interval

    Notes
    -----
    Split conformal prediction with normalised residuals (Lei et al. 2018): whatever the network,
    the interval holds the truth of new entries drawn like these as often as asked. Entries of
    other kinds, as real images are, may be held less often: measure it.
    """
    quantiles = np.linspace(0.0, 1.0, n_classes + 1)[1:-1]
    edges = np.unique(np.quantile(prediction, quantiles))
    of = np.searchsorted(edges, prediction, side="right")
    error = np.abs(truth - prediction)
    number = np.bincount(of, minlength=len(edges) + 1)
    squares = np.bincount(of, error**2, minlength=len(edges) + 1)
    whole = np.mean(error**2)
    width = np.sqrt(np.where(number > 0, squares / np.maximum(number, 1), whole))
    score = np.sort(error / _scale(width[of], spread))
    # Conformal rank: one more than n entries, so that a new one is among them.
    rank = min(int(np.ceil((len(score) + 1) * level)), len(score))
    return Interval(edges, width, float(score[rank - 1]), level)


def bounds(
    interval: Interval, prediction: np.ndarray, spread: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper end of the interval (n,) around ensemble means with their deviations."""
    of = np.searchsorted(interval.edges, np.nan_to_num(prediction), side="right")
    half = interval.factor * _scale(interval.width[of], spread)
    return prediction - half, prediction + half


def coverage(low: np.ndarray, high: np.ndarray, truth: np.ndarray) -> float:
    """Share of truths within their interval; NaN without any."""
    known = np.isfinite(low) & np.isfinite(truth)
    return float(np.mean(((low <= truth) & (truth <= high))[known])) if known.any() else np.nan


def _scale(width: np.ndarray, spread: np.ndarray) -> np.ndarray:
    return np.maximum(np.sqrt(width**2 + spread**2), 1e-9)


@dataclass(frozen=True)
class TrainingRange:
    """Where in the space of bands a network was taught.

    Attributes
    ----------
    mean, scale : (b,) float64
        Bands are shifted and divided by them.
    known : (m, b) float64
        Some entries that taught, scaled.
    limit : float
        Distance to the nearest of them that `quantile` of all entries keep.
    """

    mean: np.ndarray
    scale: np.ndarray
    known: np.ndarray
    limit: float


def training_range(
    features: np.ndarray,
    *,
    seed: int,
    quantile: float = 0.999,
    n_known: int = 20_000,
    n_probes: int = 20_000,
) -> TrainingRange:
    """Learn which bands are known.

    Parameters
    ----------
    features : (n, b) float
        Bands of entries that teach.
    seed : int
        Of the draw of known entries and probes.
    quantile : float
        Share of the entries that lie within the range.
    n_known, n_probes : int
        Entries that stand for all, and entries whose distance to them sets the limit.

    Returns
    -------
    TrainingRange

    Notes
    -----
    Distance to the nearest known entry, in standard deviations of the logarithm of bands: a curved
    cloud of points is described as it is, which one ellipsoid does not.
    """
    order = np.random.default_rng(seed).permutation(len(features))
    logs = _logs(features)
    mean, scale = logs.mean(axis=0), np.maximum(logs.std(axis=0), 1e-9)
    n = max(1, min(n_known, len(features) // 2))
    known = (logs[order[:n]] - mean) / scale
    probes = order[n : n + n_probes] if len(order) > n else order
    found = TrainingRange(mean, scale, known, np.inf)
    return TrainingRange(
        mean, scale, known, float(np.quantile(distance(found, features[probes]), quantile))
    )


def distance(taught: TrainingRange, features: np.ndarray) -> np.ndarray:
    """Distance (n,) to the nearest known entry; NaN where a band is NaN."""
    from scipy.spatial import cKDTree

    scaled = (_logs(features) - taught.mean) / taught.scale
    result = np.full(len(scaled), np.nan)
    there = np.isfinite(scaled).all(axis=1)
    result[there] = cKDTree(taught.known).query(scaled[there])[0]
    return result


def outside(taught: TrainingRange, features: np.ndarray) -> np.ndarray:
    """Whether bands (n, b) lie beyond the range; bands without data do."""
    return ~(distance(taught, features) <= taught.limit)


def _logs(features: np.ndarray) -> np.ndarray:
    return np.log(np.maximum(np.asarray(features, np.float64), 1e-4))
