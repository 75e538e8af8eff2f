"""Numbers of a run as tables, each where its file is there."""

import math
from collections.abc import Iterator, Mapping
from json import loads
from pathlib import Path

import pandas as pd

from dapple.figures import pareto_chart, style
from dapple.formats import json, tables
from dapple.report.blocks import Block, Cell, Chart, Table, cell, table
from dapple.report.quantities import CHLOROPHYLL, QUANTITIES, REFLECTANCE, Quantity, quantity

COMPARED = {
    "statistics/overall.csv": (
        "Simulated against measured PAR",
        "All sensors and times that no fit has seen.",
    ),
    "statistics/mixed_model.csv": (
        "Measured on simulated light, sensor as random effect",
        "A linear mixed model of each reconstruction.",
    ),
    "statistics/agreement.csv": (
        "One engine against another",
        "The same scene and sky computed twice: what differs is the engines' own error.",
    ),
}
OF_STUDIES = {
    "survey/shadowing.csv": ("How much of the stand the scans do not see", ""),
    "survey/regression.csv": ("Contact frequency against plant area, by laser coverage", ""),
    "survey/correction.csv": ("What the correction by laser coverage gains", ""),
    "survey/estimators.csv": ("Estimators of plant area density", ""),
    "survey/plan.csv": ("Where the planner would scan", ""),
    "stability/thresholds.csv": ("Where reconstructions fail", ""),
    "stability/verdict.csv": ("How often the verdict finds failures", ""),
    "chlorophyll/accuracy.csv": ("Retrieved against known chlorophyll", ""),
    "chlorophyll/speed.csv": ("Time for the images that teach", ""),
    "chlorophyll/comparison.csv": ("Fast images against direct simulation", ""),
}
MEANINGS = {
    "chlorophyll/accuracy.csv": CHLOROPHYLL,
    "chlorophyll/comparison.csv": REFLECTANCE,
}
SHOWN = 200
"""Most rows of a table; the file has them all."""


def of_files(folder: Path, titles: Mapping[str, tuple[str, str]]) -> Iterator[Block]:
    """Tables of those files that a run has, in their order."""
    for name, (title, note) in titles.items():
        if (path := folder / name).is_file():
            yield _of_file(path, title, note, MEANINGS.get(name, {}))


def _of_file(path: Path, title: str, note: str, meanings: Mapping[str, Quantity]) -> Table:
    """The first rows of a file as a table, columns without any value left out."""
    found = tables.read(path)
    if len(found) > SHOWN:
        note = f"{note} The first {SHOWN} of {len(found)} rows; all are in {path.name}.".strip()
    shown = found.head(SHOWN).dropna(axis=1, how="all")
    return table(shown, title, note=note, named=style.label, also=meanings)


def overall(folder: Path) -> pd.DataFrame | None:
    """How well each reconstruction matches records, where there are any."""
    path = folder / "statistics/overall.csv"
    return tables.read(path) if path.is_file() else None


def structure(folder: Path) -> Iterator[Block]:
    """What every reconstruction consists of."""
    facts = {
        path.parent.name: json.read(path)
        for path in sorted(folder.glob("structure/*/summary.json"))
    }
    if not facts:
        return
    found = pd.DataFrame(facts).T
    plain = [name for name in found if found[name].map(_is_plain).all()]
    found = found[plain].infer_objects()
    shared = found[[name for name in found if name in QUANTITIES]].copy()
    shared.insert(0, "reconstruction", shared.index)
    yield table(shared, "What the scan was rebuilt as", named=style.label)
    if rows := _of_some(found.drop(columns=[name for name in found if name in QUANTITIES])):
        columns = [quantity(name) for name in ("reconstruction", "quantity", "value", "unit")]
        yield Table("What else is known of single reconstructions", columns, rows)


def _of_some(found: pd.DataFrame) -> list[list[Cell]]:
    """What some reconstructions have, a row for each: as columns, most cells would be empty."""
    return [
        [
            cell(style.label(str(name))),
            cell(about.label),
            cell(value, 0 if isinstance(value, int | float) and value % 1 == 0 else about.digits),
            cell(about.unit),
        ]
        for name, row in found.iterrows()
        for about, value in ((quantity(str(one)), value) for one, value in row.items())
        if value is not None and not (isinstance(value, float) and math.isnan(value))
    ]


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, int | float | str)


def tradeoff(folder: Path) -> Iterator[Block]:
    """Accuracy against speed, where it was tried."""
    path = folder / "tradeoff/points.csv"
    if path.is_file():
        caption = (
            "Error against the time that it costs, of every setting that was tried: point at one "
            "to read its settings. The dashed line joins those that no other beats."
        )
        chart = pareto_chart.to_explore(tables.read(path)).to_json()
        yield Chart("tradeoff", "figure", caption, loads(chart))
