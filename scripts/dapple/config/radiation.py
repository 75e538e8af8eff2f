"""What radiation reaches the tree."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Ge, Gt, Le

from dapple.config.base import Positive, Share, TimedTable, key
from dapple.sky import models

if TYPE_CHECKING:
    SkyModel = str
else:
    SkyModel = Literal[models.NAMES]
"""Which models there are is said by the files of `dapple.sky.models`."""
ATMOSPHERE = {
    "precipitable_water_cm",
    "ozone_atm_cm",
    "aerosol_optical_depth_500nm",
    "ground_albedo",
}


class Radiation(TimedTable):
    """Broadband radiation that reaches the top of the tree."""

    kind: Literal["clear_sky", "table"] = key("clear_sky", "modelled, or read from a file")
    global_column: str = key(
        "", "column of global radiation on the horizontal; empty: by its usual name"
    )
    diffuse_column: str = key(
        "", "column of diffuse radiation on the horizontal; empty: by its usual name, or none"
    )
    direct_column: str = key(
        "",
        "column of direct radiation, which tells the one of the others that is not there; empty: "
        "by its usual name",
    )
    direct_plane: Literal["", "normal", "horizontal"] = key(
        "", "that the direct radiation falls on: facing the sun, or level; empty: as its name says"
    )
    unit: Literal[
        "", "W/m2", "kW/m2", "mW/cm2", "J/m2", "kJ/m2", "MJ/m2", "J/cm2", "Wh/m2", "kWh/m2",
        "kJ/m2/h", "MJ/m2/h", "J/cm2/h", "kJ/m2/min", "MJ/m2/d", "lx", "klx",
    ] = key("", "of all columns, sums over the interval; empty: of the header")  # fmt: skip
    diffuse_model: Literal["erbs", "dirint"] = key(
        "erbs", "splits global radiation where diffuse is unknown", "Erbs et al. 1982"
    )
    implausible: Literal["refuse", "report"] = key(
        "refuse", "what to do with a table that physics contradicts"
    )
    max_gap_min: Positive = key(60.0, "samples further apart are filled by the model")
    linke_turbidity: Positive = key(3.0, "haze of the clear-sky model", "Ineichen and Perez 2002")
    precipitable_water_cm: Annotated[float, Gt(0), Le(8)] = key(
        2.0, "water vapour, for the spectrum"
    )
    ozone_atm_cm: Annotated[float, Gt(0), Le(0.6)] = key(0.31, "ozone, for the spectrum")
    aerosol_optical_depth_500nm: Annotated[float, Ge(0), Le(2)] = key(0.1, "haze, for the spectrum")
    ground_albedo: Share = key(0.2, "broadband, for the spectrum of the diffuse light")
    sky: SkyModel = key("perez", "how diffuse light is spread over the sky", "Perez et al. 1993")
    sky_table: str = key(
        "", "sky: measured: CSV of zenith_deg, azimuth_deg, radiance and, if it changes, time_utc"
    )

    def broadband(self) -> dict[str, Any]:
        """Options of `sky.radiation_series.broadband`, without the path."""
        return self.model_dump(exclude={"path", "sky", "sky_table", *ATMOSPHERE})

    def atmosphere(self) -> dict[str, Any]:
        """Options of `sky.sky_radiance.sky_dataset`."""
        return {"model": self.sky} | self.model_dump(include=ATMOSPHERE)
