"""Light without a tree, from a sky dataset."""

import numpy as np
import xarray as xr

from dapple.frames import direction_from_angles
from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, Response
from dapple.sky.patches import patches
from dapple.sky.sky_radiance import patch_radiance

N_PATCHES = 577
"""Of the sky, over which readings of sensors without a cosine response are summed."""


def towards_sun(sky: xr.Dataset) -> np.ndarray:
    """(t, 3) unit vectors towards the sun at the times of a sky dataset."""
    return direction_from_angles(
        sky["sun_zenith_deg"].to_numpy(), sky["sun_azimuth_deg"].to_numpy()
    )


def open_sky_par(sky: xr.Dataset, response: Response = COSINE) -> xr.DataArray:
    """(t,) PAR that a level sensor reads without a tree [µmol m⁻² s⁻¹].

    Parameters
    ----------
    sky : xarray.Dataset
        Sun and sky at t times.
    response : Response
        Of the sensor; with the cosine it is the flux through the level.
    """
    beam = sky["beam_normal_umol_m2_s"].sum("band")
    return beam.copy(data=level_beam(sky, response) + level_diffuse(sky, response))


def level_beam(sky: xr.Dataset, response: Response = COSINE) -> np.ndarray:
    """(t,) PAR that a level sensor reads straight from the sun without a tree [µmol m⁻² s⁻¹]."""
    upward = np.cos(np.radians(sky["sun_zenith_deg"].to_numpy()))
    beam = sky["beam_normal_umol_m2_s"].sum("band").to_numpy()
    return beam * sensor_response.value(response, upward)


def level_diffuse(sky: xr.Dataset, response: Response = COSINE) -> np.ndarray:
    """(t,) PAR that a level sensor reads from the sky without a tree [µmol m⁻² s⁻¹]."""
    horizontal = sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy()
    if response == COSINE:
        return horizontal
    dome = patches(N_PATCHES)
    return horizontal * (patch_radiance(sky, dome) @ dome.seen_solid_angle_sr(response))
