"""Where the tree stands among the sensors, from the shade that it throws on them."""

from collections.abc import Callable
from dataclasses import asdict
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.light import rays_to_sky
from dapple.optics.responses import Response
from dapple.registration import fit
from dapple.scene.facing import facing_of
from dapple.scene.surfaces import Scene
from dapple.sky.open_sky import open_beam, open_diffuse, towards_sun

FINE_STEP_S = 120.0
"""Times of the simulated shade; the sun moves by half its disc in a minute."""
N_DISC, N_SKY = 16, 64
"""Rays per sensor and time towards the sun, and per sensor towards the sky."""


def register(
    scenes: list[Scene],
    sensors: pd.DataFrame,
    records: pd.DataFrame,
    *,
    sky_at: Callable[[pd.DatetimeIndex], xr.Dataset],
    max_shift_m: float,
    max_clock_offset_s: float,
    split_by: str,
    fit_share: float,
    sun_diameter_deg: float,
    aperture_m: float,
    response: Response,
    gain: str,
    variant: str,
    seed: int,
) -> dict:
    """Fit the origin of the tree's frame and the clock offset of the loggers.

    Light is direct beam and sky through gaps: enough to see where shade falls.

    Parameters
    ----------
    scenes : list of Scene
        The tree; several placements of virtual leaves are averaged.
    sensors : pandas.DataFrame
        In the local frame of the guessed origin.
    records : pandas.DataFrame
        `sensor`, `time` (UTC), `par_umol_m2_s`.
    sky_at : callable
        Gives the sky dataset of any times.
    max_shift_m, max_clock_offset_s : float
        Half width of the search [m], [s].
    split_by, fit_share : str, float
        The part of the records that fits; the rest reports.
    sun_diameter_deg, aperture_m : float
        Angular diameter of the sun [deg], diameter of the level disc around each sensor over
        which light is averaged [m].
    response : Response
        Of the sensors.
    gain : {"none", "site"}
        Whether to fit `open_sky_gain` on the fitting part.

    Returns
    -------
    dict
        Shift, clock offset, gain, r on the fitting part, and both parts by name.
    """
    table = records.pivot(index="sensor", columns="time", values="par_umol_m2_s")
    parts = fit.split(list(table.index), table.columns, by=split_by, share=fit_share, seed=seed)
    known = sensors.set_index("sensor").loc[table.index]
    used = parts.fitting.any(axis=1)
    points_m = known[["x_m", "y_m", "z_m"]].to_numpy()[used]
    facing = facing_of(known[used])
    margin = pd.Timedelta(seconds=max_clock_offset_s + FINE_STEP_S)
    fine = pd.date_range(
        table.columns[0] - margin, table.columns[-1] + margin, freq=f"{FINE_STEP_S:g}s"
    )
    sky = sky_at(fine)
    sun = towards_sun(sky)
    beam, diffuse = open_beam(sky, response, facing), open_diffuse(sky, response)
    disc: dict[str, Any] = {"n_disc": N_DISC, "seed": seed}
    disc |= {"sun_diameter_deg": sun_diameter_deg, "aperture_m": aperture_m}
    dome: dict[str, Any] = {"n": N_SKY, "seed": seed, "response": response}
    tracers = [rays_to_sky.Tracer(scene, variant) for scene in scenes]

    def seen(shifts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Share of the sun's disc and of the sky. Moving the tree east moves the sensors west."""
        moved = np.repeat(points_m[None], len(shifts), axis=0)
        moved[:, :, :2] -= shifts[:, None, :]
        moved = moved.reshape(-1, 3)
        faced: dict[str, Any] = {
            "facing": None if facing is None else np.tile(facing, (len(shifts), 1))
        }
        sunlit = np.mean([t.sun_visibility(moved, sun, **disc, **faced) for t in tracers], axis=0)
        open_sky = np.mean([t.sky_visibility(moved, **dome, **faced) for t in tracers], axis=0)
        shape = len(shifts), len(points_m), -1
        return sunlit.reshape(shape), open_sky.reshape(shape)

    def simulate(shifts: np.ndarray) -> np.ndarray:
        sunlit, open_sky = seen(shifts)
        return sunlit * beam + open_sky * diffuse

    fine_s, record_s = (
        (when - fine[0]).total_seconds().to_numpy() for when in (fine, table.columns)
    )
    measured = table.to_numpy()[used]
    found = fit.register(
        measured,
        record_s,
        simulate,
        fine_s,
        fitting=parts.fitting[used],
        shift_range_m=max_shift_m,
        shift_step_m=max_shift_m / 4 if max_shift_m else 1.0,
        clock_range_s=max_clock_offset_s,
    )
    facts = asdict(found)
    facts.pop("candidates")
    facts["gain"] = 1.0
    if gain == "site":
        sunlit, open_sky = (part[0] for part in seen(np.array([[found.east_m, found.north_m]])))
        par = fit.at_times(sunlit * beam + open_sky * diffuse, record_s, found, fine_s)
        facts |= open_sky_gain(
            np.where(parts.fitting[used], measured, np.nan),
            par,
            fit.at_times(sunlit, record_s, found, fine_s),
        )
    return facts | {
        "fitting_part": parts.fitting_part,
        "reporting_part": parts.reporting_part,
        "fitting_sensors": [str(s) for s in table.index[parts.fitting.all(axis=1)]],
        "fitting_until": (
            str(table.columns[parts.fitting.all(axis=0)][-1]) if split_by == "time" else None
        ),
    }


def open_sky_gain(
    measured: np.ndarray, simulated: np.ndarray, sunlit: np.ndarray, least: int = 30
) -> dict[str, float | int]:
    """What sensors read over what the radiation says, while they see the whole sun.

    Parameters
    ----------
    measured, simulated : (sensor, time) float64
        PAR; NaN where there is no record.
    sunlit : (sensor, time) float64
        Share of the sun's disc that is seen in the simulation.
    least : int
        Fewer records tell no gain.

    Returns
    -------
    dict
        `gain`, the median of the ratios, and `n_gain`, of so many records. A record of less than
        0.8 of the simulated light counts as shade that the simulation does not know.

    Raises
    ------
    InputError
        Too few records in full sun.
    """
    whole = np.isfinite(measured) & (sunlit > 0.98) & (measured > 0.8 * simulated)
    if whole.sum() < least:
        raise InputError(
            "registration.gain",
            f"{int(whole.sum())} records of fitting sensors in full sun",
            f"at least {least}",
            "Set registration.gain to none, or give records of a clear day and of open places.",
        )
    ratio = measured[whole] / simulated[whole]
    return {"gain": float(np.median(ratio)), "n_gain": int(whole.sum())}
