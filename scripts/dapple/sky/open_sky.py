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


def open_sky_par(
    sky: xr.Dataset, response: Response = COSINE, facing: np.ndarray | None = None
) -> xr.DataArray:
    """PAR that sensors read without a tree [µmol m⁻² s⁻¹].

    Parameters
    ----------
    sky : xarray.Dataset
        Sun and sky at t times.
    response : Response
        Of the sensor; with the cosine it is the flux through the level.
    facing : (n, 3) float64 or None
        Unit normals of sensors; None: one that is level.

    Returns
    -------
    xarray.DataArray
        (t,) of a level sensor; (n, t) with the dims `sensor` and `time` of sensors that face so,
        without what the ground reflects to them.
    """
    found = open_beam(sky, response, facing) + open_diffuse(sky, response, facing)
    dims = ("time",) if facing is None else ("sensor", "time")
    return xr.DataArray(found, dims=dims, coords={"time": sky["time"]})


def open_beam(
    sky: xr.Dataset, response: Response = COSINE, facing: np.ndarray | None = None
) -> np.ndarray:
    """PAR straight from the sun without a tree: (t,) of a level sensor, (n, t) of n that face so.

    Parameters
    ----------
    sky, response, facing
        As in `open_sky_par`.
    """
    sun = towards_sun(sky)
    upward = np.cos(np.radians(sky["sun_zenith_deg"].to_numpy()))
    cosine = upward if facing is None else np.where(upward > 0, facing @ sun.T, 0.0)
    beam = sky["beam_normal_umol_m2_s"].sum("band").to_numpy()
    return beam * sensor_response.value(response, cosine)


def open_diffuse(
    sky: xr.Dataset, response: Response = COSINE, facing: np.ndarray | None = None
) -> np.ndarray:
    """PAR from the sky without a tree, like `open_beam`; what the ground reflects is left out."""
    horizontal = sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy()
    if response == COSINE and facing is None:
        return horizontal
    dome = patches(N_PATCHES)
    radiance = patch_radiance(sky, dome)
    if facing is None:
        return horizontal * (radiance @ dome.seen_solid_angle_sr(response))
    reading = sensor_response.value(response, facing @ dome.directions.T) * dome.solid_angle_sr
    return horizontal * (reading @ radiance.T)
