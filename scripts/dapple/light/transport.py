"""Light for any sky, spectrum and time from paths that were traced once.

Paths are counted by sensor, sky patch and what they met. The counts are integers, so that they do
not depend on the order of threads. A sky is a radiance per patch, a spectrum a factor per event:
light at every time and in every band is a product of the counts with both.
"""

from collections.abc import Iterator
from dataclasses import dataclass, fields

import numpy as np
from scipy import sparse

from dapple.errors import InputError
from dapple.frames import direction_from_angles
from dapple.light.patches import Patches, patches
from dapple.light.paths import Paths, trace
from dapple.light.scene import Optics
from dapple.light.traced import TracedScene

N_REPLICATES = 16
"""Independent sets of paths; their spread gives the standard error."""
NOMINAL_SUNS_DEG = ((30, 0), (30, 120), (30, 240), (60, 60), (60, 180), (60, 300))
"""Zenith and azimuth of the suns under which a pilot is judged."""
NOMINAL_DIFFUSE_SHARE = 0.2
"""Of the light of the clear sky under which a pilot is judged."""


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
    cut : (n_sensors,) int64
        Paths that were given up at `max_orders`, of all replicates.
    n_replicates, n_patches, max_orders : int
        Independent sets, subdivision of the sky, most surfaces on a path.
    """

    sensor: np.ndarray
    replicate: np.ndarray
    patch: np.ndarray
    orders: np.ndarray
    count: np.ndarray
    n_paths: np.ndarray
    cut: np.ndarray
    n_replicates: int
    n_patches: int
    max_orders: int

    def truncated_share(self, optics: Optics) -> np.ndarray:
        """(n_sensors,) what could be lost at `max_orders`, as a share of an even open sky.

        An upper bound: every surface that a lost path met sends on at most the largest albedo.
        """
        leaf = optics.leaf_reflectance + optics.leaf_transmittance
        albedo = max(x.max() for x in (leaf, optics.bark_reflectance, optics.ground_reflectance))
        return self.cut / (self.n_paths * self.n_replicates) * albedo**self.max_orders


def collect(
    scene: TracedScene,
    sensors_m: np.ndarray,
    *,
    n_paths: int,
    n_patches: int,
    max_orders: int,
    seed: int,
    tolerance: float | None = None,
    max_paths: int | None = None,
    optics: Optics | None = None,
    sun_kernel_deg: float = 8.0,
    halved_after: int | None = None,
    aperture_m: float = 0.0,
    n_replicates: int = N_REPLICATES,
) -> Transport:
    """Trace paths from each sensor, in equal parts for every replicate, and count them.

    Parameters
    ----------
    scene : TracedScene
        What light meets.
    sensors_m : (n, 3) float64
        Level sensors that look up [m].
    n_paths : int
        Of each sensor at first.
    n_patches : int
        Subdivision of the sky: 1, 145, 577, 2305.
    max_orders : int
        Most surfaces on a path, at most 255.
    seed : int
        Of the random numbers.
    tolerance : float or None
        More paths are traced from sensors whose standard error under a nominal sky is larger, as a
        share of the open sky's light. None: `n_paths` are enough.
    max_paths : int or None
        Most paths of a sensor where there is a tolerance; None: 64 times `n_paths`.
    optics : Optics or None
        Typical optics by which the standard error is judged; needed where there is a tolerance.
    sun_kernel_deg : float
        See `sun_radiance`.
    halved_after, aperture_m
        See `paths.trace`.
    n_replicates : int
        Independent sets, at least 2.

    Returns
    -------
    Transport
        The same for the same seed, and the same as with `n_paths` of each sensor right away.

    Raises
    ------
    InputError
        A tolerance without optics.
    """
    if tolerance is not None and optics is None:
        raise InputError(
            "tolerance", "no optics", "typical optics", "Give those of an ordinary leaf and ground."
        )

    def tally(done: np.ndarray, wanted: np.ndarray) -> Transport:
        paths = trace(
            scene,
            np.repeat(sensors_m, n_replicates, axis=0),
            np.repeat(wanted - done, n_replicates),
            first=np.repeat(done, n_replicates),
            max_orders=max_orders,
            seed=seed,
            halved_after=halved_after,
            aperture_m=aperture_m,
        )
        return _tallied(paths, wanted - done, n_replicates, n_patches, max_orders)

    done = np.full(len(sensors_m), -(-n_paths // n_replicates))
    counted = tally(np.zeros_like(done), done)
    if tolerance is None:
        return counted
    most = -(-(64 * n_paths if max_paths is None else max_paths) // n_replicates)
    while True:
        error = nominal_error(counted, optics, sun_kernel_deg=sun_kernel_deg)
        # Errors fall with the root of the paths; a fifth more, since the error is an estimate.
        needed = np.ceil(1.2 * done * (error / tolerance) ** 2).astype(np.int64)
        wanted = np.where(error > tolerance, np.clip(needed, done, max(most, done.max())), done)
        if (wanted == done).all():
            return counted
        counted = _added(counted, tally(done, wanted))
        done = wanted


def _tallied(paths: Paths, n_paths, n_replicates: int, n_patches: int, max_orders: int):
    """Paths of the same start, patch and orders as one row with their number."""
    patch = patches(n_patches).index(paths.direction)
    # A path may leave a scene without ground downwards, where there is no light.
    up = patch >= 0
    orders = paths.orders[up].astype("<u1").view("<u4").ravel().astype(np.int64)
    key = (paths.start[up].astype(np.int64) * n_patches + patch[up]) << 32 | orders
    key, count = _summed(key, paths.weight[up])
    start, patch = np.divmod(key >> 32, n_patches)
    sensor, replicate = np.divmod(start, n_replicates)
    return Transport(
        sensor.astype(np.int32),
        replicate.astype(np.int32),
        patch.astype(np.int32),
        (key & 0xFFFFFFFF).astype("<u4").view(np.uint8).reshape(-1, 4),
        count,
        n_paths,
        paths.cut.reshape(-1, n_replicates).sum(axis=1),
        n_replicates,
        n_patches,
        max_orders,
    )


def _summed(key: np.ndarray, weight: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distinct keys in ascending order and the sum of their weights."""
    order = np.argsort(key, kind="stable")
    key = key[order]
    begin = np.flatnonzero(np.diff(key, prepend=-1))
    if not len(begin):
        return key, weight
    return key[begin], np.add.reduceat(weight[order], begin)


def _added(first: Transport, second: Transport) -> Transport:
    """Counts of both, in the order of `_tallied`."""
    columns = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("sensor", "replicate", "patch", "orders", "count")
    }
    orders = np.ascontiguousarray(columns["orders"]).view("<u4").ravel().astype(np.int64)
    start = columns["sensor"].astype(np.int64) * first.n_replicates + columns["replicate"]
    key = (start * first.n_patches + columns["patch"]) << 32 | orders
    _, index = np.unique(key, return_index=True)
    columns = {name: values[index] for name, values in columns.items()}
    columns["count"] = _summed(key, np.concatenate([first.count, second.count]))[1]
    same = {
        field.name: getattr(first, field.name)
        for field in fields(Transport)
        if field.name not in columns
    }
    same |= {"n_paths": first.n_paths + second.n_paths, "cut": first.cut + second.cut}
    return Transport(**columns, **same)


def nominal_error(
    transport: Transport, optics: Optics, *, sun_kernel_deg: float = 8.0
) -> np.ndarray:
    """Standard error of light from the sky and of scattered light under nominal skies.

    Parameters
    ----------
    transport : Transport
        Counted paths.
    optics : Optics
        Its bands share the light evenly.
    sun_kernel_deg : float
        See `sun_radiance`.

    Returns
    -------
    (n_sensors,) float64
        As a share of the open sky's light: the larger one of an overcast sky of even radiance and
        of clear ones, whose suns straight beam does not count (no path is used for it).
    """
    sky = patches(transport.n_patches)
    suns = direction_from_angles(*np.array(NOMINAL_SUNS_DEG, float).T)
    even = np.full((1, sky.n), 1 / np.pi)
    beam = (1 - NOMINAL_DIFFUSE_SHARE) / suns[:, 2:]
    clear = NOMINAL_DIFFUSE_SHARE * even + beam * sun_radiance(suns, sky, kernel_deg=sun_kernel_deg)
    flux = np.full((1 + len(suns), len(optics)), 1 / len(optics))
    straight = summed_irradiance(transport, even, flux[:1], optics, scattered=False)
    scattered = summed_irradiance(transport, np.concatenate([even, clear]), flux, optics)
    scattered[..., :1] += straight
    scattered[..., 1:] += NOMINAL_DIFFUSE_SHARE * straight
    variance = scattered.var(axis=1, ddof=1) / transport.n_replicates
    return np.sqrt(np.maximum(variance[:, 0], variance[:, 1:].mean(axis=1)))


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
    factor = np.ones((len(orders), len(optics)))
    for column, base in enumerate(bases):
        powers = base ** np.arange(orders[:, column].max(initial=0) + 1)[:, None]
        factor *= powers[orders[:, column]]
    return factor


def irradiance(
    transport: Transport, radiance: np.ndarray, optics: Optics, *, scattered: bool
) -> np.ndarray:
    """Irradiance at the sensors under a sky, in every band.

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
    n_bands = len(optics) if scattered else 1
    shape = (len(transport.n_paths), transport.n_replicates, len(radiance), n_bands)
    result = np.zeros(shape)
    kinds, pieces = _by_kind(transport, radiance, scattered)
    factor = spectral_factor(kinds, optics)[:, :n_bands]
    for sensor, mine, light in pieces:
        result[sensor] = np.einsum("rkt,kb->rtb", light, factor[mine], optimize=True)
    return result


def summed_irradiance(
    transport: Transport,
    radiance: np.ndarray,
    flux: np.ndarray,
    optics: Optics,
    *,
    scattered: bool = True,
) -> np.ndarray:
    """Irradiance at the sensors under a sky, summed over the bands.

    Parameters
    ----------
    transport, radiance, optics, scattered
        As in `irradiance`.
    flux : (t, b) float64
        The light of each band at each time: what the radiance is multiplied with.

    Returns
    -------
    (n_sensors, replicates, t) float64
        In units of the radiance times sr times the flux.
    """
    result = np.zeros((len(transport.n_paths), transport.n_replicates, len(radiance)))
    kinds, pieces = _by_kind(transport, radiance, scattered)
    passed = spectral_factor(kinds, optics) @ flux.T
    for sensor, mine, light in pieces:
        result[sensor] = np.einsum("rkt,kt->rt", light, passed[mine])
    return result


def _by_kind(transport: Transport, radiance: np.ndarray, scattered: bool):
    """Kinds of paths (k, 4), and for each sensor which it has and the sky's light along them.

    The second is an iterator over sensor, kinds (m,) and light (r, m, t).
    """
    met = transport.orders.any(axis=1)
    chosen = np.flatnonzero(met if scattered else ~met)
    packed = np.ascontiguousarray(transport.orders[chosen]).view("<u4").ravel()
    kinds, kind = np.unique(packed, return_inverse=True)
    bounds = np.searchsorted(transport.sensor[chosen], np.arange(len(transport.n_paths) + 1))
    by_patch = np.ascontiguousarray(radiance.T)
    n_replicates = transport.n_replicates

    def pieces() -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        for sensor in np.flatnonzero(np.diff(bounds)):
            part = slice(bounds[sensor], bounds[sensor + 1])
            rows = chosen[part]
            mine, own_kind = np.unique(kind[part], return_inverse=True)
            row = transport.replicate[rows].astype(np.int64) * len(mine) + own_kind
            counted = sparse.csr_array(
                (
                    transport.count[rows] * (np.pi / transport.n_paths[sensor]),
                    (row, transport.patch[rows]),
                ),
                shape=(n_replicates * len(mine), transport.n_patches),
            )
            yield sensor, mine, (counted @ by_patch).reshape(n_replicates, len(mine), -1)

    return kinds.astype("<u4").view(np.uint8).reshape(-1, 4), pieces()


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
