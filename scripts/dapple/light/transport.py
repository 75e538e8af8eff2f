"""Light for any sky, spectrum and time from paths that were traced once.

Paths are counted by sensor, sky patch and what they met. The counts are integers, so that they do
not depend on the order of threads. A sky is a radiance per patch, a spectrum a factor per event:
light at every time and in every band is a product of the counts with both.
"""

from dataclasses import dataclass

import numpy as np
from scipy import sparse

from dapple.light.patches import Patches, patches
from dapple.light.paths import trace
from dapple.light.scene import Optics
from dapple.light.traced import TracedScene
from dapple.streams import stream_seed

N_REPLICATES = 8
"""Independent sets of paths; their spread gives the standard error."""


@dataclass(frozen=True)
class Transport:
    """Counted paths of every sensor.

    Attributes
    ----------
    sensor, replicate, patch : (k,) int32
        Where a path started, in which independent set, and in which sky patch it left.
    orders : (k, 4) uint8
        Leaf reflections a, leaf transmissions b, bark and ground reflections.
    count : (k,) int64
        Paths of this kind.
    n_paths : (n_sensors,) int64
        Paths started from each sensor in each replicate.
    n_patches : int
        Subdivision of the sky.
    n_cut : int
        Paths that were given up at the limit of orders, of all sensors.
    """

    sensor: np.ndarray
    replicate: np.ndarray
    patch: np.ndarray
    orders: np.ndarray
    count: np.ndarray
    n_paths: np.ndarray
    n_patches: int
    n_cut: int


def collect(
    scene: TracedScene,
    sensors_m: np.ndarray,
    *,
    n_paths: int,
    n_patches: int,
    max_orders: int,
    seed: int,
    aperture_m: float = 0.0,
) -> Transport:
    """Trace `n_paths` from each sensor, in equal parts for every replicate, and count them."""
    per_replicate = -(-n_paths // N_REPLICATES)
    sky = patches(n_patches)
    parts, n_cut = [], 0
    for replicate in range(N_REPLICATES):
        paths = trace(
            scene,
            sensors_m,
            per_replicate,
            max_orders=max_orders,
            seed=stream_seed(seed, "paths", replicate),
            aperture_m=aperture_m,
        )
        n_cut += paths.n_cut
        above = sky.index(paths.direction)
        # A path may leave a scene without ground downwards, where there is no light.
        up = above >= 0
        parts.append(_count(paths.start[up], replicate, above[up], paths.orders[up]))
    sensor, replicate, patch, orders, count = (
        np.concatenate([part[k] for part in parts]) for k in range(5)
    )
    started = np.full(len(sensors_m), per_replicate)
    return Transport(sensor, replicate, patch, orders, count, started, n_patches, n_cut)


def _count(sensor, replicate, patch, orders):
    """Paths of the same sensor, patch and orders as one row with their number."""
    key = sensor.astype(np.int64) << 47 | patch.astype(np.int64) << 32
    for column in range(4):
        key |= orders[:, column].astype(np.int64) << 8 * column
    key, count = np.unique(key, return_counts=True)
    unpacked = np.stack([key >> 8 * column & 255 for column in range(4)], axis=1)
    return (
        (key >> 47).astype(np.int32),
        np.full(len(key), replicate, np.int32),
        (key >> 32 & 0x7FFF).astype(np.int32),
        unpacked.astype(np.uint8),
        count,
    )


def spectral_factor(orders: np.ndarray, optics: Optics) -> np.ndarray:
    """What is left of light after the events of a path.

    Parameters
    ----------
    orders : (k, 4) uint8
        Leaf reflections, leaf transmissions, bark and ground reflections.
    optics : Optics
        In b bands.

    Returns
    -------
    (k, b) float64
        2^(a + b) ρ^a τ^b ρ_bark^c ρ_ground^d; the powers of two undo the even choice between
        reflection and transmission.
    """
    bases = (
        2 * optics.leaf_reflectance,
        2 * optics.leaf_transmittance,
        optics.bark_reflectance,
        optics.ground_reflectance,
    )
    factor = np.ones((len(orders), len(optics.wavelength_nm)))
    for column, base in enumerate(bases):
        factor *= base[None, :] ** orders[:, column, None]
    return factor


def irradiance(
    transport: Transport, radiance: np.ndarray, optics: Optics, *, scattered: bool
) -> np.ndarray:
    """Irradiance at the sensors under a sky.

    Parameters
    ----------
    transport : Transport
        Counted paths.
    radiance : (t, p) float64
        Radiance of every sky patch at every time, equal in all bands [per sr].
    optics : Optics
        Spectra in b bands.
    scattered : bool
        True: light that met something. False: light straight from the sky, equal in all bands.

    Returns
    -------
    (n_sensors, replicates, t, b) float64
        In units of the radiance times sr; b is 1 for unscattered light.
    """
    met = transport.orders.any(axis=1)
    chosen = met if scattered else ~met
    kinds, kind = np.unique(transport.orders[chosen], axis=0, return_inverse=True)
    factor = spectral_factor(kinds, optics) if scattered else np.ones((len(kinds), 1))
    n_sensors = len(transport.n_paths)
    result = np.zeros((n_sensors, N_REPLICATES, len(radiance), factor.shape[1]))
    if not len(kinds):
        return result
    sensor = transport.sensor[chosen]
    row = transport.replicate[chosen] * len(kinds) + kind.ravel()
    weight = np.pi * transport.count[chosen] / transport.n_paths[sensor]
    by_sensor = np.argsort(sensor, kind="stable")
    bounds = np.searchsorted(sensor[by_sensor], np.arange(n_sensors + 1))
    for index in range(n_sensors):
        mine = by_sensor[bounds[index] : bounds[index + 1]]
        counted = sparse.csr_array(
            (weight[mine], (row[mine], transport.patch[chosen][mine])),
            shape=(N_REPLICATES * len(kinds), transport.n_patches),
        )
        by_kind = (counted @ radiance.T).reshape(N_REPLICATES, len(kinds), -1)
        result[index] = np.einsum("rkt,kb->rtb", by_kind, factor, optimize=True)
    return result


def sun_radiance(sun_directions: np.ndarray, sky: Patches, *, kernel_deg: float) -> np.ndarray:
    """Spread a beam of unit normal irradiance over the patches around the sun.

    Scattered light changes little with the direction from which the beam comes, so that the paths
    of neighbouring patches tell it with less noise than those of one patch.

    Parameters
    ----------
    sun_directions : (t, 3) float64
        Unit vectors towards the sun.
    sky : Patches
        Subdivision of the sky.
    kernel_deg : float
        Standard deviation of the von Mises-Fisher kernel [deg].

    Returns
    -------
    (t, p) float64
        Radiance that sums to 1 with the solid angles; zero for a sun below the horizon.
    """
    cosine = sun_directions @ sky.directions.T
    weight = np.exp((cosine - 1) / np.radians(kernel_deg) ** 2)
    weight /= (weight * sky.solid_angle_sr).sum(axis=1, keepdims=True)
    return np.where(sun_directions[:, 2:] > 0, weight, 0.0)
