"""Engines of light against each other, on the scale of the open sky."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError

FACTS = ["n", "rmse_rel", "bias_rel", "max_abs_z"]
COLUMNS = ["reconstruction", *FACTS, "engine", "reference", "shared"]
INPUT = "scene, sun and sky, spectra, sensors"
"""What all engines are given: agreement says nothing for it."""
PAR, ERROR = "par_umol_m2_s", "standard_error_umol_m2_s"


def compare(
    fast: xr.Dataset,
    reference: xr.Dataset,
    open_sky_umol_m2_s: xr.DataArray,
    *,
    float_resolution: float = 1e-6,
) -> dict[str, float]:
    """Compare two light datasets of one reconstruction where both have a value.

    Parameters
    ----------
    fast, reference : Dataset
        Dims `sensor`, `time`; `par_umol_m2_s` and its `standard_error_umol_m2_s`
        [µmol m⁻² s⁻¹].
    open_sky_umol_m2_s : DataArray
        Horizontal PAR without any obstacle, dim `time` [µmol m⁻² s⁻¹].
    float_resolution : float
        Relative rounding error of single precision, as a share of open-sky PAR. It is part of
        z, so that two engines without Monte Carlo noise may differ in the last digit.

    Returns
    -------
    dict
        `n` pairs; `rmse_rel` and `bias_rel` (fast minus reference) of differences divided by
        open-sky PAR of their time; `max_abs_z`, the largest difference in units of the joint
        standard error. Times without light are left out; where there is no other, `n` is 0 and
        the rest unknown (NaN).

    Raises
    ------
    InputError
        The datasets share no value of the same sensor and time.
    """
    fast, reference, open_sky = xr.align(fast, reference, open_sky_umol_m2_s, join="inner")
    difference = (fast[PAR] - reference[PAR]).transpose("sensor", "time").to_numpy()
    variance = fast[ERROR] ** 2 + reference[ERROR] ** 2
    variance = variance + (float_resolution * open_sky) ** 2
    sigma = np.sqrt(variance.transpose("sensor", "time").to_numpy())
    scale = np.broadcast_to(open_sky.to_numpy(), difference.shape)
    known = np.isfinite(difference)
    if not known.any():
        raise InputError(
            "light datasets",
            f"no pair of values in {difference.shape[0]} common sensors and "
            f"{difference.shape[1]} common times",
            "two runs of the same sensors at the same times",
            "Give the reference timesteps that the fast engine has too.",
        )
    usable = known & (scale > 0)
    if not usable.any():
        return {"n": 0} | dict.fromkeys(FACTS[1:], np.nan)
    relative = difference[usable] / scale[usable]
    return {
        "n": int(usable.sum()),
        "rmse_rel": float(np.sqrt(np.mean(relative**2))),
        "bias_rel": float(relative.mean()),
        "max_abs_z": float(np.abs(difference[usable] / sigma[usable]).max()),
    }


def rmse_rel(par: np.ndarray, reference: np.ndarray, open_sky: np.ndarray) -> float:
    """Root mean square difference as a share of open-sky PAR.

    Parameters
    ----------
    par, reference : (n, t) float64
        PAR at n sensors and t times.
    open_sky : (t,) float64
        PAR without a tree in the same unit; times without light are left out.
    """
    lit = open_sky > 0
    relative = (par[:, lit] - reference[:, lit]) / open_sky[lit]
    return float(np.sqrt((relative**2).mean()))


def table(rows: list[dict[str, str | float]]) -> pd.DataFrame:
    """A row for each reconstruction and pair of engines, from what `compare` returned for it.

    `shared` tells what both engines have in common, whose faults their agreement cannot show.
    """
    found = pd.DataFrame(rows, columns=COLUMNS)
    # LESS traces with Embree; the two engines that trace with Mitsuba share its ray tracer.
    independent = (found[["engine", "reference"]] == "less").any(axis=1)
    found["shared"] = np.where(independent, INPUT, f"{INPUT}, ray tracer (Mitsuba)")
    return found
