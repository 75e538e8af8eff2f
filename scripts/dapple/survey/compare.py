"""Tables of corrected leaf density against the truth, on trees that no factor was fitted on."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.survey import correction, fill
from dapple.survey.correction import Cells
from dapple.survey.shadow import in_cells

Runs = dict[tuple[str, int, str], Cells]
"""By stand, seed and design."""


def regression_table(cells: Runs) -> pd.DataFrame:
    """`correction.regressions` of every stand and design, cells of all seeds together."""
    rows = []
    for stand, design in _pairs(cells):
        together = _some(cells, stand, design)
        rows += [{"stand": stand, "design": design} | row
                 for row in correction.regressions(together)]  # fmt: skip
    return pd.DataFrame(rows)


def factor_table(cells: Runs) -> pd.DataFrame:
    """Correction factors from the even cells of all seeds."""
    rows = []
    for stand, design in _pairs(cells):
        factors = {
            quantity: correction.fit_factors(_some(cells, stand, design), quantity)
            for quantity in correction.QUANTITIES
        }
        for number, name in enumerate((*correction.CLASSES, "never")):
            row = {"stand": stand, "design": design, "coverage_class": name}
            rows.append(row | {f"factor_{key}": values[number] for key, values in factors.items()})
    return pd.DataFrame(rows)


def profile_table(cells: Runs, cell_size_m: float) -> pd.DataFrame:
    """Profiles of leaf density, corrected by factors from the stands of the other seeds.

    Returns
    -------
    pandas.DataFrame
        `true`, `measured` (contact frequency per edge of a voxel), `angle_corrected` and
        `corrected` leaf area density [m² m⁻³], mean over all cells of a layer; `true_share`,
        `measured_share`, `corrected_share`, the same as share of voxels filled, which no leaf
        angle enters.
    """
    tables = []
    for (stand, seed, design), one in cells.items():
        others = _some(cells, stand, design, without=seed)
        profiles = _profiles(one, others)
        n = len(profiles["true"])
        keys = {"stand": stand, "design": design, "height_m": (np.arange(n) + 0.5) * cell_size_m}
        tables.append(pd.DataFrame(keys | profiles | {"seed": seed}))
    return pd.concat(tables, ignore_index=True)


def correction_table(cells: Runs) -> pd.DataFrame:
    """Relative root mean square error over height, by where the factors came from.

    `own even cells`: fitted on even cells, judged on odd ones of the same trees; `other trees`:
    fitted on stands of the same species and other seeds; `other stand`: on the other species.
    """
    rows = []
    stands = list(dict.fromkeys(stand for stand, _, _ in cells))
    for (stand, seed, design), one in cells.items():
        sources = {
            "own even cells": ([one], ~one.even),
            "other trees": (_some(cells, stand, design, without=seed), None),
        }
        if foreign := [s for s in stands if s != stand]:
            sources["other stand"] = (_some(cells, foreign[0], design), None)
        for name, (fitted, chosen) in sources.items():
            p = _profiles(one, fitted, chosen)
            for quantity, end in (("area", ""), ("share", "_share")):
                error = {
                    key: correction.relative_rmse(p[f"{key}{end}"], p[f"true{end}"])
                    for key in ("measured", "corrected")
                }
                rows.append({"stand": stand, "design": design, "seed": seed,
                             "factors_from": name, "quantity": quantity,
                             "rmse_measured": error["measured"],
                             "rmse_angle_corrected": correction.relative_rmse(
                                 p["angle_corrected"], p["true"]) if not end else np.nan,
                             "rmse_corrected": error["corrected"],
                             "ratio": error["corrected"] / error["measured"]})  # fmt: skip
    return pd.DataFrame(rows)


def likelihood(
    density: xr.Dataset, truth: xr.Dataset, per_edge: int, range_m: float, neighbours: int
) -> list[dict]:
    """Errors of plant area density by maximum likelihood, unknown cells left out, 0 or filled.

    The truth is leaf area plus half the surface of wood: what leaves of the same mean shade have.
    """
    size_m = density.attrs["voxel_size_m"]
    area = truth.leaf_area_m2.values.astype(np.float64) + 0.5 * truth.wood_area_m2.values
    true = in_cells(area, per_edge, "sum") / size_m**3
    rows = []
    for name in ("fpl", "fpl_biased", "transmittance"):
        value = density[f"pad_{name}_m2_m3"].values.astype(np.float64)
        known = np.isfinite(value)
        error = density.standard_error_m2_m3.values.astype(np.float64)
        filled, sigma, is_filled = fill.krige(
            value, error, cell_size_m=size_m, range_m=range_m, neighbours=neighbours
        )
        for how, estimate, judged in (
            ("reached cells only", value, known),
            ("unknown cells are 0", np.where(known, value, 0.0), np.ones_like(known)),
            ("unknown cells kriged", filled, np.ones_like(known)),
            ("kriged cells only", filled, is_filled),
        ):
            if not judged.any():
                continue
            off = estimate[judged] - true[judged]
            layers = [np.where(judged, grid, 0.0).sum(axis=(0, 1)) for grid in (estimate, true)]
            held = judged & (true > 0)
            inside = np.abs(estimate - true)[held] < 1.96 * sigma[held]
            rows.append({"estimator": name, "cells": how, "n": int(judged.sum()),
                         "share_filled": float(is_filled[judged].mean()),
                         "bias": float(off.mean()), "rmse": float(np.sqrt((off**2).mean())),
                         "profile_rmse_relative": correction.relative_rmse(*layers),
                         "plant_area_relative": float(layers[0].sum() / layers[1].sum()),
                         "within_95": float(inside.mean()) if held.any() else np.nan})  # fmt: skip
    return rows


def _profiles(one: Cells, fitted: list[Cells], chosen: np.ndarray | None = None) -> dict:
    """Layer means of truth, measured and corrected density over chosen cells."""
    area = correction.apply_factors(one, correction.fit_factors(fitted, "area"), "area")
    share = correction.apply_factors(one, correction.fit_factors(fitted, "share"), "share")
    grids = {
        "true": one.true_density,
        "measured": one.contact_density,
        "angle_corrected": one.by_angle,
        "corrected": area,
        "true_share": one.true_share,
        "measured_share": one.contact,
        "corrected_share": share,
    }
    weight = np.ones(one.contact.shape) if chosen is None else chosen.astype(float)
    total = weight.sum(axis=(0, 1))
    return {name: (grid * weight).sum(axis=(0, 1)) / total for name, grid in grids.items()}


def _pairs(cells: Runs) -> list[tuple[str, str]]:
    return list(dict.fromkeys((stand, design) for stand, _, design in cells))


def _some(cells: Runs, stand: str, design: str, without: int | None = None) -> list[Cells]:
    """Cells of a stand and design, of all seeds but one."""
    return [
        one for (s, seed, d), one in cells.items() if s == stand and d == design and seed != without
    ]
