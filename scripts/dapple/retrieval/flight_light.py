"""Sun and sky while a UAV took its images."""

from collections.abc import Mapping, Sequence
from datetime import datetime
from typing import Any

import numpy as np
import pandas as pd
import pyproj

from dapple import clock
from dapple.errors import InputError
from dapple.formats.rasters import Raster
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import Camera
from dapple.sky import spectrum
from dapple.sky import sun as solar

LOWEST_SUN_ZENITH_DEG = 80.0
OPTICAL_DEPTHS = (0.0, 0.05, 0.1, 0.2, 0.3, 0.5, 0.8)
"""Of aerosol at 500 nm, for which the sky is computed; linear between."""
USUAL = OPTICAL_DEPTHS.index(0.1)


def sun(stated: Mapping[str, Any], images: Raster | None) -> dict[str, Any]:
    """Where the sun stood.

    Parameters
    ----------
    stated : mapping
        `sun_zenith_deg`, `sun_azimuth_deg`, or `time` and `timezone`; angles go before the time.
    images : Raster or None
        Their middle is the place; not needed where both angles are stated.

    Returns
    -------
    dict
        `sun_zenith_deg`, `sun_azimuth_deg` (clockwise from north), and `told_by`.

    Raises
    ------
    InputError
        The sun was too low at that time.
    """
    angles = {name: stated[name] for name in ("sun_zenith_deg", "sun_azimuth_deg")}
    if all(value is not None for value in angles.values()):
        return angles | {"told_by": "as stated"}
    if images is None:
        raise ValueError("images tell the place")
    place = latitude_longitude(images)
    (moment,) = clock.time_range(stated["time"], stated["time"], 1.0, stated["timezone"])
    found = solar.position(pd.DatetimeIndex([moment]), *place).iloc[0]
    angles = {
        name: float(found[name]) if value is None else value for name, value in angles.items()
    }
    _require_daylight(angles["sun_zenith_deg"], moment, place)
    where = f"{place[0]:.4f} N, {place[1]:.4f} E"
    return angles | {"told_by": f"{moment:%Y-%m-%d %H:%M} UTC at {where}"}


def _require_daylight(zenith_deg: float, moment: datetime, place: tuple[float, float]) -> None:
    if zenith_deg > LOWEST_SUN_ZENITH_DEG:
        raise InputError(
            "chlorophyll.user.time",
            f"the sun {90 - zenith_deg:.1f}° above the horizon on {moment:%Y-%m-%d %H:%M} UTC at "
            f"{place[0]:.3f} N, {place[1]:.3f} E",
            f"at least {90 - LOWEST_SUN_ZENITH_DEG:.0f}°",
            "Check `time` and `timezone`.",
        )


def latitude_longitude(images: Raster) -> tuple[float, float]:
    """The middle of images: degrees north and east."""
    middle = (0.5 * (images.left_m + images.right_m), 0.5 * (images.bottom_m + images.top_m))
    to_degrees = pyproj.Transformer.from_crs(images.crs, "EPSG:4326", always_xy=True)
    east, north = to_degrees.transform(*middle)
    return north, east


def diffuse_share(
    stated: Sequence[tuple[float, float]], sun_zenith_deg: float, seen_by: Camera
) -> dict[str, Any]:
    """Share of skylight in the light on level ground.

    Parameters
    ----------
    stated : sequence of (float, float)
        Wavelengths [nm], ascending, and shares; empty: those of a cloudless sky.
    sun_zenith_deg : float
    seen_by : Camera

    Returns
    -------
    dict
        `diffuse_share` of every band, as stated or with little aerosol; `aerosol_optical_depth`
        (k,) and the shares with it, `by_optical_depth` (k, b); and `told_by`.
    """
    if stated:
        told = list(seen_by.at_centres(stated))
        table = {"aerosol_optical_depth": [0.0], "by_optical_depth": [told]}
        return {"diffuse_share": told, "told_by": "as stated"} | table
    rows = []
    for depth in OPTICAL_DEPTHS:
        nm, share = spectrum.cloudless_diffuse_share(
            sun_zenith_deg, aerosol_optical_depth_500nm=depth
        )
        rows.append(np.round(camera_mean(nm, share, seen_by), 4).tolist())
    return {
        "diffuse_share": rows[USUAL],
        "told_by": "SPECTRL2, a cloudless sky",
        "aerosol_optical_depth": list(OPTICAL_DEPTHS),
        "by_optical_depth": rows,
    }


def shares(sky: Mapping[str, Any], optical_depth: np.ndarray) -> np.ndarray:
    """Shares of skylight (n, b) with aerosol of n optical depths.

    Parameters
    ----------
    sky : mapping
        From `diffuse_share`. Where the shares were stated, aerosol changes nothing.
    optical_depth : (n,) float
        At 500 nm.
    """
    by_band = np.transpose(sky["by_optical_depth"])
    known = sky["aerosol_optical_depth"]
    return np.column_stack([np.interp(optical_depth, known, band) for band in by_band])
