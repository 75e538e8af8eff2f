"""One self-contained page about a plot whose chlorophyll was mapped."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.report.blocks import Block, Listing, Section, number, picture, table
from dapple.report.document import document
from dapple.report.findings_list import noticed
from dapple.report.quantities import CHLOROPHYLL

CAPTIONS = {
    "map": "Retrieved chlorophyll, and the width of its interval.",
    "field": "Retrieved chlorophyll of trees against what is known of them.",
    "spectra": "Observed canopy pixels, and those that taught the networks.",
    "simulated": "Predictions of simulated entries against what they were made with.",
    "losses": "Loss of the networks by epoch.",
}
TREE_COLUMNS = ("tree", "truth_ug_cm2", "predicted_ug_cm2", "low_ug_cm2", "high_ug_cm2",
                "covered_share", "outside_share", "model", "mask", "network")  # fmt: skip


def retrieved(
    taught: Mapping[str, str], layers: np.ndarray, facts: Mapping[str, Any]
) -> dict[str, Any]:
    """A map in a row: how much it holds, and how wide its intervals are.

    Parameters
    ----------
    taught : mapping
        Model, mask and network.
    layers : (k, rows, columns) float
        `retrieval.maps.MAP_BANDS` and what follows.
    facts : mapping
        `cells` with data, `outside_share` of them.
    """
    lcc, low, high = layers[:3, np.isfinite(layers[0])]
    some = len(lcc) > 0
    return dict(taught) | {
        "cells": facts["cells"],
        "median_ug_cm2": float(np.median(lcc)) if some else np.nan,
        "interval_width_ug_cm2": float(np.median(high - low)) if some else np.nan,
        "outside_share": facts["outside_share"],
    }


def build(
    plot: str,
    *,
    files: Sequence[Mapping[str, Any]],
    sun: Mapping[str, Any],
    sky: Mapping[str, float],
    sky_told_by: str,
    crs: str,
    retrieved: pd.DataFrame,
    usual_outside: float,
    accuracy: pd.DataFrame,
    trees: pd.DataFrame,
    figures: Sequence[Path],
) -> str:
    """The page as HTML.

    Parameters
    ----------
    plot : str
        Title.
    files : sequence of mappings
        What was found in a user's files, with `findings`; none of a virtual plot.
    sun, sky : mappings
        Angles [°] and who told them; share of skylight by band.
    sky_told_by, crs : str
    retrieved : DataFrame
        Rows of `retrieved`.
    usual_outside : float
        Share of the entries that taught which lie beyond the training range.
    accuracy, trees : DataFrame
        Scores, and trees with what was retrieved; may be empty.
    figures : sequence of Path
        Pictures, called {plot}_{name}.png.
    """
    is_known = "field" in set(accuracy["test_set"])
    return document(
        f"Leaf chlorophyll of {plot}",
        _trust(retrieved, usual_outside, accuracy),
        [
            Section("What was retrieved", [table(retrieved, "Maps", also=CHLOROPHYLL)]),
            Section("What was noticed about the input", noticed(files)),
            Section(
                "Figures",
                [
                    picture(path, CAPTIONS[name])
                    for path in figures
                    if (name := path.stem.rpartition("_")[2]) != "field" or is_known
                ],
            ),
            Section("Scores", [*_scores(accuracy, trees)]),
            Section("What was read", [_facts(files, sun, sky, sky_told_by, crs)]),
        ],
    )


def _facts(
    files: Sequence[Mapping[str, Any]],
    sun: Mapping[str, Any],
    sky: Mapping[str, float],
    sky_told_by: str,
    crs: str,
) -> Listing:
    rows = [("coordinate system", crs)]
    for facts in files:
        rows += [
            (name.replace("_", " "), _text(value))
            for name, value in facts.items()
            if name not in ("findings", "crs")
        ]
    angles = f"zenith {sun['sun_zenith_deg']:.2f}°, azimuth {sun['sun_azimuth_deg']:.2f}°"
    rows.append(("sun", f"{angles} ({sun['told_by']})"))
    rows.append(("light from the sky", f"{_text(sky)} ({sky_told_by})"))
    return Listing(rows)


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_text(one)}" for name, one in value.items()) or "none"
    return number(value, 4) if isinstance(value, float) and np.isfinite(value) else str(value)


def _trust(retrieved: pd.DataFrame, usual_outside: float, accuracy: pd.DataFrame) -> list[str]:
    """How far to trust the map, in words."""
    shares = retrieved["outside_share"].dropna().astype(float)
    if shares.empty:
        return ["No cell has data: nothing was retrieved."]
    least, most = f"{100 * shares.min():.0f}", f"{100 * shares.max():.0f}"
    cells = (
        f"{most} % of the cells look"
        if least == most
        else f"By model, {least} to {most} % of the cells look"
    )
    found = [
        f"{cells} unlike all that was simulated ({100 * usual_outside:.1f} % of what taught does): "
        "there, values are extrapolated.",
        "Intervals hold for leaves and canopies as they were simulated.",
    ]
    if "field" not in set(accuracy["test_set"]):
        found.append("No measured tree tells how far these are from what grows there.")
    return found


def _scores(accuracy: pd.DataFrame, trees: pd.DataFrame) -> Iterator[Block]:
    ensemble = accuracy[accuracy["seed"].astype(str) == "ensemble"]
    yield table(ensemble.dropna(axis=1, how="all"), "Networks", also=CHLOROPHYLL)
    if len(trees):
        columns = [name for name in TREE_COLUMNS if name in trees]
        yield table(trees[columns], "Trees", also=CHLOROPHYLL)
