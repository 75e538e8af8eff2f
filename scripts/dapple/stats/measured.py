"""Measured PAR series of loggers: what the table says, in µmol m⁻² s⁻¹, UTC and sensor labels."""

import re
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
from dapple.formats.table_numbers import Numbers
from dapple.formats.text_table import Table
from dapple.formats.user_tables import Declared
from dapple.times import AHEAD, parse

MIN_PAR_UMOL_M2_S = -20.0  # offsets of a sensor in the dark
MAX_PAR_UMOL_M2_S = 4000.0  # the sun outside the atmosphere gives about 2700
COLUMNS = ["sensor", "time", "par_umol_m2_s"]
INTERVAL = "interval_s"


@dataclass(frozen=True)
class Records:
    """Records of many sensors.

    Attributes
    ----------
    table : pandas.DataFrame
        `sensor` (text), `time` (UTC, the middle of the record's interval), `par_umol_m2_s`,
        `interval_s` (over which it is a mean; 0: a sample of the moment), by sensor as they first
        appear and by time.
    findings : tuple of Finding
    facts : dict
        What was read, and what was left out.
    """

    table: pd.DataFrame
    findings: tuple[Finding, ...] = ()
    facts: dict = field(default_factory=dict)


def read(
    path: str | Path | Sequence[str | Path],
    *,
    sensors: pd.DataFrame | None = None,
    sensor_column: str = "",
    par_column: str = "",
    **declared: Any,
) -> Records:
    """Read PAR records.

    Parameters
    ----------
    path : path or several
        Text tables in any layout of `dapple.formats.user_tables`: long ones with a column of
        labels (`sensor`, or `logger` and `channel`, which together make the label
        `logger_channel`), wide ones with a column for each sensor, or a file for each sensor.
    sensors : pandas.DataFrame or None
        The sensor table. Every recorded sensor must be in it, columns and files of wide tables are
        known by its labels, and its column `calibration`, where there is one, multiplies records.
    sensor_column, par_column : str
        Empty: found by the usual names or the file's layout. `par_column` of a wide table is a
        pattern such as `PAR_{sensor}_Avg`.
    **declared
        Fields of `user_tables.Declared`; `unit` is of the values (`units.PHOTONS`,
        `units.PHOTON_SUMS`), else umol/m2/s.

    Raises
    ------
    InputError
        No file or column, unreadable or naive times, text that is no number, two values for one
        sensor and time, impossible values, or sensors that the table does not know.
    """
    paths = [path] if isinstance(path, str | Path) else list(path)
    said = Declared(**declared)
    files = [_read_file(Path(one), sensors, (sensor_column, par_column), said) for one in paths]
    noticed = [found for one in files for found in one.findings]
    records = pd.concat([one.table for one in files], ignore_index=True)
    records = records.dropna(subset="par_umol_m2_s")
    where = paths[0] if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    if repeated := int(records.duplicated(COLUMNS).sum()):
        noticed.append(findings.note(where, f"{repeated} records twice, each read once"))
    records = records.drop_duplicates(COLUMNS)
    _check(records, where)
    if sensors is not None:
        records, renamed = _as_in_table(records, sensors, where)
        noticed += renamed
        check_sensors(records, sensors, where)
        if "calibration" in sensors:
            factor = sensors.set_index("sensor")["calibration"]
            records["par_umol_m2_s"] *= records["sensor"].map(factor)
    facts = {
        "files": [one.facts for one in files],
        "records": len(records),
        "sensors": int(records["sensor"].nunique()),
        "repeated": repeated,
    }
    return Records(_with_intervals(_sorted(records)), tuple(noticed), facts)


def _read_file(
    path: Path, sensors: pd.DataFrame | None, columns: tuple[str, str], said: Declared
) -> Records:
    """One file: a row a record, missing ones NaN, with `label` and `length_min` of its interval."""
    source = user_tables.read(path, decimal=said.decimal)
    long, numbers = _long(source, sensors, *columns, said.flags)
    times = time_columns.of(source, said.time_column, "measured.time_column")
    zone = said.timezone or source.timezone or times.zone or ""
    stamps = parse(
        times.text, path, zone, time_format=said.time_format, group=_groups(long, source)
    )
    long["time"] = pd.Series(stamps, index=source.cells.index).loc[long["line"]].to_numpy()
    noticed = _in_micromoles(long, source, numbers, said)
    label = said.interval_label or source.interval_label or "instant"
    long = long.assign(label=label, length_min=said.interval_min or source.interval_min or 0.0)
    flags = {name: one.missing for name, one in numbers.items() if one.missing}
    noticed += [
        findings.note(path, f"{sum(counts.values())} values of {name} missing "
                            f"({user_tables.counted(counts)})")
        for name, counts in flags.items()
    ]  # fmt: skip
    if text := timezones.note(zone):
        noticed.append(findings.warning(path, f"the time zone {text}"))
    facts = {
        "path": str(path),
        "layout": source.layout,
        "timezone": zone or "in the file",
        "columns": [times.text.name, *numbers],
        "interval_label": label,
        "missing": flags,
        "rows": len(long),
    }
    return Records(long, tuple(noticed), facts)


def _long(
    source: Table,
    sensors: pd.DataFrame | None,
    sensor_column: str,
    par_column: str,
    flags: Sequence[str | float],
) -> tuple[pd.DataFrame, dict[str, Numbers]]:
    """One row a record: `line`, `sensor`, `column`, `par_umol_m2_s`; and the columns read."""
    if sensor_column:
        sensor: str | None = source.require([sensor_column], "measured.sensor_column")
    else:
        sensor = source.find(column_names.SENSOR)
    logger, channel = source.find(["logger"]), source.find(["channel"])
    if sensor or (logger and channel):
        names = [par_column] if par_column else [*column_names.PAR]
        column = source.known.get("par") if not par_column else None
        column = column or source.require(names, "measured.par_column")
        labels = source.text(sensor) if sensor else _joined(source, logger, channel)
        numbers = source.numbers(column, flags)
        rows = {"line": source.cells.index, "sensor": labels.to_numpy(), "column": column}
        return pd.DataFrame(rows | {"par_umol_m2_s": numbers.values}), {column: numbers}
    found = _columns_of_sensors(source, sensors, par_column)
    read_columns = {column: source.numbers(column, flags) for column in found.values()}
    parts = [
        pd.DataFrame({"line": source.cells.index, "sensor": label, "column": column,
                      "par_umol_m2_s": read_columns[column].values})
        for label, column in found.items()
    ]  # fmt: skip
    return pd.concat(parts, ignore_index=True), read_columns


def _joined(source: Table, logger: str | None, channel: str | None) -> pd.Series:
    return source.text(str(logger)) + "_" + source.text(str(channel))


def _groups(long: pd.DataFrame, source: Table) -> pd.Series | None:
    """To which series a line belongs; None where a line holds all sensors."""
    if long["line"].duplicated().any():
        return None
    return pd.Series(long["sensor"].to_numpy(), index=source.cells.index)


def _columns_of_sensors(
    source: Table, sensors: pd.DataFrame | None, pattern: str
) -> dict[str, str]:
    """Label to column of a wide table, or of a file that holds one sensor.

    Raises
    ------
    InputError
        No column belongs to a sensor, or several to one.
    """
    columns = [name for name in source.cells if name not in source.known.values()]
    labels = [] if sensors is None else list(sensors["sensor"])
    if "{sensor}" in pattern:
        found = {label: [name for name in columns if name == pattern.format(sensor=label)]
                 for label in labels}  # fmt: skip
    else:
        columns = [source.require([pattern], "measured.par_column")] if pattern else columns
        found = {label: [name for name in columns if _is_of(name, label)] for label in labels}
    found = {label: _of_light(source, names) for label, names in found.items() if names}
    for label, names in found.items():
        if len(names) > 1:
            raise InputError(
                source.path,
                f"columns {' and '.join(names)} for sensor {label}",
                "one column of PAR for each sensor",
                "Set `measured.par_column` to a pattern such as 'PAR_{sensor}_Avg'.",
            )
    if found:
        return {label: names[0] for label, names in found.items()}
    light = [pattern] if pattern else [name for name in columns if _is_par(source, name)]
    quantity = light[0] if len(light) == 1 else ""
    named = [label for label in labels if _is_of(source.path.stem, label)]
    if quantity and (len(named) == 1 or len(labels) == 1):
        return {(named or labels)[0]: quantity}
    raise InputError(
        source.path,
        f"columns {', '.join(source.cells.columns)}",
        "a column `sensor`, or `logger` and `channel`; or columns named after the sensors"
        + (f", such as {labels[0]}" if labels else ""),
        "Name the columns in `measured.sensor_column` and `measured.par_column`; the latter may be "
        "a pattern such as 'PAR_{sensor}_Avg'.",
    )


def _of_light(source: Table, columns: list[str]) -> list[str]:
    """Of several columns of one sensor those of light: its temperature may stand beside them."""
    if len(columns) == 1:
        return columns
    named = [
        name
        for name in columns
        if _is_par(source, name) or {"par", "ppfd"} & set(re.findall(r"[^\W_]+", name.lower()))
    ]
    return named or columns


def _is_par(source: Table, column: str) -> bool:
    unit = units.named(source.units.get(column, "")) or units.named(column)
    return unit in units.PHOTONS or column_names.first(column_names.PAR, [column]) is not None


def _is_of(name: str, label: str) -> bool:
    """Whether a column's or file's name holds a label as whole words: PAR_3_7_Avg holds 3_7."""
    # The 1 of a unit (s-1) is no label.
    named = column_names.UNIT_IN_HEADER.match(name.strip())
    bare = named["name"] if named and units.is_unit(named["unit"]) else name
    words, wanted = (re.findall(r"[^\W_]+", text.lower()) for text in (bare, label))
    return any(
        words[k : k + len(wanted)] == wanted for k in range(len(words) - len(wanted) + 1)
    ) and bool(wanted)


def _in_micromoles(
    long: pd.DataFrame, source: Table, columns: dict[str, Numbers], said: Declared
) -> list[Finding]:
    """Convert records in place to µmol m⁻² s⁻¹, and say what is doubtful of their unit."""
    noticed: list[Finding] = []
    for column, numbers in columns.items():
        where = f"{source.path}, column {column!r}"
        unit, doubt = units.of_column(
            numbers.unit, column, said.unit, where=where, key="measured.unit",
            known=units.PHOTON_FLUXES,
        )  # fmt: skip
        noticed += doubt
        if unit == "W/m2":
            noticed.append(
                findings.warning(where, "PAR in W m⁻²", "µmol m⁻² s⁻¹",
                                 f"Taken as {units.SUNLIGHT_UMOL_PER_J} µmol J⁻¹, which holds for "
                                 "sunlight.")
            )  # fmt: skip
        if unit in units.ILLUMINANCES:
            noticed.append(
                findings.warning(
                    where, "illuminance", "µmol m⁻² s⁻¹ of PAR",
                    f"Taken for daylight, {units.DAYLIGHT_LX_PER_UMOL:g} lx in a µmol m⁻² s⁻¹. "
                    "Light that passed through leaves has about twice as many, so deep shade looks "
                    "up to twice as bright as it is.",
                )
            )  # fmt: skip
        length = said.interval_min or source.interval_min
        long.loc[long["column"] == column, "par_umol_m2_s"] *= units.photon_factor(
            unit or "umol/m2/s", length, where
        )
    return noticed


def _with_intervals(records: pd.DataFrame) -> pd.DataFrame:
    """Stamps moved to the middle of their intervals, whose length is known or the usual step."""
    step_min = records.groupby("sensor", sort=False)["time"].transform(
        lambda times: (
            np.median(np.diff(times.to_numpy()).astype("timedelta64[ns]").astype(float)) / 60e9
            if len(times) > 1
            else 0.0
        )
    )
    length_min = records["length_min"].where(records["length_min"] > 0, step_min).astype(float)
    length_min = length_min.where(records["label"] != "instant", 0.0)
    shift_min = records["label"].map(AHEAD) * length_min
    moved = records["time"] + pd.to_timedelta(shift_min, unit="min")
    result = records[["sensor"]].assign(time=moved.astype("datetime64[ns, UTC]"))
    result["par_umol_m2_s"] = records["par_umol_m2_s"]
    result[INTERVAL] = 60.0 * length_min
    return result.reset_index(drop=True)


def _as_in_table(
    records: pd.DataFrame, sensors: pd.DataFrame, where: str | Path
) -> tuple[pd.DataFrame, list[Finding]]:
    """Labels that differ from the table's by case or noughts alone, as it has them: 007 is 7."""
    known = list(sensors["sensor"])
    recorded = records["sensor"].unique()
    same = {
        name: [label for label in known if _bare(label) == _bare(name)]
        for name in recorded
        if name not in known
    }
    found = {
        name: labels[0]
        for name, labels in same.items()
        if len(labels) == 1 and sum(_bare(other) == _bare(name) for other in recorded) == 1
    }
    if not found:
        return records, []
    told = ", ".join(f"{name} as {label}" for name, label in list(found.items())[:6])
    renamed = records.assign(sensor=records["sensor"].replace(found))
    return renamed, [findings.note(where, f"labels read as the sensor table has them: {told}")]


def _bare(label: str) -> str:
    """A label in small letters, a number in it without noughts: 007 and 7.0 are 7."""
    whole = re.sub(r"^(\d+)\.0+$", r"\1", label.strip().lower())
    return re.sub(r"(?<!\d)0+(?=\d)", "", whole)


def check_sensors(
    records: pd.DataFrame, sensors: pd.DataFrame, where: str | Path = "PAR records"
) -> None:
    """Make sure that every recorded sensor has a position.

    Raises
    ------
    InputError
        Lists the sensors that are in the records and not in the table.
    """
    known = set(sensors["sensor"])
    unknown = [name for name in records["sensor"].unique() if name not in known]
    if unknown:
        raise InputError(
            where,
            f"records of {len(unknown)} sensors without a position: {', '.join(unknown[:12])}"
            + (" …" if len(unknown) > 12 else ""),
            f"labels of the sensor table, such as {sensors['sensor'].iloc[0]}",
            "Add their positions or remove their records; labels are logger_channel.",
        )


def _sorted(records: pd.DataFrame) -> pd.DataFrame:
    order = {label: k for k, label in enumerate(records["sensor"].unique())}
    rank = records["sensor"].map(order)
    return (
        records.assign(rank=rank)
        .sort_values(["rank", "time"], kind="stable", ignore_index=True)
        .drop(columns="rank")
    )


def _check(records: pd.DataFrame, where: str | Path) -> None:
    if records.empty:
        raise InputError(where, "no record", "at least one value", "Is the file complete?")
    repeated = records.duplicated(["sensor", "time"])
    if repeated.any():
        row = records[repeated].iloc[0]
        raise InputError(
            where,
            f"two values of sensor {row['sensor']} at {row['time']}",
            "one record per sensor and time",
            "Remove one of them.",
        )
    wrong = ~records["par_umol_m2_s"].between(MIN_PAR_UMOL_M2_S, MAX_PAR_UMOL_M2_S)
    if wrong.any():
        row = records[wrong].iloc[0]
        raise InputError(
            f"{where}, line {row['line']}",
            f"{row['par_umol_m2_s']:g} µmol m⁻² s⁻¹ of sensor {row['sensor']} at {row['time']}",
            f"{MIN_PAR_UMOL_M2_S:g} to {MAX_PAR_UMOL_M2_S:g}",
            "Check the calibration and the unit (`measured.unit`), or remove the record.",
        )
