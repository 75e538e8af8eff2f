"""Where the tree stands among the sensors, from the shade that it throws on them."""

from collections.abc import Callable
from dataclasses import asdict

import numpy as np
import pandas as pd
import xarray as xr

from dapple.light import rays_to_sky
from dapple.registration import fit
from dapple.scene.surfaces import Scene
from dapple.sky.open_sky import level_beam, towards_sun

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
        Angular diameter of the sun [deg], diameter of the sensors' receiving discs [m].

    Returns
    -------
    dict
        Shift, clock offset, r on the fitting part, and both parts by name.
    """
    table = records.pivot(index="sensor", columns="time", values="par_umol_m2_s")
    parts = fit.split(list(table.index), table.columns, by=split_by, share=fit_share, seed=seed)
    known = sensors.set_index("sensor").loc[table.index]
    used = parts.fitting.any(axis=1)
    points_m = known[["x_m", "y_m", "z_m"]].to_numpy()[used]
    margin = pd.Timedelta(seconds=max_clock_offset_s + FINE_STEP_S)
    fine = pd.date_range(
        table.columns[0] - margin, table.columns[-1] + margin, freq=f"{FINE_STEP_S:g}s"
    )
    sky = sky_at(fine)
    sun = towards_sun(sky)
    beam = level_beam(sky)
    diffuse = sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy()
    disc = {"n_disc": N_DISC, "sun_diameter_deg": sun_diameter_deg, "aperture_m": aperture_m}
    disc["seed"] = seed
    tracers = [rays_to_sky.Tracer(scene, variant) for scene in scenes]

    def simulate(shifts: np.ndarray) -> np.ndarray:
        """Moving the tree east is moving the sensors west."""
        moved = np.repeat(points_m[None], len(shifts), axis=0)
        moved[:, :, :2] -= shifts[:, None, :]
        moved = moved.reshape(-1, 3)
        sunlit = np.mean([t.sun_visibility(moved, sun, **disc) for t in tracers], axis=0)
        open_sky = np.mean([t.sky_visibility(moved, n=N_SKY, seed=seed) for t in tracers], axis=0)
        par = sunlit * beam + open_sky[:, None] * diffuse
        return par.reshape(len(shifts), len(points_m), len(fine))

    start = fine[0]
    found = fit.register(
        table.to_numpy()[used],
        (table.columns - start).total_seconds().to_numpy(),
        simulate,
        (fine - start).total_seconds().to_numpy(),
        fitting=parts.fitting[used],
        shift_range_m=max_shift_m,
        shift_step_m=max_shift_m / 4 if max_shift_m else 1.0,
        clock_range_s=max_clock_offset_s,
    )
    facts = asdict(found)
    facts.pop("candidates")
    return facts | {
        "fitting_part": parts.fitting_part,
        "reporting_part": parts.reporting_part,
        "fitting_sensors": [str(s) for s in table.index[parts.fitting.all(axis=1)]],
        "fitting_until": (
            str(table.columns[parts.fitting.all(axis=0)][-1]) if split_by == "time" else None
        ),
    }
