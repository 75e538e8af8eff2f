"""PAR through the day from what was traced once: direct, sky and scattered light added up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from dapple.light.tensor import (
    Transport,
    steadied,
    straight,
    summed_scattered,
    sun_radiance,
    unevenness,
)
from dapple.light.visibility import Sunlit
from dapple.scene.scene_optics import Optics
from dapple.sky.open_sky import open_beam, towards_sun
from dapple.sky.patches import patches
from dapple.sky.sky_radiance import patch_radiance

VALUES_AT_ONCE = 1 << 22
"""Bounds memory: values of sensors, replicates and times that are held together."""


@dataclass(frozen=True)
class Light:
    """PAR at n sensors and t times [µmol m⁻² s⁻¹].

    Attributes
    ----------
    direct, sky, scattered : (n, t) float64
        Straight from the sun, straight from the sky, scattered by leaves, bark and ground.
    standard_error : (n, t) float64
        Of their sum, for the rays and paths that were traced.
    """

    direct: np.ndarray
    sky: np.ndarray
    scattered: np.ndarray
    standard_error: np.ndarray

    @property
    def par(self) -> np.ndarray:
        """(n, t) sum of the parts."""
        return self.direct + self.sky + self.scattered


def compute(
    sunlit: Sunlit,
    transport: Transport,
    sky: xr.Dataset,
    optics: Optics,
    *,
    sun_kernel_deg: float,
    facing: np.ndarray | None = None,
) -> Light:
    """Light of one scene from what was traced in it.

    Parameters
    ----------
    sunlit : Sunlit
        Share of the solar disc that is seen at the times of the sky.
    transport : Transport
        Counted paths of the same sensors, and how these respond.
    sky : xarray.Dataset
        Sun and sky at t times in b bands.
    optics : Optics
        In b bands.
    sun_kernel_deg : float
        Over which angle around the sun scattered paths are averaged [deg].
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level.

    Returns
    -------
    Light
    """
    n_times = sky.sizes["time"]
    step = int(np.clip(VALUES_AT_ONCE // transport.sky_seen[..., 0].size, 1, n_times))
    blocks = [
        _from_sky(transport, sky.isel(time=slice(low, low + step)), optics, sun_kernel_deg)
        for low in range(0, n_times, step)
    ]
    from_sky, scattered, sky_variance, variance, uneven = (
        np.concatenate(part, axis=-1) for part in zip(*blocks, strict=True)
    )
    # Straight rays and paths are drawn independently, shadow rays too: their variances add.
    variance = sky_variance + steadied(variance, scattered, uneven)
    beam = open_beam(sky, transport.response, facing)
    return Light(
        direct=sunlit.share.mean(axis=0) * beam,
        sky=from_sky,
        scattered=scattered,
        standard_error=np.sqrt(variance + (sunlit.standard_error * beam) ** 2),
    )


def _from_sky(
    transport: Transport, sky: xr.Dataset, optics: Optics, sun_kernel_deg: float
) -> tuple[np.ndarray, ...]:
    """Light straight from the sky, scattered light, variances of both (n, t); unevenness (t,)."""
    subdivision = patches(transport.n_patches)
    beam = sky["beam_normal_umol_m2_s"].transpose("time", "band").to_numpy()
    diffuse = sky["diffuse_horizontal_umol_m2_s"].transpose("time", "band").to_numpy()
    radiance = patch_radiance(sky, subdivision)
    spread = sun_radiance(towards_sun(sky), subdivision, kernel_deg=sun_kernel_deg)
    from_sky = straight(transport, radiance) * diffuse.sum(axis=1)
    both = np.concatenate([radiance, spread]), np.concatenate([diffuse, beam])
    scattered = summed_scattered(transport, *both, optics)
    scattered = scattered[..., : len(beam)] + scattered[..., len(beam) :]
    whole = radiance * diffuse.sum(axis=1)[:, None] + spread * beam.sum(axis=1)[:, None]
    return (
        from_sky.mean(axis=1),
        scattered.mean(axis=1),
        *(light.var(axis=1, ddof=1) / transport.n_replicates for light in (from_sky, scattered)),
        unevenness(whole, subdivision),
    )


def mean(placements: Sequence[Light]) -> Light:
    """Mean over placements of virtual leaves, or the light itself where there is one.

    The standard error of several is that of their mean, which includes that of the paths.
    """
    if len(placements) == 1:
        return placements[0]
    direct, sky, scattered = (
        np.mean([getattr(p, part) for p in placements], axis=0)
        for part in ("direct", "sky", "scattered")
    )
    spread = np.std([p.par for p in placements], axis=0, ddof=1)
    return Light(direct, sky, scattered, standard_error=spread / np.sqrt(len(placements)))
