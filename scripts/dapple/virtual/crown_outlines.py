"""Outlines of crowns seen from above."""

import numpy as np

N_SECTORS = 36


def outline(leaf_vertices_m: np.ndarray, n_sectors: int = N_SECTORS) -> np.ndarray:
    """Outline of a crown seen from above, about its stem on the origin.

    Parameters
    ----------
    leaf_vertices_m : (n, 3) float64
        Corners of the leaves [m].

    Returns
    -------
    (n_sectors, 2) float64
        Corners of a star-shaped polygon, anticlockwise from the east [m]. In every sector it
        reaches as far as 98 % of the corners, averaged with its two neighbours.
    """
    x, y = leaf_vertices_m[:, 0], leaf_vertices_m[:, 1]
    sector = np.floor(np.arctan2(y, x) / (2 * np.pi) * n_sectors).astype(np.int64) % n_sectors
    distance = np.hypot(x, y)
    reach = np.array(
        [
            np.quantile(distance[sector == k], 0.98) if (sector == k).any() else 0.0
            for k in range(n_sectors)
        ]
    )
    reach = (np.roll(reach, 1) + 2 * reach + np.roll(reach, -1)) / 4
    angle = (np.arange(n_sectors) + 0.5) * 2 * np.pi / n_sectors
    return reach[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def area_m2(ring: np.ndarray) -> float:
    """Area of an open ring (k, 2) [m²]."""
    x, y = ring[:, 0], ring[:, 1]
    return float(0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1))))
