"""Radiation tables of loggers and weather services: what they say, in W m⁻² and UTC."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple import findings, timezones
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import column_names, time_columns, units, user_tables
from dapple.formats.text_table import Table
from dapple.formats.user_tables import Declared
from dapple.sky import direct_beam
from dapple.sky.sun import Site
from dapple.times import AHEAD, parse

MAX_STEP_MIN = 180.0


@dataclass(frozen=True)
class Radiation:
    """Measured broadband radiation.

    Attributes
    ----------
    table : pandas.DataFrame
        By ascending stamp (UTC): `global_w_m2`, and `diffuse_w_m2` where it was measured [W m⁻²];
        rows without a value of global are left out, diffuse may be NaN.
    interval_min : float
        Length of the interval of which a row is the mean [min]; 0: samples of a moment.
    label : {"instant", "start", "middle", "end"}
        What of its interval a stamp marks.
    is_declared : bool
        Whether configuration or layout say so; else it is assumed.
    where : str
        The file.
    findings : tuple of Finding
        What was noticed while reading.
    facts : dict
        What was read: layout, columns, units, rows, what was left out.
    """

    table: pd.DataFrame
    interval_min: float
    label: str
    is_declared: bool
    where: str
    findings: tuple[Finding, ...] = ()
    facts: dict = field(default_factory=dict)

    @property
    def step_min(self) -> float:
        """Median step between rows [min]; NaN for a single row."""
        steps = np.diff(self.table.index.asi8) / 60e9
        return float(np.median(steps)) if len(steps) else np.nan

    def intervals(self, label: str = "", interval_min: float | None = None) -> np.ndarray:
        """First and last moment (2, n) of every row, ns since 1970."""
        length_ns = (self.interval_min if interval_min is None else interval_min) * 60e9
        middle = self.table.index.asi8 + AHEAD[label or self.label] * length_ns
        return np.stack([middle - 0.5 * length_ns, middle + 0.5 * length_ns]).astype(np.int64)

    def middles(self) -> pd.DatetimeIndex:
        """The middle of every row's interval, UTC."""
        return pd.DatetimeIndex(pd.to_datetime(self.intervals().mean(axis=0), utc=True))


def read(
    path: str | Path,
    *,
    site: Site | None = None,
    global_column: str = "",
    diffuse_column: str = "",
    direct_column: str = "",
    direct_plane: str = "",
    **declared: Any,
) -> Radiation:
    """Read measured broadband radiation.

    Parameters
    ----------
    path : path
        A text table in any layout of `dapple.formats.user_tables`.
    site : Site or None
        Where the sun is looked up if direct radiation faces it.
    global_column, diffuse_column : str
        Global and diffuse irradiance on the horizontal; empty: found by the usual names or the
        file's layout. Diffuse may be absent.
    direct_column, direct_plane : str
        Direct radiation, facing the sun (`normal`) or on the horizontal; used where global or
        diffuse is absent.
    **declared
        Fields of `user_tables.Declared`; `unit` is of both (`units.POWERS`, `units.ENERGIES`),
        else W/m2.

    Raises
    ------
    InputError
        No file or column, direct radiation on an unknown plane, unreadable times, two values at one
        time, text that is no number, sums over an unknown interval, or nothing left.
    """
    said = Declared(**declared)
    source = user_tables.read(path, decimal=said.decimal)
    times = time_columns.of(source, said.time_column, "radiation.time_column")
    stated = source.timezone or times.zone
    zone = said.timezone or stated
    index = parse(times.text, path, zone, time_format=said.time_format)
    columns, plane = _columns(source, global_column, diffuse_column, direct_column, direct_plane)
    numbers = {kind: source.numbers(name, said.flags) for kind, name in columns.items()}
    table = pd.DataFrame({kind: one.values for kind, one in numbers.items()}, index=index)
    dropped = {columns[kind]: one.missing for kind, one in numbers.items() if one.missing}
    table = table.dropna(how="all")
    if "direct_w_m2" not in table:
        table = table[table["global_w_m2"].notna()]
    if table.empty:
        raise InputError(path, "no row with a value", "radiation by time", "Is the file complete?")
    repeated = int(table.index.duplicated().sum())
    table = _unique(table, str(path)).sort_index()
    label, length_min, is_declared = _interval(
        source, table, said.interval_label, said.interval_min
    )
    noticed, used = [], {}
    for kind, one in numbers.items():
        where = f"{path}, column {columns[kind]!r}"
        used[kind], doubt = units.of_column(
            one.unit,
            columns[kind],
            said.unit,
            where=where,
            key="radiation.unit",
            known=units.IRRADIANCES,
        )
        noticed += doubt
        step = length_min or said.interval_min or source.interval_min or _step_min(table)
        table[kind] *= units.irradiance_factor(used[kind] or "W/m2", step, where)
        if not used[kind] and (alike := units.like_power(step)):
            text = f"no unit, taken for W/m2: {alike[0]} over {step:g} min looks nearly the same"
            noticed.append(findings.note(where, text))
        if used[kind] in units.ILLUMINANCES:
            noticed.append(
                findings.warning(
                    where, "illuminance", "W m⁻²",
                    f"Taken for daylight, {units.DAYLIGHT_LM_PER_W:g} lx in a W m⁻²: within about "
                    "a tenth.",
                )
            )  # fmt: skip
    if plane:
        half = 0.5 * length_min * 60e9
        middle = table.index.asi8 + AHEAD[label] * length_min * 60e9
        table, text = direct_beam.complete(
            table, np.stack([middle - half, middle + half]), plane, site, str(path)
        )
        noticed.append(findings.note(path, text))
    noticed += [
        findings.note(
            path, f"{sum(flags.values())} values of {name} missing ({user_tables.counted(flags)})"
        )
        for name, flags in dropped.items()
    ]
    if repeated:
        noticed.append(findings.note(path, f"{repeated} rows twice, each read once"))
    if text := timezones.note(zone):
        noticed.append(
            findings.warning(path, f"the time zone {text}", "", "Declare the offset if it does.")
        )
    if said.timezone and stated and not timezones.is_same(said.timezone, stated):
        noticed.append(
            findings.warning(
                path, f"the zone {stated} in the file", f"{said.timezone}, as declared"
            )
        )
    facts = {
        "path": str(path),
        "layout": source.layout,
        "columns": {"time": times.text.name, **columns},
        "units": {columns[kind]: name or "W/m2 (assumed)" for kind, name in used.items()},
        "timezone": zone or "in the file",
        "interval_label": label,
        "interval_min": length_min,
        "rows": len(source.cells),
        "rows_used": len(table),
        "missing": dropped,
        "repeated": repeated,
    }
    return Radiation(table, length_min, label, is_declared, str(path), tuple(noticed), facts)


def _columns(
    source: Table, total: str, diffuse: str, direct: str, plane: str
) -> tuple[dict[str, str], str]:
    """Columns by quantity, and the plane of direct radiation; "" where it is not used."""
    found = {
        "global_w_m2": _column(source, total, "global", column_names.GLOBAL),
        "diffuse_w_m2": _column(source, diffuse, "diffuse", column_names.DIFFUSE),
    }
    columns = {kind: name for kind, name in found.items() if name}
    beam, plane = direct_beam.column(source, direct, plane)
    has_both = len(columns) == 2
    if beam is None or (has_both and not direct):
        if "global_w_m2" not in columns:
            source.require(column_names.GLOBAL, "radiation.global_column")
        return columns, ""
    if not columns:
        source.require(column_names.GLOBAL, "radiation.global_column")
    if not plane and "global_w_m2" in columns and not direct:
        return columns, ""  # global radiation is enough, and nobody says what the beam falls on
    if not plane:
        raise InputError(
            source.path,
            f"direct radiation ({beam}), and not on which plane it was measured",
            "`radiation.direct_plane: normal` (facing the sun) or `horizontal`",
            "Set it as the station's description says.",
        )
    return columns | {"direct_w_m2": beam}, plane


def _column(source: Table, name: str, role: str, usual: Sequence[str]) -> str | None:
    """The declared column, that of the layout, the one with a usual name, or None."""
    if name:
        return source.require([name], f"radiation.{role}_column")
    return source.known.get(role) or source.find(usual)


def _interval(
    source: Table, table: pd.DataFrame, label: str, interval_min: float
) -> tuple[str, float, bool]:
    """Label and length of the intervals, and whether somebody said so."""
    chosen = label or source.interval_label or ("instant" if source.interval_min == 0 else "")
    if chosen in ("", "instant"):
        return "instant", 0.0, bool(chosen)
    length = interval_min or source.interval_min or _step_min(table)
    if not length:
        raise InputError(
            source.path, "a single row", "the length of its interval", "Set `interval_min`."
        )
    if length > MAX_STEP_MIN:
        raise InputError(
            source.path,
            f"means over {length:g} min",
            f"{MAX_STEP_MIN:g} min or less: the course of a day is not in them",
            "Give hourly means or finer ones.",
        )
    return chosen, float(length), True


def _step_min(table: pd.DataFrame) -> float:
    steps = np.diff(table.index.asi8) / 60e9
    return float(np.median(steps)) if len(steps) else 0.0


def _unique(table: pd.DataFrame, where: str) -> pd.DataFrame:
    """Rows that are there twice read once; two values at one time are refused."""
    first = table[~table.index.duplicated()]
    again = table[table.index.duplicated()]
    before = first.reindex(again.index).to_numpy()
    same = (before == again.to_numpy()) | np.isnan(before) | np.isnan(again.to_numpy())
    if not same.all():
        time = again.index[~same.all(axis=1)][0]
        raise InputError(
            where,
            f"two different values at {time}",
            "each time once",
            "Remove one of the rows; where a clock was set back, give the zone or the offset.",
        )
    return first
