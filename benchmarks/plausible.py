"""Thirty days of weather as stations write them, right and with each mistake: what the checks say.

    PYTHONPATH=scripts:. .venv/bin/python benchmarks/plausible.py [--months 50] [--first 0] [OUTPUT]

Days come from the clear-sky model with fields of clouds (`tests/unit/weather.py`). Every month has
weather of its own at a place, begins on a day of the year drawn by chance, and is written as one of
three tables, every other one without diffuse radiation: ten-minute means, quarter hours stamped at
their start, hourly means. A mistake is found where `plausible.check` doubts the table, and named
where the first doubt tells what to write instead; that too few clear hours are there to check the
unit is no doubt, and counted apart. `OUTPUT` is the folder of the tables, as a rule
`docs/data`; `--first` is the first of the months' numbers, so that others can be tried.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
from tests.unit.weather import FREIBURG, minutes, station

from dapple.sky import plausible, radiation_unit, sun
from dapple.sky.radiation_table import Radiation

DAYS = 30
PLACES = {
    "Freiburg": (FREIBURG, 0, 365),
    "Quito": (sun.Site(-0.18, -78.47, 2850.0), 0, 365),
    "Santiago": (sun.Site(-33.45, -70.66, 570.0), 0, 365),
    "Tromsø": (sun.Site(69.65, 18.96, 10.0), 60, 245),
}
"""Site, and the first and last day of the year on which a month may begin: the sun has to rise."""
TABLES = ((10, "end"), (15, "start"), (60, "end"))
UNITS = ("J/cm2", "kJ/m2", "MJ/m2", "Wh/m2", "kWh/m2", "umol/m2/s")
OTHER_END = {"end": "start", "start": "end"}
ZONES_MIN = {60: "+01:00", 120: "+02:00", -300: "-05:00"}


def mistakes(
    truth: pd.DataFrame, step_min: int, label: str, only_global: bool
) -> Iterator[tuple[str, str, Radiation]]:
    """Each mistake, what a word of it must hold, and the table."""

    def written(**how: object) -> Radiation:
        return station(truth, step_min, label, only_global=only_global, **how)

    yield "none", "", written()
    factors = radiation_unit.unit_factors(step_min)
    for unit in UNITS:
        if unit not in factors:  # an hour's Wh are its mean in W
            continue
        word = "PAR in µmol" if unit == "umol/m2/s" else f"radiation.unit: {unit}"
        yield f"unit {unit}", word, written(factor=factors[unit])
    for assumed in (OTHER_END[label], "instant"):
        wrong = written(assumed=assumed, is_declared=False)
        yield f"label {label} read as {assumed}", f"interval_label: {label}", wrong
    for ahead_min, zone in ZONES_MIN.items():
        yield f"clock {zone} read as UTC", f"timezone: '{zone}'", written(ahead_min=ahead_min)
    if only_global:
        return
    right = written()
    swapped = right.table.set_axis(["diffuse_w_m2", "global_w_m2"], axis="columns")
    yield "columns exchanged", "global_column: D", replace(right, table=swapped)
    diffuse = right.table.assign(diffuse_w_m2=right.table["diffuse_w_m2"] * factors["kWh/m2"])
    yield "diffuse alone in kWh/m2", "unit of the diffuse column", replace(right, table=diffuse)


def judged(months: int, first: int) -> pd.DataFrame:
    """A row a table: mistake, whether it was doubted, refused, and its remedy named."""
    rows = []
    for number, (place, (site, earliest, latest)) in enumerate(PLACES.items()):
        for month in range(first, first + months):
            seed = 1000 * number + month
            day = int(np.random.default_rng(seed).integers(earliest, latest))
            start = pd.Timestamp("2023-01-01") + pd.Timedelta(days=day)
            truth = minutes(DAYS, start=f"{start:%Y-%m-%d}", site=site, seed=seed)
            step_min, label = TABLES[month % len(TABLES)]
            only_global = month % 2 == 1
            for mistake, word, table in mistakes(truth, step_min, label, only_global):
                said = plausible.check(table, site)
                doubts = [one for one in said if radiation_unit.TO_CHECK not in one.found]
                row = {"mistake": mistake, "place": place, "month": month, "start": start,
                       "step_min": step_min, "only_global": only_global}  # fmt: skip
                row["found"] = bool(doubts)
                row["untold"] = len(said) > len(doubts)
                row["refused"] = any(one.level == "error" for one in doubts)
                row["named"] = bool(doubts) and word in doubts[0].remedy
                if row["found"] != bool(word) or (word and not row["named"]):
                    print(row, *doubts, sep="\n  ", flush=True)
                rows.append(row)
    return pd.DataFrame(rows)


def counted(rows: pd.DataFrame, *by: str) -> pd.DataFrame:
    """Tables, and how many of them were doubted, refused and named, by some columns."""
    rows = rows.assign(named=rows["named"] & (rows["mistake"] != "none"))
    return (
        rows.groupby(list(by), sort=False)
        .agg(tables=("found", "size"), found=("found", "sum"), refused=("refused", "sum"),
             named=("named", "sum"), untold=("untold", "sum"))
        .reset_index()
    )  # fmt: skip


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--months", type=int, default=50)
    arguments.add_argument("--first", type=int, default=0)
    arguments.add_argument("output", nargs="?", type=Path)
    options = arguments.parse_args()
    rows = judged(options.months, options.first)
    table, by_place = counted(rows, "mistake"), counted(rows, "mistake", "place")
    print(table.to_string(index=False), by_place.to_string(index=False), sep="\n\n")
    if options.output:
        table.to_csv(options.output / "plausible.csv", index=False)
        by_place.to_csv(options.output / "plausible_places.csv", index=False)


if __name__ == "__main__":
    main()
