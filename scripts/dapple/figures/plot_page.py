"""One self-contained page about a plot whose chlorophyll was mapped."""

import html
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.figures import report

CAPTIONS = {
    "map": "Retrieved chlorophyll, and the width of its interval.",
    "field": "Retrieved against measured chlorophyll of trees.",
    "spectra": "Observed canopy pixels, and those that taught the networks.",
    "simulated": "Predictions of simulated entries against their truth.",
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
    return report.page(
        f"dapple: {plot}",
        [
            f"<h1>Leaf chlorophyll of {html.escape(plot)}</h1>",
            "<h2>What was read</h2>",
            _facts(files, sun, sky, sky_told_by, crs),
            report.noticed(files),
            "<h2>What was retrieved</h2>",
            report.table(retrieved),
            _trust(retrieved, usual_outside, accuracy),
            *_scores(accuracy, trees),
            *(report.figure(path, CAPTIONS[path.stem.rpartition("_")[2]]) for path in figures),
        ],
    )


def _facts(files, sun, sky, sky_told_by, crs) -> str:
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
    cells = "".join(
        f"<tr><td>{html.escape(name)}</td><td>{html.escape(text)}</td></tr>" for name, text in rows
    )
    return f"<table>{cells}</table>"


def _text(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{name}: {_text(one)}" for name, one in value.items()) or "none"
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _trust(retrieved: pd.DataFrame, usual_outside: float, accuracy: pd.DataFrame) -> str:
    """How far to trust the map, in words."""
    shares = retrieved["outside_share"].dropna().astype(float)
    if shares.empty:
        return "<p><b>No cell has data: nothing was retrieved.</b></p>"
    text = (
        f"By model, {100 * shares.min():.0f} to {100 * shares.max():.0f} % of the cells look "
        f"unlike all that was simulated ({100 * usual_outside:.1f} % of what taught does): values "
        "are extrapolated. Intervals hold for leaves and canopies as they were simulated."
    )
    if "field" not in set(accuracy["test_set"]):
        text += " No measured tree tells how far these are from the truth."
    return f"<p><b>How far to trust it.</b> {text}</p>"


def _scores(accuracy: pd.DataFrame, trees: pd.DataFrame) -> list[str]:
    ensemble = accuracy[accuracy["seed"].astype(str) == "ensemble"]
    parts = ["<h2>Scores</h2>", report.table(ensemble.dropna(axis=1, how="all"))]
    if len(trees):
        columns = [name for name in TREE_COLUMNS if name in trees]
        parts += ["<h2>Trees</h2>", report.table(trees[columns])]
    return parts
