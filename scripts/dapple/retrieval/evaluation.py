"""How well chlorophyll was retrieved: on simulated entries and on trees with known values."""

from collections.abc import Mapping, Sequence

import numpy as np
import pandas as pd

from dapple.errors import InputError

COLUMNS = (
    "plot", "model", "mask", "test_set", "n", "r2", "rmse", "rrmse",
    "network", "seed", "bias", "coverage",
)  # fmt: skip


def scores(truth: np.ndarray, prediction: np.ndarray) -> dict[str, float]:
    """Compare predictions with truths where both are known.

    Parameters
    ----------
    truth, prediction : (n,) float
        In one unit.

    Returns
    -------
    dict
        `n` pairs; `r2` = 1 - Σ(p - t)² / Σ(t - mean t)², the coefficient of determination, which
        a shifted prediction lowers and which is negative where the mean of the truths would have
        been the better guess; `rmse`; `rrmse` = rmse / mean t, a share; `bias` = mean (p - t).
        NaN where they cannot be known (no pair; r2 of equal truths).
    """
    truth, prediction = np.asarray(truth, float), np.asarray(prediction, float)
    known = np.isfinite(truth) & np.isfinite(prediction)
    t, error = truth[known], (prediction - truth)[known]
    if not len(t):
        return {"n": 0, "r2": np.nan, "rmse": np.nan, "rrmse": np.nan, "bias": np.nan}
    rmse = float(np.sqrt(np.mean(error**2)))
    variance = float(np.mean((t - t.mean()) ** 2))
    return {
        "n": len(t),
        "r2": 1.0 - rmse**2 / variance if variance > 0 else np.nan,
        "rmse": rmse,
        "rrmse": rmse / float(t.mean()) if t.mean() != 0 else np.nan,
        "bias": float(error.mean()),
    }


def over_seeds(
    truth: np.ndarray, predictions: Mapping[int, np.ndarray]
) -> list[dict[str, float | str]]:
    """Scores of each seed, their mean, and the scores of the mean prediction.

    Parameters
    ----------
    truth : (n,) float
    predictions : mapping of int to (n,) float
        By seed of the network.

    Returns
    -------
    list of dict
        As `scores`, with `seed`: its number, "mean" (of the figures) or "ensemble" (figures of
        the mean prediction, which is what the map shows).
    """
    rows = [scores(truth, values) | {"seed": str(seed)} for seed, values in predictions.items()]
    mean = pd.DataFrame(rows).drop(columns="seed").mean().to_dict()
    together = scores(truth, np.mean(list(predictions.values()), axis=0))
    return [*rows, mean | {"n": together["n"], "seed": "mean"}, together | {"seed": "ensemble"}]


def no_trees() -> pd.DataFrame:
    """A table of trees without any."""
    names = ("truth_ug_cm2", "predicted_ug_cm2", "low_ug_cm2", "high_ug_cm2")
    return pd.DataFrame({"tree": pd.Series(dtype=str)} | {n: pd.Series(dtype=float) for n in names})


def area_weights(
    geometry: Mapping,
    *,
    left_m: float,
    top_m: float,
    cell_m: float,
    shape: tuple[int, int],
    samples: int = 60,
) -> np.ndarray:
    """Area of a polygon within each cell.

    Parameters
    ----------
    geometry : mapping
        GeoJSON Polygon or MultiPolygon, in the frame of `left_m` and `top_m`.
    left_m, top_m, cell_m, shape
        The cells: outer north-west corner and edge [m], rows and columns.
    samples : int
        Points along the edge of a cell with which areas are counted.

    Returns
    -------
    (rows, columns) float64
        Area [m²], to about cell_m² / samples per crossing edge.
    """
    from rasterio import Affine
    from rasterio.features import rasterize

    fine_m = cell_m / samples
    inside = rasterize(
        [(geometry, 1)],
        out_shape=(shape[0] * samples, shape[1] * samples),
        transform=Affine(fine_m, 0.0, left_m, 0.0, -fine_m, top_m),
        dtype="uint8",
    )
    blocks = inside.reshape(shape[0], samples, shape[1], samples)
    return blocks.sum(axis=(1, 3), dtype=np.int64) * fine_m**2


def trees(
    values: np.ndarray,
    geometries: Sequence[Mapping],
    names: Sequence,
    truth: np.ndarray,
    *,
    left_m: float,
    top_m: float,
    cell_m: float,
    where: str = "crowns",
) -> pd.DataFrame:
    """Area-weighted mean of a map under every crown.

    Parameters
    ----------
    values : (k, rows, columns) float
        Maps, such as predictions of several networks; NaN in cells without data.
    geometries : sequence of GeoJSON geometries
        Crowns in the frame of `left_m` and `top_m`.
    names, truth : (n,)
        Tree and its chlorophyll [µg cm⁻²].
    left_m, top_m, cell_m : float
        The cells of the maps.
    where : str
        The file of the crowns, for messages.

    Returns
    -------
    DataFrame
        `tree`, `truth_ug_cm2`, `crown_area_m2` (on the map), `covered_share` of it with data,
        `predicted_0` ... of each map. A crown without data has a share of 0 and predictions NaN:
        it stays in the table.

    Raises
    ------
    InputError
        No crown has data.

    Notes
    -----
    Weights as in Zhao et al. (2025): the area that a crown has in each cell.
    """
    known = np.isfinite(values).all(axis=0)
    filled = np.where(known, values, 0.0)
    rows = []
    for name, geometry, true in zip(names, geometries, truth, strict=True):
        area = area_weights(geometry, left_m=left_m, top_m=top_m, cell_m=cell_m, shape=known.shape)
        total, covered = float(area.sum()), float(area[known].sum())
        means = (
            (filled * area).sum(axis=(1, 2)) / covered if covered else np.full(len(values), np.nan)
        )
        rows.append(
            {"tree": name, "truth_ug_cm2": float(true), "crown_area_m2": total,
             "covered_share": covered / total if total else 0.0}
            | {f"predicted_{k}": float(mean) for k, mean in enumerate(means)}
        )  # fmt: skip
    table = pd.DataFrame(rows)
    if not (table["covered_share"] > 0).any():
        raise InputError(
            where, f"{len(table)} crowns, none over a pixel with data",
            "crowns within the images, over canopy",
            "Check the coordinate system of the crowns and the mask.",
        )  # fmt: skip
    return table
