"""Measured and simulated PAR through the day, one small panel per sensor."""

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib.dates as mdates
import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from dapple.errors import InputError
from dapple.figures import style
from dapple.formats import netcdf, tables
from dapple.stats import measures
from dapple.stats.pairs import simulated
from dapple.timezones import find_timezone

SHADED = 0.5
"""Light below this share of the brightest sensor's at the time is shade."""
R_APART_POINTS = 21
"""Between the r of two reconstructions: five of them leave room for the sensor's name."""


def choose_sensors(records: pd.DataFrame, *, count: int = 6) -> list[str]:
    """Pick sensors whose mean light lies evenly between the darkest and the brightest.

    Deep and partial shade are then all there, however many sensors stand in each. Sensors that
    are never shaded show the open sky, and are chosen only where too few others are left.

    Parameters
    ----------
    records : DataFrame
        `sensor`, `time`, and `measured`, or `simulated` where nothing was measured.
    count : int
        How many; all where there are fewer.

    Returns
    -------
    list of str
        Darkest first.
    """
    light = records["measured" if "measured" in records else "simulated"]
    sensor = records["sensor"].to_numpy()
    mean = light.groupby(sensor).mean().dropna().sort_values(kind="stable")
    if len(mean) <= count:
        return list(mean.index)
    brightest = light.groupby(records["time"].to_numpy()).transform("max")
    is_shaded = (light < SHADED * brightest).groupby(sensor).any()[mean.index]
    mean = pd.concat([mean[is_shaded], mean[~is_shaded][: max(0, count - is_shaded.sum())]])
    wanted = np.linspace(mean.iloc[0], mean.iloc[-1], count)
    chosen: list[str] = []
    for value in wanted:
        left = mean.drop(chosen)
        chosen.append(str((left - value).abs().idxmin()))
    return list(mean.index[mean.index.isin(chosen)])


def of_run(inputs: Mapping[str, Any], options: Mapping[str, Any]) -> Figure:
    """From `records` of a run, or from its `light` where there are none.

    Parameters
    ----------
    inputs : mapping
        Paths.
    options : mapping
        `sensors` to draw (none: from the darkest to the brightest),
        `reconstructions` of the light, `timezone` of the axis.
    """
    names, chosen = options["reconstructions"], list(options["sensors"])
    if inputs["records"]:
        records = tables.read(inputs["records"])
        r = measures.per_sensor(records)
    else:
        light = zip(names, inputs["light"], strict=True)
        parts = [simulated(netcdf.read(path), name) for name, path in light]
        records, r = pd.concat(parts, ignore_index=True), None
    return draw(
        records, chosen or choose_sensors(records), timezone=options["timezone"], per_sensor=r
    )


@style.styled
def draw(
    records: pd.DataFrame,
    sensors: Sequence[str],
    *,
    timezone: str,
    per_sensor: pd.DataFrame | None = None,
    components_of: str | None = None,
    columns: int = 3,
) -> Figure:
    """Small multiples as in Frey et al. (2025), figure 4.

    Parameters
    ----------
    records : DataFrame
        `reconstruction, sensor, time` (UTC), `simulated` and, where there are records, `measured`
        [µmol m⁻² s⁻¹]; where components are drawn also `direct`, the simulated direct beam; with
        `low` and `high` the predictive interval of the first reconstruction is drawn.
    sensors : sequence of str
        Sensors to draw, one panel each, in this order.
    timezone : str
        Local time zone of the site, for the note below the axis, as in "Europe/Berlin".
    per_sensor : DataFrame, optional
        `reconstruction, sensor, r`: writes r into the panels.
    components_of : str, optional
        Reconstruction whose sky and scattered light is filled in grey under its direct beam.
    columns : int
        Panels side by side.
    """
    _check(records, sensors)
    names = tuple(records["reconstruction"].unique())
    columns = min(columns, len(sensors))
    rows = -(-len(sensors) // columns)
    figure = style.new_figure(2.9 * columns + 0.4, 1.95 * rows + 0.9)
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes, sensor in zip(panels, sensors, strict=False):
        own = records[records["sensor"] == sensor]
        _panel(axes, own, names, components_of)
        axes.set_title(f"sensor {sensor}")
        if per_sensor is not None:
            _write_r(axes, per_sensor[per_sensor["sensor"] == sensor], names)
    for axes in panels[len(sensors) :]:
        axes.set_visible(False)
    # The panels above an empty place are the lowest of their column: they show the hours too.
    for axes in panels[max(len(sensors) - columns, 0) : len(sensors)]:
        axes.tick_params(labelbottom=True)
    _time_axis(panels[0], records["time"])
    top = records.filter(["measured", "simulated"]).max().max()
    panels[0].set_ylim(0, 1.05 * max(top, 1.0))  # a night has an axis too
    figure.supylabel(f"PAR [{style.PAR_UNIT}]", fontsize=9)
    figure.supxlabel(_time_note(records["time"], timezone), fontsize=9)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    return figure


def _panel(axes: Axes, own: pd.DataFrame, names: tuple[str, ...], components_of: str | None):
    if components_of is not None:
        time, simulated, direct = _line(own, components_of, "simulated", "direct")
        text = f"{style.label(components_of)}: sky and scattered"
        axes.fill_between(time, 0, simulated - direct, color="#DDDDDD", lw=0, label=text)
    if "measured" in own:
        measured = _line(own, own["reconstruction"].iloc[0], "measured")
        axes.plot(*measured, color=style.COLOURS["measured"], lw=1.6, alpha=0.9, label="measured")
    if "low" in own:
        band = _line(own, names[0], "low", "high")
        text = f"90 % of records, {style.label(names[0])}"
        axes.fill_between(*band, color=style.colour(names[0], names), alpha=0.15, lw=0, label=text)
    for name in names:
        line = _line(own, name, "simulated")
        axes.plot(*line, color=style.colour(name, names), lw=1.1, label=style.label(name))


def _line(own: pd.DataFrame, reconstruction: str, *columns: str) -> list[np.ndarray]:
    """Times and values, with a hole where records are missing: no line across what is unknown."""
    one = own[own["reconstruction"] == reconstruction].sort_values("time")
    # Matplotlib would convert marked times to a zone of its own.
    time = one["time"].dt.tz_convert("UTC").dt.tz_localize(None).to_numpy()
    step = np.diff(time)
    holes = np.zeros(0, int)
    if len(step):
        holes = np.nonzero(step > 3 * np.median(step))[0] + 1
    values = [np.insert(one[name].to_numpy(float), holes, np.nan) for name in columns]
    return [np.insert(time, holes, time[holes]), *values]


def _write_r(axes: Axes, rows: pd.DataFrame, names: tuple[str, ...]) -> None:
    """r of each reconstruction in its colour, right-aligned above the panel."""
    r = rows.dropna(subset="r").set_index("reconstruction")["r"]
    words = [(f"{r[n]:.2f}".replace("-", "−"), style.colour(n, names)) for n in names if n in r]
    if words:
        words.insert(0, ("r =", "#555555"))
    for place, (text, colour) in enumerate(reversed(words)):
        axes.annotate(
            text,
            (1, 1),
            xycoords="axes fraction",
            xytext=(-R_APART_POINTS * place, 4),
            textcoords="offset points",
            ha="right",
            fontsize=8,
            color=colour,
        )


def _time_axis(axes: Axes, times: pd.Series) -> None:
    locator = mdates.AutoDateLocator(minticks=3, maxticks=6)
    axes.xaxis.set_major_locator(locator)
    several_days = times.min().date() != times.max().date()
    axes.xaxis.set_major_formatter(mdates.DateFormatter("%d %b\n%H" if several_days else "%H:%M"))


def _time_note(times: pd.Series, timezone: str) -> str:
    local = times.min().tz_convert(find_timezone(timezone))
    hours = local.utcoffset().total_seconds() / 3600
    return f"UTC on {times.min():%d %B %Y} (local time: UTC {hours:+g} h, {timezone})"


def _check(records: pd.DataFrame, sensors: Sequence[str]) -> None:
    known = set(records["sensor"])
    if unknown := [sensor for sensor in sensors if sensor not in known]:
        raise InputError(
            "figures.sensors",
            ", ".join(unknown),
            f"labels such as {', '.join(sorted(known)[:5])}",
            "Choose sensors of the sensor table that have records.",
        )
    if not len(sensors):
        raise InputError(
            "figures.sensors", "no sensor", "at least one", "Name sensors, or let them be chosen."
        )
    if records["time"].dt.tz is None:
        raise InputError("records", "naive times", "UTC", "Localise the times: tz_localize('UTC').")
