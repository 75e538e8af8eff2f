"""From leaf and soil parameters to reflectance and transmittance in the camera's bands."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.optics.leaf import LEAF_RANGES, camera_leaves
from dapple.optics.soil import Soil


@dataclass(frozen=True)
class Spectra:
    """Optical properties of n combinations in b bands, each (n, b), 0 to 1."""

    leaf_reflectance: np.ndarray
    leaf_transmittance: np.ndarray
    soil_reflectance: np.ndarray

    def __len__(self) -> int:
        return len(self.leaf_reflectance)


def spectra(parameters: pd.DataFrame, soil: Soil, *, prospect_version: str = "D") -> Spectra:
    """Optical properties of every combination.

    Parameters
    ----------
    parameters : DataFrame
        From `parameters.draw`: PROSPECT's arguments, `soil_brightness`, `soil_moisture`.
    soil : callable
        From `optics.soil`: brightness and moisture (n,) to reflectance (n, b).
    prospect_version : {"5", "D"}
        Calibration of PROSPECT.

    Returns
    -------
    Spectra
    """
    leaf = {name: parameters[name].to_numpy(float) for name in LEAF_RANGES if name in parameters}
    reflectance, transmittance = camera_leaves(**leaf, prospect_version=prospect_version)
    ground = soil(
        parameters["soil_brightness"].to_numpy(float), parameters["soil_moisture"].to_numpy(float)
    )
    return Spectra(reflectance, transmittance, ground)
