"""From leaf and soil parameters to reflectance and transmittance in the camera's bands."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from dapple.optics.cameras import Camera
from dapple.optics.leaf import LEAF_RANGES, camera_leaves
from dapple.optics.soil import Soil, choose
from dapple.retrieval import parameters


@dataclass(frozen=True)
class Spectra:
    """Optical properties of n combinations in b bands, each (n, b), 0 to 1."""

    leaf_reflectance: np.ndarray
    leaf_transmittance: np.ndarray
    soil_reflectance: np.ndarray

    def __len__(self) -> int:
        return len(self.leaf_reflectance)


def combinations(
    settings: Mapping[str, Any], number: int, camera: Camera, *, seed: int, **fixed: float
) -> tuple[pd.DataFrame, Spectra]:
    """Draw combinations of leaf and soil, and compute their spectra.

    Parameters
    ----------
    settings : dict
        `ranges` (least, most and levels by parameter), `jitter_steps`,
        `anthocyanin_per_chlorophyll`, `soil_vectors` and `prospect_version`.
    number : int
        How many.
    camera : Camera
        For whose bands.
    seed : int
    **fixed : float
        Parameters that do not vary.

    Returns
    -------
    parameters : DataFrame
        See `parameters.draw`.
    spectra : Spectra
    """
    ranges = settings["ranges"] | {name: (value, value, 1) for name, value in fixed.items()}
    drawn = parameters.draw(
        number,
        seed=seed,
        table={name: parameters.Range(*row) for name, row in ranges.items()},
        jitter_steps=settings["jitter_steps"],
        anthocyanin_per_chlorophyll=settings["anthocyanin_per_chlorophyll"],
    )
    return drawn, spectra(
        drawn,
        choose(camera, settings["soil_vectors"]),
        camera,
        prospect_version=settings["prospect_version"],
    )


def spectra(
    drawn: pd.DataFrame,
    soil: Soil,
    camera: Camera,
    *,
    prospect_version: str = "D",
) -> Spectra:
    """Optical properties of every combination.

    Parameters
    ----------
    drawn : DataFrame
        From `parameters.draw`: PROSPECT's arguments, `soil_brightness`, `soil_moisture`,
        `shoot_recollision`.
    soil : callable
        From `optics.soil`: brightness and moisture (n,) to reflectance (n, b).
    camera : Camera
        Of the same bands as the soil.
    prospect_version : {"5", "D"}
        Calibration of PROSPECT. To "5" the anthocyanin of green leaves is part of chlorophyll.

    Returns
    -------
    Spectra
    """
    leaf = {name: drawn[name].to_numpy(float) for name in LEAF_RANGES if name in drawn}
    if prospect_version == "5":
        leaf["anthocyanin_ug_cm2"] = 0.0
    reflectance, transmittance = camera_leaves(camera, **leaf, prospect_version=prospect_version)
    recollision = drawn["shoot_recollision"].to_numpy(float)[:, None]
    reflectance, transmittance = of_shoots(reflectance, transmittance, recollision)
    ground = soil(drawn["soil_brightness"].to_numpy(float), drawn["soil_moisture"].to_numpy(float))
    return Spectra(reflectance, transmittance, ground)


def of_shoots(
    reflectance: np.ndarray, transmittance: np.ndarray, recollision: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Optical properties of shoots whose needles light meets again before it leaves them.

    With the chance p that light scattered by a needle meets its own shoot, a shoot scatters
    w (1 - p) / (1 - p w) of what it intercepts, where its needles scatter w = ρ + τ (Smolander and
    Stenberg 2003). Reflectance keeps its share.

    Parameters
    ----------
    reflectance, transmittance : (...) float
        Of needles, 0 to 1.
    recollision : float or array that broadcasts
        The chance p, from 0 to below 1.

    Returns
    -------
    reflectance, transmittance : (...) float
        Of a surface that stands for the shoot.
    """
    albedo = np.asarray(reflectance) + transmittance
    left = (1 - recollision) / (1 - recollision * albedo)
    return reflectance * left, transmittance * left
