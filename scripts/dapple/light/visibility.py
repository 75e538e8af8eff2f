"""The share of the sun's disc that sensors see through the day, to a given standard error."""

from dataclasses import dataclass

import numpy as np

from dapple.light.rays_to_sky import sun_rays
from dapple.progress import Progress
from dapple.scene.traced import TracedScene

FIRST_RAYS = 32
"""Rays of each replicate in the first round; each further round doubles what was traced."""
PRIOR_WEIGHT = 4.0
"""Degrees of freedom that the pooled variance stands for when a pair's own variance is judged."""
AGREEING = 0.125
"""Share of the tolerance that is left to pairs whose rays all agree. Such rays are cheap, and most
pairs are of this kind: what they may have missed is not to add to the error of the light."""


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
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
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
        Rays are added until the standard error is smaller, as a share of the disc; where all rays
        agree, until it is smaller than an eighth of it (`AGREEING`).
    max_rays : int
        Most rays of a sensor at a time, of all replicates.
    seed : int
        Shifts the pattern of each sensor, time and replicate.
    sun_diameter_deg : float
        Angular diameter of the disc [deg].
    n_replicates : int
        Independent sets of rays, at least 2.
    aperture_m : float
        Diameter of the sensors' receiving discs [m].
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level. The share of the disc that is seen does
        not depend on them where sensors are points.
    keys : (n,) uint32 or None
        Which random numbers each sensor draws; None: those of its place in the list.

    Returns
    -------
    Sunlit
        The same for the same seed, whatever the number of threads. What is found of a sensor does
        not depend on the others.
    """
    n, t = len(sensors_m), len(sun_directions)
    dimensions = 4 if aperture_m else 2
    up = np.flatnonzero(np.tile(sun_directions[:, 2] > 0, n))
    total, square = np.zeros((n * t, n_replicates)), np.zeros(n * t)
    done = np.zeros(n * t, np.int64)
    error = np.zeros(n * t)
    # A point and a parallel beam leave nothing to chance.
    exact = sun_diameter_deg == 0 and aperture_m == 0
    most = 1 if exact else max(-(-max_rays // n_replicates), 1)
    progress = Progress("rays to the sun's disc", len(up) * most * n_replicates)
    trace = sun_rays(
        scene,
        sensors_m,
        sun_directions,
        sun_diameter_deg=sun_diameter_deg,
        aperture_m=aperture_m,
        seed=seed,
        facing=facing,
        keys=keys,
        progress=progress,
    )
    pairs, rays = up, min(FIRST_RAYS, most)
    before = 0
    while len(pairs) and before < rays:
        sums, squares = trace(pairs, n_replicates, before, rays - before)
        total[pairs] += sums
        square[pairs] += squares
        done[pairs] = rays
        share, every = total[pairs] / rays, rays * n_replicates
        error[pairs] = _standard_error(share, square[pairs], every, pairs // t, dimensions)
        agree = share.mean(axis=1) % 1 == 0
        pairs = pairs[error[pairs] > np.where(agree, AGREEING * tolerance, tolerance)]
        before, rays = rays, min(2 * rays, most)
        # At most so many are left: every further round goes on with fewer pairs.
        progress.total = progress.done + len(pairs) * (most - before) * n_replicates
    progress.end()
    share = total / np.maximum(done, 1)[:, None]
    return Sunlit(
        np.moveaxis(share.reshape(n, t, n_replicates), 2, 0),
        (error * (not exact)).reshape(n, t),
        done.reshape(n, t),
    )


def _standard_error(
    share: np.ndarray, square: np.ndarray, n_rays: int, sensor: np.ndarray, dimensions: int
) -> np.ndarray:
    """Standard error of the means of replicates, steadied by that of a sensor's other times.

    Parameters
    ----------
    share : (m, r) float64
        Means of replicates.
    square : (m,) float64
        Sum of the squares of what single rays see, of all replicates.
    n_rays : int
        Of all replicates together.
    sensor : (m,) int
        Number of each pair's sensor.
    dimensions : int
        In which rays are spread: 2 on the sun's disc, 2 more on a sensor's aperture.

    Returns
    -------
    (m,) float64

    Notes
    -----
    Replicates are independent: their variance is right on the mean of many pairs, but a rough guess
    for one. It is averaged by degrees of freedom with that of single rays, times a factor by which
    the pattern is better than chance, which the pairs of a sensor share, and one pair more that
    is cut by an edge: of a d-dimensional pattern, n rays of which lie beyond it, that varies less
    than chance by n^(-1/d) (Mitchell 1996, Proceedings of SIGGRAPH, 277-280). What remains of
    doubt widens the error as in Student's distribution, by ν / (ν - 2) in its square.

    Where rays hit or miss and c of n differ from the rest, c at most as many as there are
    replicates, that says little: the pair may be lit a bit more or a bit less. Its error is what
    c / n misses of the share under Jeffreys' prior, in the mean square (c + 3/4) / n² for few of
    many rays (that prior: Brown, Cai and DasGupta 2001, Statistical Science 16, 101-133). So it is
    where none differs: a fleck between the rays leaves no trace in them.
    """
    n_replicates = share.shape[1]
    mean = share.mean(axis=1)
    spread = np.maximum(square / n_rays - mean**2, 0)
    chance = spread / n_rays
    own = share.var(axis=1, ddof=1) / n_replicates
    differ = np.minimum(mean, 1 - mean) * n_rays
    whole = np.abs(square - mean * n_rays) < 1e-4 * n_rays  # each ray sees all or nothing
    few = whole & (differ < n_replicates + 0.5)
    by_edge = chance * np.maximum(differ / n_replicates, 1.0) ** (-1 / dimensions)
    pairs, by_chance, at_edge, found = (
        np.bincount(sensor[~few], values[~few], sensor.max(initial=0) + 1)
        for values in (np.ones_like(own), chance, by_edge, own)
    )
    weight = 1 / np.maximum(pairs, 1)
    better = np.divide(
        found + weight * at_edge,
        (1 + weight) * by_chance,
        out=np.ones(len(found)),
        where=by_chance > 0,
    )
    chance *= np.minimum(better, 1.0)[sensor]
    own_freedom = n_replicates - 1
    freedom = PRIOR_WEIGHT + own_freedom
    steadied = (PRIOR_WEIGHT * chance + own_freedom * own) / (freedom - 2)
    return np.sqrt(np.where(few, (differ + 0.75) / n_rays**2, steadied))
