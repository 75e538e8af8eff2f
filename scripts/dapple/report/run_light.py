"""The light of a run as the report shows it: series, records and sky, read once."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
import yaml

from dapple.formats import netcdf, tables
from dapple.report.recommendation import KNOWN
from dapple.sky.open_sky import open_beam, open_sky_par
from dapple.timezones import find_timezone


@dataclass(frozen=True)
class RunLight:
    """Simulated and measured light.

    Attributes
    ----------
    light : dict of str to Dataset
        By reconstruction, in the order of the configuration.
    sensors : DataFrame
        `sensor, x_m, y_m, z_m`, in the order of the light.
    sky : Dataset
    records : DataFrame or None
        As `stats.pairs.pair` makes them, with `part`.
    per_sensor : DataFrame or None
        `reconstruction, sensor, r, rmse, bias`.
    timezone : str
        Of the site.
    """

    light: dict[str, xr.Dataset]
    sensors: pd.DataFrame
    sky: xr.Dataset
    records: pd.DataFrame | None
    per_sensor: pd.DataFrame | None
    timezone: str

    @property
    def times(self) -> pd.DatetimeIndex:
        """(t,) in UTC."""
        return netcdf.times(self.sky)

    @property
    def local_times(self) -> pd.DatetimeIndex:
        """(t,) on the clock of the site."""
        return self.times.tz_convert(find_timezone(self.timezone))

    @property
    def sun_height_deg(self) -> np.ndarray:
        """(t,) height of the sun above the horizon."""
        return 90.0 - self.sky["sun_zenith_deg"].to_numpy()

    @property
    def open_beam(self) -> np.ndarray:
        """(t,) PAR of the direct beam where no tree stands."""
        return open_beam(self.sky)

    @property
    def open_sky(self) -> np.ndarray:
        """(t,) PAR where no tree stands."""
        return open_sky_par(self.sky).to_numpy()

    @property
    def best(self) -> str:
        """Reconstruction nearest to records, else the first: what is shown first."""
        names = [name for name in self.light if name != KNOWN] or list(self.light)
        if self.per_sensor is None:
            return names[0]
        error = self.per_sensor.groupby("reconstruction")["rmse"].mean()
        return str(error.reindex(names).fillna(np.inf).idxmin())


def read(folder: Path) -> RunLight | None:
    """The light of a run's folder, or None where no light was computed."""
    configured = folder / "config.yaml"
    if not configured.is_file() or not (folder / "sky/sky.nc").is_file():
        return None
    settings = yaml.safe_load(configured.read_text(encoding="utf-8"))
    files = {name: folder / f"light/{name}.nc" for name in settings["reconstructions"]}
    light = {name: netcdf.read(path) for name, path in files.items() if path.is_file()}
    if not light:
        return None
    labels = next(iter(light.values()))["sensor"].to_numpy().astype(str)
    sensors = tables.read(folder / "sky/sensors.csv")
    sensors["sensor"] = sensors["sensor"].astype(str)
    return RunLight(
        light,
        sensors.set_index("sensor").loc[labels].reset_index(),
        netcdf.read(folder / "sky/sky.nc"),
        _table(folder / "statistics/records.csv"),
        _table(folder / "statistics/per_sensor.csv"),
        settings["site"]["timezone"],
    )


def _table(path: Path) -> pd.DataFrame | None:
    return tables.read(path) if path.is_file() else None
