"""What radiation reaches the tree."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from dapple.config.base import Positive, Section, Share, key


class Radiation(Section):
    """Broadband radiation that reaches the top of the tree."""

    kind: Literal["clear_sky", "table"] = key("clear_sky", "modelled, or read from a file")
    path: str = key("", "CSV, relative to data_dir")
    time_column: str = key("time_utc", "column of time stamps")
    global_column: str = key("global_W_m2", "column of global horizontal irradiance [W m⁻²]")
    diffuse_column: str = key("diffuse_W_m2", "column of diffuse horizontal irradiance [W m⁻²]")
    timezone: str = key("UTC", "IANA zone of the time stamps")
    max_gap_min: Positive = key(60.0, "rows of the file further apart are filled by the model")
    linke_turbidity: Positive = key(3.0, "haze of the clear-sky model", "Ineichen and Perez 2002")
    precipitable_water_cm: Annotated[float, Gt(0), Le(8)] = key(
        2.0, "water vapour, for the spectrum"
    )
    ozone_atm_cm: Annotated[float, Gt(0), Le(0.6)] = key(0.31, "ozone, for the spectrum")
    aerosol_optical_depth_500nm: Annotated[float, Ge(0), Le(2)] = key(0.1, "haze, for the spectrum")
    ground_albedo: Share = key(0.2, "broadband, for the spectrum of the diffuse light")
    sky: Literal["perez", "isotropic"] = key(
        "perez", "angular distribution of diffuse light", "Perez et al. 1993"
    )
