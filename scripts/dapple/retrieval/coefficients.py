"""Images of any leaf, bark and soil from light paths that were traced once.

Paths from every pixel only count what they met on leaves, wood and ground (`image_paths`). The
reflectance of a pixel is a power series in the reflectance and transmittance of leaves and the
reflectance of bark and soil. It takes no assumption on the
leaf: any pair of reflectance and transmittance will do, where a series in absorption alone holds
for one leaf structure.

There are thousands of kinds of paths. The series is kept exactly for the whole image, and per
pixel as a projection on a few functions of the kind (`basis`): the mean over all pixels has no
approximation, single pixels have one far below the noise of their paths.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from operator import itemgetter

import numpy as np
from numpy.typing import ArrayLike

from dapple.light.brf import SKY, SUN
from dapple.retrieval.basis import projector
from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics

COMBINATIONS_AT_ONCE = 1024
"""Bounds the memory of the factors of all kinds of paths."""


@dataclass(frozen=True)
class Window:
    """Level pixels, row 0 in the north.

    Attributes
    ----------
    left_m, top_m : float
        Outer north-west corner in the local frame [m].
    pixel_m : float
        Edge of a pixel [m].
    rows, columns : int
        Number of pixels to the south and to the east.
    """

    left_m: float
    top_m: float
    pixel_m: float
    rows: int
    columns: int

    @property
    def n_pixels(self) -> int:
        """How many pixels there are."""
        return self.rows * self.columns

    def cells(self, cell_m: float) -> tuple[np.ndarray, int]:
        """Cell of every pixel, (rows * columns,) int64, and the number of cells.

        Cells start at the north-west corner; the last ones may be cut by the window.
        """
        row, column = (
            ((np.arange(n) + 0.5) * self.pixel_m / cell_m).astype(np.int64)
            for n in (self.rows, self.columns)
        )
        across = column[-1] + 1
        return (row[:, None] * across + column).ravel(), int((row[-1] + 1) * across)


@dataclass(frozen=True)
class Coefficients:
    """What every pixel receives, as coefficients of functions of what paths met.

    Attributes
    ----------
    window : Window
        The pixels.
    table : (pixels, 2 * r) float32
        Sums of the r functions over each pixel's paths, for light from the sun and from the sky.
    orders : (k, n) uint8
        What every kind of path met, a column for each of `counters`.
    values : (k, r) float64
        The functions of each kind.
    light : (2, k) float64
        Reflectance factor that paths of each kind bring to the whole image under sun and sky, per
        `Counters.spectral_factor`.
    cells : (s, n, 2 * r) float32
        Means of `table` over cells of `cell_m`, from s independent sets of paths each.
    cell_m : float
        Edge of these cells [m].
    n_paths, max_orders : int
        Paths per pixel, most surfaces on a path.
    cut_weight : float
        Paths given up at `max_orders`, by their weight, as a share of all.
    sun_cosine : float
        Cosine of the sun's zenith angle.
    counters : Counters
        What is counted.
    """

    window: Window
    table: np.ndarray
    orders: np.ndarray
    values: np.ndarray
    light: np.ndarray
    cells: np.ndarray
    cell_m: float
    n_paths: int
    max_orders: int
    cut_weight: float
    sun_cosine: float
    counters: Counters

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return self.window.rows, self.window.columns

    @cached_property
    def projectors(self) -> tuple[np.ndarray, ...]:
        """For sun and sky, (r, k): from factors of kinds to coefficients of the functions."""
        return tuple(
            projector(self.values, light) if light.any() else np.zeros(self.values.T.shape)
            for light in self.light
        )


@dataclass(frozen=True)
class Combinations:
    """Leaves, surfaces and light of n combinations in b bands; a single row serves all.

    Attributes
    ----------
    leaf_reflectance, leaf_transmittance, bark, soil : (n, b) float
        0 to 1.
    diffuse_share : (b,) or (n, b) float
        Of the light on level ground that comes from the sky, not from the sun.
    """

    leaf_reflectance: ArrayLike
    leaf_transmittance: ArrayLike
    bark: ArrayLike
    soil: ArrayLike
    diffuse_share: ArrayLike

    @property
    def surfaces(self) -> tuple[np.ndarray, ...]:
        """Leaf reflectance and transmittance, bark and soil, (n, b) each."""
        properties = (self.leaf_reflectance, self.leaf_transmittance, self.bark, self.soil)
        return np.broadcast_arrays(*(np.atleast_2d(np.asarray(x, float)) for x in properties))

    @property
    def optics(self) -> Optics:
        """The surfaces as n * b bands."""
        surfaces = [values.reshape(-1) for values in self.surfaces]
        return Optics.of_tree(np.zeros(surfaces[0].size), *surfaces)


def images(coefficients: Coefficients, combination: Combinations) -> np.ndarray:
    """One image of given leaves and surfaces.

    Parameters
    ----------
    coefficients : Coefficients
        Traced once.
    combination : Combinations
        Of one row, or of (b,) values.

    Returns
    -------
    (b, rows, columns) float32
        Reflectance factor: the ratio to a level white Lambertian plate in the open.
    """
    columns = spectral_columns(coefficients, combination)[:, 0]
    values = coefficients.table @ columns
    return np.ascontiguousarray(values.T).reshape(-1, *coefficients.shape)


def image_chunks(
    coefficients: Coefficients,
    combinations: Combinations,
    *,
    pixels_per_chunk: int = 4096,
) -> Iterator[tuple[slice, np.ndarray]]:
    """Images of many combinations of leaves and surfaces, some pixels at a time.

    Parameters
    ----------
    coefficients : Coefficients
        Traced once.
    combinations : Combinations
        n of them.
    pixels_per_chunk : int
        A chunk takes 4 bytes × pixels × combinations × bands of memory.

    Yields
    ------
    pixels : slice
        Of the image's pixels in row-major order.
    values : (pixels, n, b) float32
        Their reflectance factors.
    """
    weight = spectral_columns(coefficients, combinations)
    flat = weight.reshape(len(weight), -1)
    for low in range(0, len(coefficients.table), pixels_per_chunk):
        rows = slice(low, min(low + pixels_per_chunk, len(coefficients.table)))
        yield rows, (coefficients.table[rows] @ flat).reshape(-1, *weight.shape[1:])


def spectral_columns(coefficients: Coefficients, combinations: Combinations) -> np.ndarray:
    """What each column of the table has to be multiplied with, (2 * r, n, b) float32."""
    shape, optics = combinations.surfaces[0].shape, combinations.optics
    weight = np.empty((2, coefficients.values.shape[1], len(optics)), np.float32)
    for low in range(0, len(optics), COMBINATIONS_AT_ONCE):
        part = slice(low, low + COMBINATIONS_AT_ONCE)
        factor = coefficients.counters.spectral_factor(
            coefficients.orders, optics.each(itemgetter(part))
        )
        for source in (SUN, SKY):
            weight[source, :, part] = coefficients.projectors[source] @ factor
    weight = weight.reshape(2, -1, *shape)
    share = np.broadcast_to(np.asarray(combinations.diffuse_share, np.float32), shape)
    weight[SUN] *= 1 - share
    weight[SKY] *= share
    return weight.reshape(-1, *shape)


def projection_error(coefficients: Coefficients, combinations: Combinations) -> np.ndarray:
    """Root mean square error of a pixel by the projection, were its paths independent draws.

    Returns
    -------
    (n, b) float64
        Reflectance factor. Leaves far from those for which the functions were made show here.
    """
    shape, optics = combinations.surfaces[0].shape, combinations.optics
    factor = coefficients.counters.spectral_factor(coefficients.orders, optics)
    share = np.broadcast_to(np.asarray(combinations.diffuse_share), shape).reshape(-1)
    square = np.zeros(len(optics))
    for source, part in ((SUN, 1 - share), (SKY, share)):
        left = factor - coefficients.values @ (coefficients.projectors[source] @ factor)
        square += part**2 * (coefficients.light[source] @ left**2)
    return np.sqrt(square / coefficients.n_paths).reshape(shape)


def remainder_bound(coefficients: Coefficients, combinations: Combinations) -> np.ndarray:
    """Most that paths given up at `max_orders` could still have brought to the image's mean.

    A path that goes on meets at most a fully lit surface at every order, and each sends on at most
    the largest albedo A: a geometric tail A^max_orders / (1 - A), over the sun's cosine.

    Returns
    -------
    (n, b) float64
        Reflectance factor.
    """
    rho, tau, bark, soil = combinations.surfaces
    albedo = np.clip(np.maximum.reduce([rho + tau, bark, soil]), 0.0, 1 - 1e-6)
    tail = albedo**coefficients.max_orders / (1 - albedo)
    return coefficients.cut_weight * tail / coefficients.sun_cosine
