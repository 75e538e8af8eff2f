"""Evenly spread sample points: rank-1 sequences on the unit square, disc and hemisphere."""

import numpy as np


def kronecker(n: int, dimensions: int) -> np.ndarray:
    """First n points of the R sequence in the unit cube (Roberts 2018, generalised golden ratio).

    Any n gives an even spread, and a shift modulo 1 keeps it even: independent random shifts
    make independent unbiased estimates.
    """
    ratio = 1.5
    for _ in range(64):
        ratio = (1.0 + ratio) ** (1.0 / (dimensions + 1))
    step = ratio ** -np.arange(1, dimensions + 1, dtype=np.float64)
    return (0.5 + np.arange(1, n + 1)[:, None] * step) % 1.0


def shifted(n: int, dimensions: int, copies: tuple[int, ...], seed: int) -> np.ndarray:
    """Copies of the same n points, each with a random shift of its own.

    Returns
    -------
    (*copies, n, dimensions) float64
        In 0 to 1.
    """
    shift = np.random.default_rng(seed).random((*copies, 1, dimensions))
    return (kronecker(n, dimensions) + shift) % 1.0


def disc(square: np.ndarray) -> np.ndarray:
    """Map points (..., 2) of the unit square evenly to the disc of radius 1."""
    radius, angle = np.sqrt(square[..., 0]), 2.0 * np.pi * square[..., 1]
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)


def cosine_hemisphere(square: np.ndarray) -> np.ndarray:
    """Map points (..., 2) of the unit square to upward directions with density cos / pi."""
    flat = disc(square)
    up = np.sqrt(np.maximum(1.0 - (flat**2).sum(axis=-1, keepdims=True), 0.0))
    return np.concatenate([flat, up], axis=-1)
