"""Light without a tree, from a sky dataset."""

import numpy as np
import xarray as xr

from dapple.frames import direction_from_angles


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
