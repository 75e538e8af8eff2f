"""Light for any sky, spectrum and time from rays and paths that were traced once.

Straight rays tell how much of every sky patch a sensor sees. Paths that meet something are counted
by sensor, sky patch and what they met; counts are integers and do not depend on threads. A sky is
a radiance per patch, a spectrum a factor per event: light at every time and in every band is a
product of what was traced with both.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy import sparse
from threadpoolctl import threadpool_limits

from dapple.frames import direction_from_angles
from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, Response
from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics
from dapple.sky.patches import Patches, patches

NOMINAL_SUNS_DEG = ((30, 0), (30, 120), (30, 240), (60, 60), (60, 180), (60, 300))
"""Zenith and azimuth of the suns under which a pilot is judged."""
NOMINAL_DIFFUSE_SHARE = 0.2
"""Of the light of the clear sky under which a pilot is judged."""
NOMINAL_AUREOLE_DEG = 15.0
"""Standard deviation of the bright part of that sky around the sun."""


OF_ROWS = ("replicate", "patch", "orders", "count")
OF_SENSORS = ("sky_seen", "n_paths", "cut")


@dataclass(frozen=True)
class Transport:
    """What sensors see of the sky, and counted paths that met something.

    Attributes
    ----------
    sky_seen : (n_sensors, r, p) float32
        What each sensor reads of every sky patch over what a level one in the open reads of it, in
        independent replicates; with voxels the transmittance. A tilted sensor may read more.
    sensor, replicate, patch : (k,) int32
        Where a path started, in which independent set, and in which sky patch it left.
    orders : (k, n) uint8
        What they met, a column for each of `counters`; never all 0.
    count : (k,) int64
        Paths of this kind.
    n_paths : (n_sensors,) int64
        Paths started from each sensor in each replicate.
    cut : (n_sensors,) int64
        Paths that were given up at `max_orders`, of all replicates.
    max_orders : int
        Most surfaces on a path.
    counters : Counters
        What is counted.
    response : Response
        Of the sensors: paths start as often in a direction as light from there counts.
    """

    sky_seen: np.ndarray
    sensor: np.ndarray
    replicate: np.ndarray
    patch: np.ndarray
    orders: np.ndarray
    count: np.ndarray
    n_paths: np.ndarray
    cut: np.ndarray
    max_orders: int
    counters: Counters
    response: Response = COSINE

    @property
    def n_replicates(self) -> int:
        """Independent sets."""
        return self.sky_seen.shape[1]

    @property
    def n_patches(self) -> int:
        """Subdivision of the sky."""
        return self.sky_seen.shape[2]

    def of(self, sensors: np.ndarray) -> "Transport":
        """Of the sensors with these numbers, in their order."""
        bounds = np.searchsorted(self.sensor, np.arange(len(self.n_paths) + 1))
        rows = np.concatenate([np.arange(bounds[k], bounds[k + 1]) for k in sensors])
        number = np.repeat(np.arange(len(sensors), dtype=np.int32), np.diff(bounds)[sensors])
        own: dict[str, Any] = {name: getattr(self, name)[rows] for name in OF_ROWS}
        own |= {name: getattr(self, name)[sensors] for name in OF_SENSORS}
        return replace(self, **own | {"sensor": number})

    @classmethod
    def joined(cls, parts: Sequence["Transport"]) -> "Transport":
        """Of the sensors of all parts, one part after the other; traced in one scene."""
        names = (*OF_ROWS, *OF_SENSORS)
        own: dict[str, Any] = {
            name: np.concatenate([getattr(part, name) for part in parts]) for name in names
        }
        before = np.cumsum([0, *(len(part.n_paths) for part in parts[:-1])])
        own["sensor"] = np.concatenate(
            [part.sensor + np.int32(n) for part, n in zip(parts, before, strict=True)]
        )
        return replace(parts[0], **own)

    def truncated_share(self, optics: Optics) -> np.ndarray:
        """(n_sensors,) what could be lost at `max_orders`, as a share of an even open sky.

        An upper bound: every surface that a lost path met sends on at most the largest albedo.
        """
        albedo = self.counters.largest_albedo(optics)
        return self.cut / (self.n_paths * self.n_replicates) * albedo**self.max_orders


def nominal_error(transport: Transport, optics: Optics, *, sun_kernel_deg: float) -> np.ndarray:
    """Standard error of scattered light under nominal skies.

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
        As a share of the open sky's light on the level, the largest one of clear skies or half of
        that of an overcast sky of even radiance: without sun the light has no error but this.
    """
    sky = patches(transport.n_patches)
    overcast, clear, suns = _nominal_skies(sky)
    beam = (1 - NOMINAL_DIFFUSE_SHARE) / suns[:, 2:]
    clear = clear + beam * sun_radiance(suns, sky, kernel_deg=sun_kernel_deg)
    flux = np.full((1 + len(suns), len(optics)), 1 / len(optics))
    radiance = np.concatenate([overcast, clear])
    light = summed_scattered(transport, radiance, flux, optics)
    variance = light.var(axis=1, ddof=1) / transport.n_replicates
    return _nominal_error(steadied(variance, light.mean(axis=1), unevenness(radiance, sky)))


def nominal_straight_error(sky_seen: np.ndarray, response: Response = COSINE) -> np.ndarray:
    """Standard error of light straight from nominal skies, like `nominal_error`.

    Parameters
    ----------
    sky_seen : (n_sensors, r, p) float32
        Share of every sky patch that sensors see.
    response : Response
        Of the sensors.
    """
    sky = patches(sky_seen.shape[2])
    overcast, clear, _ = _nominal_skies(sky)
    light = _straight(sky_seen, np.concatenate([overcast, clear]), response)
    return _nominal_error(light.var(axis=1, ddof=1) / light.shape[1])


def unevenness(radiance: np.ndarray, sky: Patches) -> np.ndarray:
    """(t,) mean square of skies' radiance (t, p) over its mean [per sr].

    Light that comes back from a sensor leaves for all of the sky alike: the variance of what is
    counted goes with this and with the mean.
    """
    total = radiance @ sky.solid_angle_sr
    return np.divide(
        radiance**2 @ sky.solid_angle_sr, total, out=np.zeros_like(total), where=total > 0
    )


def steadied(variance: np.ndarray, mean: np.ndarray, unevenness: np.ndarray) -> np.ndarray:
    """Variance of scattered light, steadied by that of the same sensor under other skies.

    Parameters
    ----------
    variance, mean : (n_sensors, t) float64
        Of the mean over replicates, and that mean.
    unevenness : (t,) float64
        Of the skies.

    Returns
    -------
    (n_sensors, t) float64
        Few paths may bring most of a sensor's light; where none of them was drawn, its replicates
        agree too well. The variance of counted light goes with its mean and the unevenness of the
        sky: with the factor that all skies of a sensor share, this is worth as many replicates as
        there are.
    """
    even = np.divide(variance, unevenness, out=np.zeros_like(variance), where=unevenness > 0)
    total = mean.sum(axis=1)
    factor = np.divide(even.sum(axis=1), total, out=np.zeros_like(total), where=total > 0)
    return 0.5 * (variance + factor[:, None] * unevenness * mean)


def _nominal_error(variance: np.ndarray) -> np.ndarray:
    """(n,) largest standard error under skies of which the first is overcast."""
    error = np.sqrt(variance)
    error[:, 0] /= 2
    return error.max(axis=1)


def _nominal_skies(sky: Patches) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Radiance (1, p) of an overcast sky, (s, p) of clear ones without sun, and (s, 3) the suns.

    The open sky gives 1 in all; half the clear sky's light comes from around the sun.
    """
    suns = direction_from_angles(*np.array(NOMINAL_SUNS_DEG, float).T)
    even = np.full((1, sky.n), 1 / np.pi)
    around = sun_radiance(suns, sky, kernel_deg=NOMINAL_AUREOLE_DEG)
    around /= (around @ sky.projected_solid_angle_sr)[:, None]
    return even, 0.5 * NOMINAL_DIFFUSE_SHARE * (even + around), suns


def straight(transport: Transport, radiance: np.ndarray) -> np.ndarray:
    """What sensors read straight from a sky.

    Parameters
    ----------
    transport : Transport
        What sensors see of the sky.
    radiance : (t, p) float64
        Radiance of every sky patch at every time [per sr].

    Returns
    -------
    (n_sensors, r, t) float64
        In units of the radiance times sr.
    """
    return _straight(transport.sky_seen, radiance, transport.response)


def _straight(sky_seen: np.ndarray, radiance: np.ndarray, response: Response) -> np.ndarray:
    """As `straight`, of the share of sky patches (n_sensors, r, p) that sensors see."""
    n_patches = sky_seen.shape[2]
    weight = radiance * patches(n_patches).seen_solid_angle_sr(response)
    light = np.empty((*sky_seen.shape[:2], len(radiance)))
    with _one_thread():
        for found, seen in zip(light, sky_seen, strict=True):
            # One product of matrices each: much faster than a stack, and the same for any height.
            np.matmul(seen.astype(np.float64), weight.T, out=found)
    return light


def scattered(transport: Transport, radiance: np.ndarray, optics: Optics) -> np.ndarray:
    """What sensors read of light that met something, in every band.

    Parameters
    ----------
    transport : Transport
        Counted paths.
    radiance : (t, p) float64
        Radiance of every sky patch at every time, equal in all bands [per sr].
    optics : Optics
        Spectra in b bands.

    Returns
    -------
    (n_sensors, r, t, b) float64
        In units of the radiance times sr.
    """
    result = np.zeros((*transport.sky_seen.shape[:2], len(radiance), len(optics)))
    kinds, pieces = _by_kind(transport, radiance)
    factor = transport.counters.spectral_factor(kinds, optics)
    with _one_thread():
        for sensor, mine, light in pieces:
            result[sensor] = np.einsum("rkt,kb->rtb", light, factor[mine], optimize=True)
    return result


def summed_scattered(
    transport: Transport, radiance: np.ndarray, flux: np.ndarray, optics: Optics
) -> np.ndarray:
    """What sensors read of light that met something, summed over the bands.

    Parameters
    ----------
    transport, radiance, optics
        As in `scattered`.
    flux : (t, b) float64
        The light of each band at each time: what the radiance is multiplied with.

    Returns
    -------
    (n_sensors, r, t) float64
        In units of the radiance times sr times the flux.
    """
    result = np.zeros((*transport.sky_seen.shape[:2], len(radiance)))
    kinds, pieces = _by_kind(transport, radiance)
    factor = transport.counters.spectral_factor(kinds, optics)
    with _one_thread():
        for sensor, mine, light in pieces:
            result[sensor] = np.einsum("rkt,kt->rt", light, factor[mine] @ flux.T)
    return result


def _one_thread() -> threadpool_limits:
    """Small products of matrices, one a sensor: threads would wait for each other, most of all on a
    machine with other work, and take ten times as long."""
    return threadpool_limits(1, "blas")


def _by_kind(transport: Transport, radiance: np.ndarray):
    """Kinds of paths (k, n), and for each sensor which it has and the sky's light along them.

    The second is an iterator over sensor, kinds (m,) and light (r, m, t).
    """
    packed = transport.counters.packed(transport.orders)
    kinds, kind = np.unique(packed, return_inverse=True)
    bounds = np.searchsorted(transport.sensor, np.arange(len(transport.n_paths) + 1))
    by_patch = np.ascontiguousarray(radiance.T)
    n_replicates = transport.n_replicates
    reading_sr = sensor_response.integral_sr(transport.response)

    def pieces() -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
        for sensor in np.flatnonzero(np.diff(bounds)):
            rows = slice(bounds[sensor], bounds[sensor + 1])
            mine, own_kind = np.unique(kind[rows], return_inverse=True)
            row = transport.replicate[rows].astype(np.int64) * len(mine) + own_kind
            weight = transport.count[rows] * (reading_sr / transport.n_paths[sensor])
            counted = sparse.csr_array(
                (weight, (row, transport.patch[rows])),
                shape=(n_replicates * len(mine), transport.n_patches),
            )
            yield int(sensor), mine, (counted @ by_patch).reshape(n_replicates, len(mine), -1)

    return transport.counters.unpacked(kinds), pieces()


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
