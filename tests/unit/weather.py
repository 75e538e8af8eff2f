"""Days of weather with known truth, and the tables that a station would make of them."""

import numpy as np
import pandas as pd

from dapple.sky import sun
from dapple.sky.radiation_table import Radiation

FREIBURG = sun.Site(48.0009, 7.8003, 230.0)


def minutes(days, *, start="2023-08-01", site=FREIBURG, clouds=True, seed=1):
    """Global and diffuse radiation of every minute: clear hours and fields of clouds [W m⁻²]."""
    times = pd.date_range(start, periods=days * 1440, freq="min", tz="UTC", unit="ns")
    clear = sun.clear_sky(times, site)
    diffuse = clear["diffuse_w_m2"].to_numpy()
    beam = clear["global_w_m2"].to_numpy() - diffuse
    share = np.ones(len(times))
    if clouds:
        rng = np.random.default_rng(seed)
        field = np.repeat(rng.normal(size=len(times) // 12 + 1), 12)[: len(times)]
        cover = np.repeat(rng.normal(scale=1.5, size=days), 1440)
        share = 1 / (1 + np.exp(-3 * (field - cover)))
        share[np.repeat(rng.random(days) < 0.3, 1440)] = 1.0  # some days are clear
    scattered = diffuse + 0.3 * (1 - share) * beam
    return pd.DataFrame(
        {"global_w_m2": share * beam + scattered, "diffuse_w_m2": scattered}, index=times
    )


def dark(days, clear_days, *, start, site=FREIBURG, seed=1):
    """Overcast days of any thickness, that changes by the hour, and some clear ones [W m⁻²]."""
    truth = minutes(days, start=start, site=site, clouds=False)
    rng = np.random.default_rng(seed)
    hours = np.zeros(24 * days)
    for hour in range(1, len(hours)):
        hours[hour] = 0.7 * hours[hour - 1] + 0.7 * rng.normal()
    thickness = np.repeat(rng.normal(scale=0.4, size=days), 1440)
    thickness += 0.25 * np.interp(np.arange(len(truth)) / 60.0, np.arange(len(hours)), hours)
    through = 1.0 / (1.0 + 3.0 * np.exp(thickness))
    through[np.isin(np.arange(len(truth)) // 1440, rng.choice(days, clear_days, False))] = 1.0
    total = through * truth["global_w_m2"]
    scattered = total.where(through < 1.0, truth["diffuse_w_m2"])
    return pd.DataFrame({"global_w_m2": total, "diffuse_w_m2": scattered})


def station(
    truth,
    step_min,
    label,
    *,
    factor=1.0,
    ahead_min=0,
    assumed=None,
    is_declared=True,
    only_global=False,
):
    """What a station writes: samples or means, in another unit or with another clock."""
    if label == "instant":
        table = truth.iloc[::step_min].copy()
    else:
        whole = len(truth) // step_min * step_min
        means = truth.to_numpy()[:whole].reshape(-1, step_min, 2).mean(axis=1)
        into = {"start": 0.0, "middle": 0.5, "end": 1.0}[label] * step_min
        # A minute's value stands for the minute around it.
        stamps = truth.index[:whole:step_min] + pd.Timedelta(minutes=into - 0.5)
        table = pd.DataFrame(means, columns=truth.columns, index=stamps)
    table = (table * factor).round(6)
    table.index = table.index + pd.Timedelta(minutes=ahead_min)
    if only_global:
        table = table[["global_w_m2"]]
    read_as = assumed or label
    length = 0.0 if read_as == "instant" else float(step_min)
    facts = {"columns": {"global_w_m2": "G", "diffuse_w_m2": "D"}, "timezone": "UTC"}
    return Radiation(table, length, read_as, is_declared, "station.csv", (), facts)
