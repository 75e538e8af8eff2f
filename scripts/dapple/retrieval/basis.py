"""A few columns instead of thousands of kinds of paths.

A path brings what `Counters.spectral_factor` says of what it met on leaves, wood and ground.
For all leaves and soils that occur, these factors are nearly combinations of a few functions of
the kind of path. The functions are found by singular value decomposition, weighted by how much
light paths of each kind bring. The first one is 1: what a projection on the others leaves over
then sums to zero, so that the mean of an image is exact however few functions there are.
"""

from dataclasses import dataclass

import numpy as np

from dapple.scene.counters import Counters
from dapple.scene.scene_optics import Optics

N_NODES = 400
LARGEST_ALBEDO, LARGEST_SOIL, LARGEST_BARK = 0.999, 0.85, 0.8
"""Bounds of the leaves, soils and bark for which the functions are made."""
LEAST_ASYMMETRY, MORE_ASYMMETRY = 0.3, 0.65
"""Of leaves: |ρ - τ| / (ρ + τ) is at most the first, plus the second times absorption squared.

PROSPECT with N from 1 to 2.5 stays within, from bright near infrared to blue, where all that
leaves a leaf comes from its surface.
"""
LEAST_SQUARE = 1e-13
"""Functions that matter less than this, as a share of the first one's square, are rounding."""


@dataclass(frozen=True)
class Basis:
    """Functions of the kind of a path.

    Attributes
    ----------
    nodes : Optics
        Leaves and surfaces of which the functions are combinations.
    middle : (m,) float64
        What is subtracted from the factors of the nodes.
    mix : (m, r - 1) float64
        How they are combined.
    counters : Counters
        What paths count.
    """

    nodes: Optics
    middle: np.ndarray
    mix: np.ndarray
    counters: Counters

    def __len__(self) -> int:
        return self.mix.shape[1] + 1

    def of(self, orders: np.ndarray) -> np.ndarray:
        """Values (k, r) of the functions for kinds of paths (k, n)."""
        factor = self.counters.spectral_factor(orders, self.nodes) - self.middle
        return np.column_stack([np.ones(len(orders)), factor @ self.mix])


def nodes(seed: int, n: int = N_NODES) -> Optics:
    """Draw leaves, soils and bark from all that can occur, n of each."""
    rng = np.random.default_rng(seed)
    albedo = LARGEST_ALBEDO * rng.beta(0.6, 0.5, n)
    asymmetry = rng.uniform(-1, 1, n) * (LEAST_ASYMMETRY + MORE_ASYMMETRY * (1 - albedo) ** 2)
    return Optics.of_tree(
        np.zeros(n),
        albedo * (1 + asymmetry) / 2,
        albedo * (1 - asymmetry) / 2,
        rng.uniform(0, LARGEST_BARK, n),
        rng.uniform(0, LARGEST_SOIL, n),
    )


def fit(
    orders: np.ndarray, light: np.ndarray, counters: Counters, n_columns: int, seed: int
) -> Basis:
    """Find the functions that serve best for paths of which a sample is known.

    Parameters
    ----------
    orders : (k, n) uint8
        Kinds of paths, each once.
    light : (k,) float64
        What paths of each kind bring, above 0.
    counters : Counters
        What paths count.
    n_columns : int
        Number of functions r.
    seed : int
        Of the leaves and soils for which they are made.

    Returns
    -------
    Basis
    """
    made_for = nodes(seed)
    share = light / light.sum()
    factor = counters.spectral_factor(orders, made_for)
    middle = share @ factor
    weighted = np.sqrt(share)[:, None] * (factor - middle)
    # Right singular vectors by way of a small matrix: there are many more kinds than nodes.
    square, ways = np.linalg.eigh(weighted.T @ weighted)
    square, ways = square[::-1], ways[:, ::-1]
    kept = min(n_columns - 1, int((square > LEAST_SQUARE * square[0]).sum()))
    return Basis(made_for, middle, ways[:, :kept] / np.sqrt(square[:kept]), counters)


def projector(values: np.ndarray, light: np.ndarray) -> np.ndarray:
    """Least squares of factors on the functions, weighted by light.

    Parameters
    ----------
    values : (k, r) float64
        Of the functions, from `Basis.of`.
    light : (k,) float64
        As in `fit`.

    Returns
    -------
    (r, k) float64
        Times factors (k, n): coefficients (r, n).
    """
    root = np.sqrt(light / light.sum())[:, None]
    q, r = np.linalg.qr(root * values)
    # What few paths cannot tell apart gets no weight instead of a large one.
    return np.linalg.pinv(r, rcond=1e-10) @ (q * root).T
