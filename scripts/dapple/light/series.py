"""PAR through the day from what was traced once: direct, sky and scattered light added up."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.netcdf import time_coordinate
from dapple.frames import direction_from_angles
from dapple.light.tensor import Transport, straight, summed_scattered, sun_radiance
from dapple.light.visibility import Sunlit
from dapple.scene.scene_optics import Optics
from dapple.sky.patches import patches
from dapple.sky.sky_radiance import patch_radiance

VALUES_AT_ONCE = 1 << 22
"""Bounds memory: values of sensors, replicates and times that are held together."""
PARTS = {
    "par_umol_m2_s": "photosynthetically active radiation",
    "par_direct_umol_m2_s": "PAR straight from the sun",
    "par_sky_umol_m2_s": "PAR straight from the sky",
    "par_scattered_umol_m2_s": "PAR scattered by leaves, bark and ground",
    "standard_error_umol_m2_s": "standard error of PAR",
}


def towards_sun(sky: xr.Dataset) -> np.ndarray:
    """(t, 3) unit vectors towards the sun at the times of a sky dataset."""
    return direction_from_angles(
        sky["sun_zenith_deg"].to_numpy(), sky["sun_azimuth_deg"].to_numpy()
    )


def open_sky_par(sky: xr.Dataset) -> xr.DataArray:
    """Horizontal PAR without a tree at the times of a sky dataset [µmol m⁻² s⁻¹]."""
    upward = np.maximum(np.cos(np.radians(sky["sun_zenith_deg"])), 0)
    beam = sky["beam_normal_umol_m2_s"].sum("band")
    return beam * upward + sky["diffuse_horizontal_umol_m2_s"].sum("band")


def level_beam(sky: xr.Dataset) -> np.ndarray:
    """(t,) PAR straight from the sun on level ground without a tree [µmol m⁻² s⁻¹]."""
    upward = np.maximum(np.cos(np.radians(sky["sun_zenith_deg"].to_numpy())), 0)
    return sky["beam_normal_umol_m2_s"].sum("band").to_numpy() * upward


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
) -> Light:
    """Light of one scene from what was traced in it.

    Parameters
    ----------
    sunlit : Sunlit
        Share of the solar disc that is seen at the times of the sky.
    transport : Transport
        Counted paths of the same sensors.
    sky : xarray.Dataset
        Sun and sky at t times in b bands.
    optics : Optics
        In b bands.
    sun_kernel_deg : float
        Over which angle around the sun scattered paths are averaged [deg].

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
    from_sky, scattered, variance = (
        np.concatenate(part, axis=1) for part in zip(*blocks, strict=True)
    )
    beam = level_beam(sky)
    # Shadow rays and paths are drawn independently: their variances add.
    return Light(
        direct=sunlit.share.mean(axis=0) * beam,
        sky=from_sky,
        scattered=scattered,
        standard_error=np.sqrt(variance + (sunlit.standard_error * beam) ** 2),
    )


def _from_sky(
    transport: Transport, sky: xr.Dataset, optics: Optics, sun_kernel_deg: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Light straight from the sky, scattered light, the variance of their sum: (n, t) each."""
    subdivision = patches(transport.n_patches)
    beam = sky["beam_normal_umol_m2_s"].transpose("time", "band").to_numpy()
    diffuse = sky["diffuse_horizontal_umol_m2_s"].transpose("time", "band").to_numpy()
    radiance = patch_radiance(
        sky["perez"].to_numpy(),
        sky["sun_zenith_deg"].to_numpy(),
        sky["sun_azimuth_deg"].to_numpy(),
        subdivision,
    )
    spread = sun_radiance(towards_sun(sky), subdivision, kernel_deg=sun_kernel_deg)
    from_sky = straight(transport, radiance) * diffuse.sum(axis=1)
    both = np.concatenate([radiance, spread]), np.concatenate([diffuse, beam])
    scattered = summed_scattered(transport, *both, optics)
    scattered = scattered[..., : len(beam)] + scattered[..., len(beam) :]
    variance = (from_sky + scattered).var(axis=1, ddof=1) / transport.n_replicates
    return from_sky.mean(axis=1), scattered.mean(axis=1), variance


def mean(placements: Sequence[Light]) -> Light:
    """Mean over placements of virtual leaves, or the light itself where there is one.

    The standard error of several is that of their mean, which includes that of the paths.
    """
    if len(placements) == 1:
        return placements[0]
    parts = (
        np.mean([getattr(p, part) for p in placements], axis=0)
        for part in ("direct", "sky", "scattered")
    )
    spread = np.std([p.par for p in placements], axis=0, ddof=1)
    return Light(*parts, standard_error=spread / np.sqrt(len(placements)))


def as_dataset(light: Light, sensors: Sequence[str], when: pd.DatetimeIndex) -> xr.Dataset:
    """Light of labelled sensors at t times as files have it."""
    parts = {name: getattr(light, name) for name in ("direct", "sky", "scattered")}
    return dataset(list(sensors), when, par=light.par, standard_error=light.standard_error, **parts)


def dataset(
    sensors: list[str],
    when: pd.DatetimeIndex,
    *,
    par: np.ndarray,
    direct: np.ndarray,
    sky: np.ndarray,
    scattered: np.ndarray,
    standard_error: np.ndarray,
) -> xr.Dataset:
    """Light at sensors and times, arrays of shape (n_sensors, t), as a dataset."""
    values = (par, direct, sky, scattered, standard_error)
    return xr.Dataset(
        {
            name: (("sensor", "time"), value, {"units": "µmol m-2 s-1", "long_name": text})
            for (name, text), value in zip(PARTS.items(), values, strict=True)
        },
        coords={"sensor": sensors, "time": time_coordinate(when)},
    )
