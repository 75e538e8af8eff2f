"""The share of the sun's disc that sensors see through the day, to a given standard error."""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from dapple.light import patterns
from dapple.light.traced import TracedScene

RAYS_PER_KERNEL = 1 << 22
"""Bounds memory: a ray takes about 100 bytes."""
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
    n_replicates: int = 8,
    sun_diameter_deg: float = 0.533,
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
    n_replicates : int
        Independent sets of rays, at least 2.
    sun_diameter_deg : float
        Angular diameter of the disc [deg].
    aperture_m : float
        Diameter of the sensors' level receiving discs [m].

    Returns
    -------
    Sunlit
        The same for the same seed, whatever the number of threads.
    """
    n, t = len(sensors_m), len(sun_directions)
    up = np.flatnonzero(np.tile(sun_directions[:, 2] > 0, n))
    total = np.zeros((n * t, n_replicates))
    done = np.zeros(n * t, np.int64)
    error = np.zeros(n * t)
    # A point and a parallel beam leave nothing to chance.
    exact = sun_diameter_deg == 0 and aperture_m == 0
    most = 1 if exact else max(-(-max_rays // n_replicates), 1)
    trace = _tracer(scene, sensors_m, sun_directions, sun_diameter_deg, aperture_m, seed)
    pairs, rays = up, min(FIRST_RAYS, most)
    before = 0
    while len(pairs) and before < rays:
        total[pairs] += trace(pairs, n_replicates, before, rays - before)
        done[pairs] = rays
        error[pairs] = _standard_error(total[pairs] / rays, rays * n_replicates)
        pairs = pairs[error[pairs] > tolerance]
        before, rays = rays, min(2 * rays, most)
    share = total / np.maximum(done, 1)[:, None]
    return Sunlit(
        np.moveaxis(share.reshape(n, t, n_replicates), 2, 0),
        (error * (not exact)).reshape(n, t),
        done.reshape(n, t),
    )


def _standard_error(share: np.ndarray, n_rays: int) -> np.ndarray:
    """Standard error of the means of replicates (m, r), steadied by that of all pairs together.

    A pair's own variance from few replicates is a rough guess, and nought where all rays of a
    hardly lit sensor happen to be stopped. Rays that hit or miss at random have the variance
    p (1 - p) / n; patterns do better by a factor that all pairs share. The pooled variance and
    the pair's own are averaged with their degrees of freedom.
    """
    n_replicates = share.shape[1]
    seen = (share.mean(axis=1) * n_rays + 0.5) / (n_rays + 1)
    random = seen * (1 - seen) / n_rays
    own = share.var(axis=1, ddof=1) / n_replicates
    pooled = random * min(own.sum() / random.sum(), 1.0)
    freedom = n_replicates - 1
    return np.sqrt((PRIOR_WEIGHT * pooled + freedom * own) / (PRIOR_WEIGHT + freedom))


def _tracer(
    scene, sensors_m, sun_directions, sun_diameter_deg: float, aperture_m: float, seed: int
):
    """A function that traces rays of pairs of sensor and time and returns their sums (m, r)."""
    mi = scene.mi
    points, axes = (
        [mi.Float(np.ascontiguousarray(vectors[:, k], np.float32)) for k in range(3)]
        for vectors in (np.asarray(sensors_m), np.asarray(sun_directions))
    )
    radius = dr.opaque(mi.Float, float(np.sin(np.radians(0.5 * sun_diameter_deg))))
    half_aperture = dr.opaque(mi.Float, 0.5 * aperture_m)
    n_times = dr.opaque(mi.UInt32, len(sun_directions))
    key = dr.opaque(mi.UInt32, seed)
    dimensions = 4 if aperture_m else 2

    def trace(pairs: np.ndarray, n_replicates: int, first: int, n_rays: int) -> np.ndarray:
        pattern = patterns.kronecker(first + n_rays, dimensions)[first:]
        pattern = [mi.Float(np.ascontiguousarray(p, np.float32)) for p in pattern.T]
        per_ray = dr.opaque(mi.UInt32, n_rays)
        per_pair = dr.opaque(mi.UInt32, n_rays * n_replicates)
        replicates = dr.opaque(mi.UInt32, n_replicates)
        sums = np.empty((len(pairs), n_replicates))
        step = max(1, RAYS_PER_KERNEL // (n_rays * n_replicates))
        for low in range(0, len(pairs), step):
            block = pairs[low : low + step]
            index = dr.arange(mi.UInt32, len(block) * n_replicates * n_rays)
            pair = dr.gather(mi.UInt32, mi.UInt32(block.astype(np.uint32)), index // per_pair)
            sensor, time = pair // n_times, pair % n_times
            set_ = pair * replicates + index // per_ray % replicates
            u = _shifted(mi, pattern, index % per_ray, set_, key)
            axis = mi.Vector3f(*(dr.gather(mi.Float, a, time) for a in axes))
            start = mi.Point3f(*(dr.gather(mi.Float, a, sensor) for a in points))
            x, y = _disc(mi, u[0], u[1])
            way = mi.Frame3f(axis).to_world(mi.Vector3f(radius * x, radius * y, 1.0))
            if aperture_m:
                x, y = _disc(mi, u[2], u[3])
                start += half_aperture * mi.Vector3f(x, y, 0.0)
            way = dr.normalize(way)
            seen = scene.transmittance(start, way, way.z > 0)
            sums[low : low + step] = np.array(dr.block_sum(seen, n_rays)).reshape(-1, n_replicates)
        return sums

    return trace


def _shifted(mi, pattern, ray, item, key) -> list:
    """Pattern points with a random shift that belongs to the item."""
    words = mi.sample_tea_32(item, key)
    words = (*words, *mi.sample_tea_32(*words)) if len(pattern) > 2 else words
    points = [
        dr.gather(mi.Float, column, ray) + mi.Float(word) * 2.0**-32
        for column, word in zip(pattern, words, strict=True)
    ]
    return [point - dr.floor(point) for point in points]


def _disc(mi, u, v):
    """Even points of the disc of radius 1."""
    sine, cosine = dr.sincos(dr.two_pi * v)
    radius = dr.sqrt(u)
    return radius * cosine, radius * sine
