"""Direct radiation of a table: what it tells of the global or diffuse radiation that is missing."""

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats import column_names
from dapple.formats.text_table import Table
from dapple.sky.sun import Site, position

SAMPLES_MIN = 2.0
"""Step at which the height of the sun is averaged over an interval."""
LIGHT_W_M2 = 50.0
MOST_ABOVE_GLOBAL = 0.1
"""Share of rows with more direct than global radiation that chance and calibration explain."""
WAYS = {"normal": "facing the sun", "horizontal": "on the horizontal"}


def column(source: Table, declared: str, plane: str) -> tuple[str | None, str]:
    """Column of direct radiation, and the plane that is declared or that its name tells.

    Raises
    ------
    InputError
        The declared column is not there.
    """
    named = {"normal": column_names.DIRECT_NORMAL, "horizontal": column_names.DIRECT_HORIZONTAL}
    if declared:
        found = source.require([declared], "radiation.direct_column")
        told = [way for way, names in named.items() if column_names.first(names, [found])]
        return found, plane or (told[0] if told else "")
    for way, names in named.items():
        if name := source.find(names):
            return name, plane or way
    return source.find(column_names.DIRECT), plane


def complete(
    table: pd.DataFrame, intervals_ns: np.ndarray, plane: str, site: Site | None, where: str
) -> tuple[pd.DataFrame, str]:
    """Global radiation as diffuse plus direct, or diffuse as global less direct.

    Parameters
    ----------
    table : pandas.DataFrame
        By stamp: `direct_w_m2`, and `global_w_m2` or `diffuse_w_m2` or both [W m⁻²].
    intervals_ns : (2, n)
        First and last moment of each row [ns since 1970].
    plane : {"normal", "horizontal"}
        That the direct radiation falls on.
    site : Site or None
        Needed for `normal`.
    where : str
        The file, for messages.

    Returns
    -------
    table
        `global_w_m2` and `diffuse_w_m2`, rows without global left out; diffuse is NaN where
        direct is missing.
    text
        What was made of what.

    Raises
    ------
    InputError
        More direct than global radiation in many rows, or no site.
    """
    beam = table["direct_w_m2"].to_numpy(float)
    if plane == "normal":
        if site is None:
            raise InputError(where, "direct radiation that faces the sun", "a site", "Give one.")
        beam = beam * mean_cosine(intervals_ns, site)
    unknown = np.full(len(table), np.nan)
    total = table["global_w_m2"].to_numpy(float) if "global_w_m2" in table else unknown
    diffuse = table["diffuse_w_m2"].to_numpy(float) if "diffuse_w_m2" in table else unknown
    lit = total > LIGHT_W_M2
    above = beam[lit] > 1.05 * total[lit]
    if above.any() and above.mean() > MOST_ABOVE_GLOBAL:
        other = "horizontal" if plane == "normal" else "normal"
        raise InputError(
            where,
            f"more direct than global radiation in {100 * above.mean():.0f} % of rows",
            "direct radiation as a part of global",
            f"Check the unit, or set `radiation.direct_plane: {other}`.",
        )
    made = []
    if np.isnan(total).any():
        made.append(f"global radiation is diffuse plus direct, which was measured {WAYS[plane]}")
    if np.isnan(diffuse).any():
        made.append(f"diffuse radiation is global less direct, which was measured {WAYS[plane]}")
    both = {
        "global_w_m2": np.where(np.isnan(total), diffuse + beam, total),
        "diffuse_w_m2": np.where(np.isnan(diffuse), np.maximum(total - beam, 0.0), diffuse),
    }
    whole = pd.DataFrame(both, index=table.index)
    return whole[whole["global_w_m2"].notna()], "; ".join(made)


def mean_cosine(intervals_ns: np.ndarray, site: Site) -> np.ndarray:
    """Mean cosine (n,) of the sun's zenith angle over intervals (2, n), 0 while it is down."""
    start, end = (edge.astype(float) for edge in intervals_ns)
    length_min = (end[0] - start[0]) / 60e9 if len(start) else 0.0
    samples = max(1, round(length_min / SAMPLES_MIN))
    share = (np.arange(samples) + 0.5) / samples
    moments = (start[:, None] + share * (end - start)[:, None]).astype(np.int64)
    times = pd.DatetimeIndex(pd.to_datetime(moments.ravel(), utc=True))
    zenith = position(times, *site.place)["sun_zenith_deg"].to_numpy()
    up = np.maximum(np.cos(np.radians(zenith)), 0.0)
    return up.reshape(len(start), samples).mean(axis=1)
