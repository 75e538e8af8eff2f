"""Thirty days of weather as stations write them, right and with each mistake: what the checks say.

    PYTHONPATH=scripts:. .venv/bin/python benchmarks/plausible.py [--months 3] [OUTPUT]

Days come from the clear-sky model with fields of clouds (`tests/unit/weather.py`), at four places
and in three tables each: ten-minute means, quarter hours stamped at their start, hourly means. A
mistake is found where `plausible.check` doubts the table, and named where the first doubt tells
what to write instead. `OUTPUT` is the folder of the table, as a rule `docs/data`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pandas as pd
from tests.unit.weather import FREIBURG, minutes, station

from dapple.sky import plausible, sun
from dapple.sky.radiation_table import Radiation

DAYS = 30
PLACES = {
    "Freiburg, summer": (FREIBURG, "2023-06-01"),
    "Freiburg, winter": (FREIBURG, "2023-01-01"),
    "Quito": (sun.Site(-0.18, -78.47, 2850.0), "2023-03-10"),
    "Santiago": (sun.Site(-33.45, -70.66, 570.0), "2023-12-01"),
}
TABLES = ((10, "end"), (15, "start"), (60, "end"))
UNITS = ("J/cm2", "kJ/m2", "MJ/m2", "Wh/m2", "kWh/m2", "umol/m2/s")
OTHER_END = {"end": "start", "start": "end"}
ZONES_MIN = {60: "+01:00", 120: "+02:00", -300: "-05:00"}


def mistakes(
    truth: pd.DataFrame, step_min: int, label: str
) -> Iterator[tuple[str, str, Radiation]]:
    """Each mistake, what a word of it must hold, and the table."""
    yield "none", "", station(truth, step_min, label)
    factors = plausible.unit_factors(step_min)
    for unit in UNITS:
        if unit not in factors:  # an hour's Wh are its mean in W
            continue
        word = "PAR in µmol" if unit == "umol/m2/s" else f"radiation.unit: {unit}"
        yield f"unit {unit}", word, station(truth, step_min, label, factor=factors[unit])
    for assumed in (OTHER_END[label], "instant"):
        wrong = station(truth, step_min, label, assumed=assumed, is_declared=False)
        yield f"label {label} read as {assumed}", f"interval_label: {label}", wrong
    for ahead_min, zone in ZONES_MIN.items():
        moved = station(truth, step_min, label, ahead_min=ahead_min)
        yield f"clock {zone} read as UTC", f"timezone: '{zone}'", moved
    right = station(truth, step_min, label)
    swapped = right.table.set_axis(["diffuse_w_m2", "global_w_m2"], axis="columns")
    yield "columns exchanged", "global_column: D", replace(right, table=swapped)
    diffuse = right.table.assign(diffuse_w_m2=right.table["diffuse_w_m2"] * factors["kWh/m2"])
    yield "diffuse alone in kWh/m2", "unit of the diffuse column", replace(right, table=diffuse)


def judged(months: int) -> pd.DataFrame:
    """A row a table: mistake, whether it was doubted, refused, and its remedy named."""
    rows = []
    for number, (place, (site, start)) in enumerate(PLACES.items()):
        for month in range(months):
            truth = minutes(DAYS, start=start, site=site, seed=100 * number + month)
            for step_min, label in TABLES:
                for mistake, word, table in mistakes(truth, step_min, label):
                    doubts = plausible.check(table, site)
                    row = {"mistake": mistake, "place": place, "step_min": step_min}
                    row["found"] = bool(doubts)
                    row["refused"] = any(one.level == "error" for one in doubts)
                    row["named"] = bool(doubts) and word in doubts[0].remedy
                    if row["found"] != bool(word) or (word and not row["named"]):
                        print(row, *doubts, sep="\n  ", flush=True)
                    rows.append(row)
    return pd.DataFrame(rows)


def main() -> None:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--months", type=int, default=3)
    arguments.add_argument("output", nargs="?", type=Path)
    options = arguments.parse_args()
    found = judged(options.months).groupby("mistake", sort=False)
    table = found.agg(
        tables=("found", "size"), found=("found", "sum"), refused=("refused", "sum"),
        named=("named", "sum"),
    ).reset_index()  # fmt: skip
    print(table.to_string(index=False))
    if options.output:
        table.to_csv(options.output / "plausible.csv", index=False)


if __name__ == "__main__":
    main()
