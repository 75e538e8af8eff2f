"""Any sensor's series against its records, chosen on the plan; and sums of a day by sensor."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.figures import style
from dapple.report import packing
from dapple.report.blocks import Block, Chart, Table, table
from dapple.report.run_light import RunLight
from dapple.stats import daily_light
from dapple.stats.pairs import measured, of_sensors
from dapple.stats.predictive import COVERAGE

MOST_VALUES = 1_500_000
"""Values of series within the page; times are thinned evenly above."""
LONGEST_FLECK_STEP_MIN = 10.0
"""Steps above which single sunflecks cannot be told apart."""


def blocks(run: RunLight) -> Iterator[Block]:
    """The chart to choose sensors in, then sums by reconstruction and by sensor."""
    yield _chart(run)
    sums = {name: _sums(run, name) for name in run.light}
    columns = [name for name in next(iter(sums.values())) if name != "sensor"]
    means = [{"reconstruction": name} | dict(one[columns].mean()) for name, one in sums.items()]
    note = _when(run)
    yield _table(pd.DataFrame(means), "Light of a day, mean over sensors", note)
    yield _table(sums[run.best], f"Light of a day at each sensor ({style.label(run.best)})", note)


def _table(frame: pd.DataFrame, title: str, note: str) -> Table:
    return table(frame.dropna(axis=1, how="all"), title, note=note, named=style.label)


def _when(run: RunLight) -> str:
    """From when to when sums go, which is less than a day where the run is."""
    first, last = run.local_times[0], run.local_times[-1]
    days = run.local_times.normalize().nunique()
    span = f"{first:%d %B %Y %H:%M} to {last:%d %B %Y %H:%M} ({run.timezone})"
    mean = f", mean of {days} days" if days > 1 else ""
    return (
        f"Sums over the simulated times, {span}{mean}. They are less than a day's where the sun "
        "stands high at the first or the last of them."
    )


def _sums(run: RunLight, name: str) -> pd.DataFrame:
    """Light integral and sunflecks of every sensor in one reconstruction."""
    light = run.light[name].transpose("sensor", "time")
    par, direct = (light[f"{part}_umol_m2_s"].to_numpy() for part in ("par", "par_direct"))
    times = run.local_times
    found = pd.DataFrame({"sensor": run.sensors["sensor"]})
    found["integral_mol_m2"] = daily_light.integral_mol_m2(par, times)
    open_sky = daily_light.integral_mol_m2(run.open_sky[None], times)[0]
    found["open_share"] = 100 * found["integral_mol_m2"] / open_sky
    flecks = daily_light.sunflecks(par, direct, run.open_beam, times)
    found["sunfleck_share"] = 100 * flecks.time_share
    found["sunfleck_light_share"] = 100 * flecks.light_share
    step_min = np.diff(times.to_numpy()) / np.timedelta64(1, "m")
    if len(step_min) and np.median(step_min) <= LONGEST_FLECK_STEP_MIN:
        found["n_sunflecks"] = flecks.per_day
        found["sunfleck_min"] = flecks.median_min
    return found


def _chart(run: RunLight) -> Chart:
    names, every = list(run.light), _stride(run)
    times = run.times[::every]
    series = [
        run.light[name]["par_umol_m2_s"].transpose("sensor", "time").to_numpy()[:, ::every]
        for name in names
    ]
    sums = {name: _sums(run, name) for name in names}
    data: dict[str, Any] = {
        "sensors": run.sensors["sensor"].tolist(),
        "x_m": run.sensors["x_m"].round(3).tolist(),
        "y_m": run.sensors["y_m"].round(3).tolist(),
        "names": [style.label(name) for name in names],
        "colours": [style.colour(name, tuple(names)) for name in names],
        "first": names.index(run.best),
        "times": packing.local(times, run.timezone),
        "timezone": run.timezone,
        "simulated": packing.light(np.stack(series)),
        "mean": [packing.known(one.mean(axis=1), 1) for one in series],
        "integral": [packing.known(sums[name]["integral_mol_m2"], 2) for name in names],
        "flecks": [packing.known(sums[name]["sunfleck_share"], 1) for name in names],
        "records": _records(run),
        "r": _scores(run, "r", 3),
        "rmse": _scores(run, "rmse", 1),
        "bounds": _bounds(run),
    }
    caption = (
        "Choose a sensor on the plan or in the list: its light in every reconstruction, and what "
        "was recorded there."
    )
    if data["r"]:
        caption += " Pale on the plan: nothing is known, as no record of them counts."
    if every > 1:
        caption += f" Every {every}th time is shown."
    if data["bounds"]:
        caption += (
            f" The band is where {COVERAGE:.0%} of records are expected around the chosen "
            "reconstruction, from the errors in worlds where light is known."
        )
    return Chart("sensors", "sensors", caption, data)


def _stride(run: RunLight) -> int:
    """Every how many times a series is shown, so that the page stays small."""
    return -(-len(run.light) * len(run.sensors) * len(run.times) // MOST_VALUES)


def _records(run: RunLight) -> dict[str, Any] | None:
    if run.records is None:
        return None
    found = _of_all_sensors(run, run.records["reconstruction"].iloc[0], "measured")
    return {
        "times": packing.local(pd.DatetimeIndex(found["time"].to_numpy()), run.timezone),
        "par": packing.light(found.to_numpy()),
    }


def _bounds(run: RunLight) -> dict[str, Any] | None:
    """Predictive interval of every reconstruction, sensor and record."""
    if run.records is None or not {"low", "high"} <= set(run.records):
        return None
    return {
        edge: packing.light(np.stack([_of_all_sensors(run, name, edge) for name in run.light]))
        for edge in ("low", "high")
    }


def _of_all_sensors(run: RunLight, reconstruction: str, column: str) -> xr.DataArray:
    """A column of the records of one reconstruction, thinned; NaN where there are none."""
    times = measured(run.records)["time"].to_numpy()
    sensors = run.sensors["sensor"].to_numpy(str)
    columns = 1 + 2 * len(run.light)  # what is measured, and two bounds of every reconstruction
    every = -(-len(sensors) * len(times) * columns // MOST_VALUES)
    found = of_sensors(run.records, reconstruction, column)
    return found.reindex(sensor=sensors, time=times[::every])


def _scores(run: RunLight, column: str, digits: int) -> list[list[float | None]] | None:
    """A score by reconstruction and sensor."""
    if run.per_sensor is None:
        return None
    wide = run.per_sensor.pivot(index="reconstruction", columns="sensor", values=column)
    wide = wide.reindex(index=list(run.light), columns=run.sensors["sensor"])
    return [packing.known(row, digits) for row in wide.to_numpy(float)]
