"""How far images of two methods differ, apart from the noise of their light paths.

Differences are looked at in cells of a few metres and in the mean of the whole image. Paths are
drawn by chance: two methods without any error still differ by the noise of both, which is
measured and stated, and taken off in `rmse_beyond_noise`.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.retrieval.coefficients import Coefficients, Combinations, Window, spectral_columns


@dataclass(frozen=True)
class Means:
    """Means of images of n combinations in b bands over cells, and their variances.

    Attributes
    ----------
    cells, variance : (n, cells, b) float64
        Mean of every cell, and the variance of that mean by chance.
    pixels : (cells,) int64
        Pixels of each cell.
    """

    cells: np.ndarray
    variance: np.ndarray
    pixels: np.ndarray

    @property
    def image(self) -> tuple[np.ndarray, np.ndarray]:
        """Mean of the whole image and its variance, (n, b) each."""
        share = (self.pixels / self.pixels.sum())[:, None]
        return (self.cells * share).sum(axis=1), (self.variance * share**2).sum(axis=1)


def of_passes(passes: np.ndarray, window: Window, cell_m: float) -> Means:
    """Means of one combination from independent images of it.

    Parameters
    ----------
    passes : (s, b, rows, columns) float
        At least 2 of them.
    window : Window
        Their pixels.
    cell_m : float
        Edge of the cells [m].
    """
    cell, n_cells = window.cells(cell_m)
    pixels = np.bincount(cell, minlength=n_cells)
    flat = passes.reshape(-1, passes.shape[-2] * passes.shape[-1])
    sums = np.array([np.bincount(cell, row, n_cells) for row in flat]) / pixels
    sums = sums.reshape(*passes.shape[:2], n_cells).swapaxes(1, 2)
    variance = sums.var(axis=0, ddof=1) / len(passes)
    return Means(sums.mean(axis=0)[None], variance[None], pixels)


def together(parts: list[Means]) -> Means:
    """Means of several combinations as one."""
    return Means(
        np.concatenate([part.cells for part in parts]),
        np.concatenate([part.variance for part in parts]),
        parts[0].pixels,
    )


def of_coefficients(coefficients: Coefficients, combinations: Combinations) -> Means:
    """Means of many combinations by collision orders."""
    weight = spectral_columns(coefficients, combinations)
    sets = np.einsum("scx,xnb->sncb", coefficients.cells, weight, optimize=True)
    sets = sets.astype(np.float64)
    pixels = np.bincount(coefficients.window.cells(coefficients.cell_m)[0])
    return Means(sets.mean(axis=0), sets.var(axis=0, ddof=1) / len(sets), pixels)


def of_chunks(chunks, window: Window, cell_m: float) -> Means:
    """Means of many combinations from images in chunks of pixels; their noise is not known."""
    cell, n_cells = window.cells(cell_m)
    pixels = np.bincount(cell, minlength=n_cells)
    sums = np.zeros(0)
    for rows, values in chunks:
        if not len(sums):
            sums = np.zeros((n_cells, *values.shape[1:]))
        here, place = np.unique(cell[rows], return_inverse=True)
        for k, one in enumerate(here):
            sums[one] += values[place == k].sum(axis=0, dtype=np.float64)
    cells = (sums / pixels[:, None, None]).swapaxes(0, 1)
    return Means(cells, np.zeros_like(cells), pixels)


def compare(method: Means, reference: Means, bands: tuple[str, ...]) -> pd.DataFrame:
    """Differences per band, in whole cells and in the mean of the image.

    Returns
    -------
    DataFrame
        `scale` (image or cell), `band`, `n`, `mean` (of the reference), `bias`, `rmse`, `max`,
        `noise_method`, `noise_reference` (root mean square), `rmse_beyond_noise` (the root of the
        mean square less both noises; negative where the noise is the greater).
    """
    whole = method.pixels == method.pixels.max()
    scales = {
        "image": (*method.image, *reference.image),
        "cell": tuple(
            x[:, whole].reshape(-1, x.shape[-1])
            for x in (method.cells, method.variance, reference.cells, reference.variance)
        ),
    }
    rows = []
    for scale, (mine, my_variance, other, its_variance) in scales.items():
        difference = mine - other
        square = (difference**2).mean(axis=0)
        left = square - my_variance.mean(axis=0) - its_variance.mean(axis=0)
        columns = {
            "mean": other.mean(axis=0),
            "bias": difference.mean(axis=0),
            "rmse": np.sqrt(square),
            "max": np.abs(difference).max(axis=0),
            "noise_method": np.sqrt(my_variance.mean(axis=0)),
            "noise_reference": np.sqrt(its_variance.mean(axis=0)),
            "rmse_beyond_noise": np.sign(left) * np.sqrt(np.abs(left)),
        }
        rows += [
            {"scale": scale, "band": band, "n": len(difference)}
            | {name: float(values[k]) for name, values in columns.items()}
            for k, band in enumerate(bands)
        ]
    return pd.DataFrame(rows)
