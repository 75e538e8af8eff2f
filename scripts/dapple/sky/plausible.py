"""Can a radiation table be right? Its unit, clock, columns and single rows, against physics."""

from dataclasses import replace

import numpy as np
import pandas as pd

from dapple import findings
from dapple.findings import Finding
from dapple.sky import radiation_clock, radiation_unit
from dapple.sky.radiation_rows import LIGHT_W_M2, SUN_HIGH_DEG, Rows, beside_clear_sky
from dapple.sky.radiation_table import Radiation
from dapple.sky.sun import Site

OFFSET_W_M2 = 20.0
"""Thermopiles read a few watts below zero at night."""
LEAST_DIFFUSE = 0.3
"""Diffuse over that of the clear-sky model: the air alone scatters more."""


def check(
    radiation: Radiation, site: Site, *, linke_turbidity: float | None = 3.0
) -> list[Finding]:
    """What speaks against a table, the likeliest reason first.

    Parameters
    ----------
    radiation : Radiation
    site : Site
    linke_turbidity : float or None
        Of the clear sky that it is held against; see `sun.clear_sky`.

    Returns
    -------
    list of Finding
        Errors: columns exchanged, another unit, another time, what is physically impossible.
        Warnings: values that are extremely rare.

    Notes
    -----
    Limits of the Baseline Surface Radiation Network: Long and Shi (2008). Days are judged by their
    energy, so that short cloud edges and offsets of sensors at night raise no doubt.
    """
    rows = beside_clear_sky(radiation, site, linke_turbidity)
    off = radiation_clock.offset(radiation, site, linke_turbidity=linke_turbidity)
    wrong_time = radiation_clock.check(radiation, site, off)
    if off is not None and wrong_time is not None:
        # Units are judged as if the clock were right: a day that is cut in two is no bright day.
        moved = radiation.table.set_axis(
            radiation.table.index + pd.Timedelta(minutes=off.minutes), axis="index"
        )
        rows = beside_clear_sky(replace(radiation, table=moved), site, linke_turbidity)
    if (exchanged := _exchanged(radiation, rows)) is not None:
        return [exchanged]
    clear = radiation_unit.clear_level(radiation, rows)
    unit = radiation_unit.check(radiation, rows, clear)
    doubts = [one for one in (unit, wrong_time, _diffuse(radiation, rows)) if one is not None]
    if any(one.level == "error" for one in doubts):
        return doubts
    doubts += _limits(radiation, rows)
    if unit is None and clear is None:
        doubts.append(radiation_unit.untold(radiation, rows))
    return doubts


def _exchanged(radiation: Radiation, rows: Rows) -> Finding | None:
    """Diffuse above global most of the day, and plausible the other way round."""
    lit = (np.fmax(rows.total, rows.diffuse) > LIGHT_W_M2) & np.isfinite(rows.diffuse)
    if lit.sum() < 3 or (rows.diffuse[lit] > 1.1 * rows.total[lit]).mean() < 0.5:
        return None
    columns = radiation.facts.get("columns", {})
    names = [columns.get(key, key) for key in ("global_w_m2", "diffuse_w_m2")]
    return findings.error(
        radiation.where,
        "more diffuse than global radiation in "
        f"{100 * (rows.diffuse > rows.total)[lit].mean():.0f} % of rows",
        "diffuse radiation as a part of global",
        f"The columns look exchanged: set `radiation.global_column: {names[1]}` and "
        f"`radiation.diffuse_column: {names[0]}`, or check the unit of each.",
    )


def _diffuse(radiation: Radiation, rows: Rows) -> Finding | None:
    """Diffuse radiation that the air alone exceeds, or of more rows above global than chance."""
    there = (rows.elevation_deg > SUN_HIGH_DEG) & np.isfinite(rows.diffuse)
    if there.sum() < 4:
        return None
    middle = float(np.median(rows.diffuse[there] / np.maximum(rows.clear_diffuse[there], 1.0)))
    # A dark day is dark in diffuse light as well.
    share = float(np.median(rows.total[there] / np.maximum(rows.clear_total[there], 1.0)))
    if middle < LEAST_DIFFUSE and share > LEAST_DIFFUSE:
        return findings.error(
            radiation.where,
            f"diffuse radiation of {100 * middle:.0f} % of a clear sky's (median)",
            f"at least {100 * LEAST_DIFFUSE:.0f} %: clean air alone scatters more",
            "Check the unit of the diffuse column, or leave it out of the file: then a model "
            "splits global radiation.",
        )
    lit = there & (rows.total > LIGHT_W_M2)
    above = rows.diffuse[lit] > 1.1 * rows.total[lit]
    if lit.sum() >= 4 and above.mean() > 0.1:
        return findings.warning(
            radiation.where,
            f"more diffuse than global radiation in {100 * above.mean():.0f} % of rows",
            "diffuse radiation as a part of global",
            "Diffuse is cut at global; check both sensors.",
        )
    return None


def _limits(radiation: Radiation, rows: Rows) -> list[Finding]:
    """Single rows beyond what is physically possible (errors) or extremely rare (warnings)."""
    found = []
    curve = rows.extraterrestrial * rows.cosine**1.2
    for name, values, possible, rare in (
        ("global", rows.total, 1.5 * curve + 100.0, 1.2 * curve + 50.0),
        ("diffuse", rows.diffuse, 0.95 * curve + 50.0, 0.75 * curve + 30.0),
    ):
        known = np.isfinite(values)
        beyond = known & ((values > possible) | (values < -OFFSET_W_M2))
        if beyond.any():
            row = int(np.flatnonzero(beyond)[0])
            found.append(
                findings.error(
                    radiation.where,
                    f"{name} radiation of {values[row]:.4g} W m⁻² at {radiation.table.index[row]} "
                    f"with the sun {rows.elevation_deg[row]:.0f}° high"
                    + (f", and {beyond.sum() - 1} more such rows" if beyond.sum() > 1 else ""),
                    f"{-OFFSET_W_M2:g} to {possible[row]:.4g} W m⁻², the physically possible "
                    "(Long and Shi 2008)",
                    _of_impossible(rows, beyond),
                )
            )
            continue
        unusual = known & (values > rare)
        if unusual.any():
            row = int(np.flatnonzero(unusual)[0])
            found.append(
                findings.warning(
                    radiation.where,
                    f"{unusual.sum()} of {known.sum()} values of {name} radiation that are "
                    f"extremely rare, first {values[row]:.4g} W m⁻² at "
                    f"{radiation.table.index[row]}",
                    f"at most {rare[row]:.4g} W m⁻² (Long and Shi 2008)",
                    "Edges of clouds give such values for a minute.",
                )
            )
    return found


def _of_impossible(rows: Rows, beyond: np.ndarray) -> str:
    """What to check first where rows are impossible."""
    if beyond.sum() > 2 and np.median(rows.elevation_deg[beyond]) < SUN_HIGH_DEG:
        first = (
            "So much light at a low sun is that of another hour: check `radiation.timezone` and "
            "the offset that the clock kept, then date and place"
        )
    else:
        first = "Check unit, time zone and place"
    return f"{first}; remove the rows if they are faults: gaps are filled."
