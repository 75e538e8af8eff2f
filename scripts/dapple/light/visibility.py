"""The share of the sun's disc that sensors see through the day, to a given standard error."""

from dataclasses import dataclass

import numpy as np

from dapple.light.rays_to_sky import sun_rays
from dapple.scene.traced import TracedScene

FIRST_RAYS = 32
"""Rays of each replicate in the first round; each further round doubles what was traced."""
PRIOR_WEIGHT = 8.0
"""Degrees of freedom that the pooled variance stands for when a pair's own variance is judged."""


@dataclass(frozen=True)
class Sunlit:
    """What sensors see of the sun.

    Attributes
    ----------
    share : (r, n, t) float64
        Share of the disc that is seen, in independent replicates; with voxels the transmittance.
    standard_error : (n, t) float64
        Of the mean over replicates.
    n_rays : (n, t) int64
        Rays of each replicate.
    """

    share: np.ndarray
    standard_error: np.ndarray
    n_rays: np.ndarray


def sunlit(
    scene: TracedScene,
    sensors_m: np.ndarray,
    sun_directions: np.ndarray,
    *,
    tolerance: float,
    max_rays: int,
    seed: int,
    sun_diameter_deg: float,
    n_replicates: int = 8,
    aperture_m: float = 0.0,
) -> Sunlit:
    """Trace shadow rays to the sun's disc, more of them where it is partly hidden.

    Parameters
    ----------
    scene : TracedScene
        The ground does not matter.
    sensors_m : (n, 3) float64
        Local frame [m].
    sun_directions : (t, 3) float64
        Unit vectors towards the middle of the sun; below the horizon nothing is seen.
    tolerance : float
        Rays are added until the standard error is smaller, as a share of the disc.
    max_rays : int
        Most rays of a sensor at a time, of all replicates.
    seed : int
        Shifts the pattern of each sensor, time and replicate.
    sun_diameter_deg : float
        Angular diameter of the disc [deg].
    n_replicates : int
        Independent sets of rays, at least 2.
    aperture_m : float
        Diameter of the sensors' level receiving discs [m].

    Returns
    -------
    Sunlit
        The same for the same seed, whatever the number of threads.
    """
    n, t = len(sensors_m), len(sun_directions)
    up = np.flatnonzero(np.tile(sun_directions[:, 2] > 0, n))
    total, square = np.zeros((n * t, n_replicates)), np.zeros(n * t)
    done = np.zeros(n * t, np.int64)
    error = np.zeros(n * t)
    # A point and a parallel beam leave nothing to chance.
    exact = sun_diameter_deg == 0 and aperture_m == 0
    most = 1 if exact else max(-(-max_rays // n_replicates), 1)
    unseen = float(scene.meshes is not None)
    trace = sun_rays(
        scene,
        sensors_m,
        sun_directions,
        sun_diameter_deg=sun_diameter_deg,
        aperture_m=aperture_m,
        seed=seed,
    )
    pairs, rays = up, min(FIRST_RAYS, most)
    before = 0
    while len(pairs) and before < rays:
        sums, squares = trace(pairs, n_replicates, before, rays - before)
        total[pairs] += sums
        square[pairs] += squares
        done[pairs] = rays
        share, every = total[pairs] / rays, rays * n_replicates
        spread = np.maximum(square[pairs] / every - share.mean(axis=1) ** 2, 0)
        error[pairs] = _standard_error(share, spread, every, unseen)
        pairs = pairs[error[pairs] > tolerance]
        before, rays = rays, min(2 * rays, most)
    share = total / np.maximum(done, 1)[:, None]
    return Sunlit(
        np.moveaxis(share.reshape(n, t, n_replicates), 2, 0),
        (error * (not exact)).reshape(n, t),
        done.reshape(n, t),
    )


def _standard_error(
    share: np.ndarray, spread: np.ndarray, n_rays: int, unseen: float
) -> np.ndarray:
    """Standard error of the means of replicates, steadied by that of all pairs together.

    Parameters
    ----------
    share : (m, r) float64
        Means of replicates.
    spread : (m,) float64
        Variance of single rays: p (1 - p) where they hit or miss.
    n_rays : int
        Of all replicates together.
    unseen : float
        1 where leaves may be missed by all rays, which then have no variance (Laplace's rule of
        succession gives 1 / n), 0 where nothing is hidden.

    Returns
    -------
    (m,) float64
        Patterns are no better than chance where less than one ray a replicate differs from the
        rest. Elsewhere they are, by a factor that all pairs share: this pooled variance and the
        pair's own, a rough guess from few replicates, are averaged with their degrees of freedom.
    """
    n_replicates = share.shape[1]
    random = (spread + unseen / n_rays) / n_rays
    own = share.var(axis=1, ddof=1) / n_replicates
    many = spread * n_rays > n_replicates
    factor = min(own[many].sum() / random[many].sum(), 1.0) if many.any() else 1.0
    freedom = n_replicates - 1
    steadied = (PRIOR_WEIGHT * factor * random + freedom * own) / (PRIOR_WEIGHT + freedom)
    return np.sqrt(np.where(many, steadied, random))
