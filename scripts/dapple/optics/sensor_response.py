"""What a sensor's response makes of light: its reading, and directions as often as they count.

Rays back from a sensor start in directions that are drawn as often as light from there counts, so
that each of them counts the same. Of all light of an even sky, a share comes from below any height:
the functions here go from heights, as cosines of the angle from the normal, to shares and back.
"""

from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from dapple.optics.responses import COSINE, Response


@cache
def _knots(response: Response) -> tuple[np.ndarray, np.ndarray]:
    """Cosines, ascending from 0 to 1, and the response there."""
    angle_deg, relative = np.array(response).T[:, ::-1]
    return np.sin(np.radians(90.0 - angle_deg)), relative


@cache
def _areas(response: Response) -> np.ndarray:
    """Integrals of the response over the cosine between its knots."""
    cosine, relative = _knots(response)
    return 0.5 * (relative[1:] + relative[:-1]) * np.diff(cosine)


def value(response: Response, cosine: Any, maths: ModuleType = np) -> Any:
    """Relative response to light that comes at a cosine from the normal; none from behind.

    `maths` is numpy, or drjit for its arrays.
    """
    knots, relative = _knots(response)
    if maths is np:
        return np.where(cosine > 0, np.interp(cosine, knots, relative), 0.0)
    slopes = np.diff(relative) / np.diff(knots)
    found = relative[0]
    for knot, width, slope in zip(knots, np.diff(knots), slopes, strict=False):
        found = found + float(slope) * maths.clip(cosine - float(knot), 0.0, float(width))
    return maths.select(cosine > 0, found, 0.0)


def integral_sr(response: Response) -> float:
    """Of the response over the upper hemisphere [sr]: π of the cosine, 2π of the hemisphere.

    It is what the sensor reads under a sky of radiance 1.
    """
    return float(2 * np.pi * _areas(response).sum())


def share_below(response: Response, cosine: np.ndarray) -> np.ndarray:
    """Share of an even sky's reading that comes from lower directions than those of a cosine."""
    knots, relative = _knots(response)
    areas = _areas(response)
    k = np.clip(np.searchsorted(knots, cosine, side="right") - 1, 0, len(areas) - 1)
    before = np.concatenate([[0.0], np.cumsum(areas)])[k]
    mean = 0.5 * (relative[k] + value(response, cosine))
    return (before + mean * (cosine - knots[k])) / areas.sum()


def height(response: Response, share: Any, maths: ModuleType = np) -> tuple[Any, Any]:
    """Where directions point below which lies a share of an even sky's reading.

    Parameters
    ----------
    response : Response
    share : array
        From 0 to 1.
    maths : module
        With `sqrt`, `minimum` and `maximum` of such arrays: numpy or drjit.

    Returns
    -------
    level, up : array
        Length of the unit vector's level part, and its height.
    """
    knots, relative = (values.tolist() for values in _knots(response))
    areas = _areas(response).tolist()
    total, begun, up = sum(areas), 0.0, 0.0
    for k, area in enumerate(areas):
        # At x above a knot the response is a + m x: its integral a x + m x² / 2 is solved for x.
        a, m = relative[k], (relative[k + 1] - relative[k]) / (knots[k + 1] - knots[k])
        part = maths.minimum(maths.maximum(share - begun, 0.0), area / total)
        begun += area / total
        if a == 0.0:
            up = up + maths.sqrt(part * (2 * total / m))
        else:
            root = maths.sqrt(maths.maximum(a * a + part * (2 * total * m), 0.0))
            up = up + part * (2 * total) / (a + root)
    flat = share if response == COSINE else up * up
    return maths.sqrt(maths.maximum(1.0 - flat, 0.0)), up


def directions(
    response: Response, x: Any, y: Any, squared_radius: Any, maths: ModuleType = np
) -> tuple[Any, Any, Any]:
    """Upward directions, drawn as often as light from there counts, for even points of a disc.

    Parameters
    ----------
    response : Response
    x, y : array
        Even points of the disc of radius 1.
    squared_radius : array
        Their x² + y².
    maths : module
        As in `height`.

    Returns
    -------
    x, y, z : array
        Unit vectors; in the open each of them brings the same share of an even sky's reading. Of
        the cosine it is the disc projected upwards (Malley's method).
    """
    level, up = height(response, maths.maximum(1.0 - squared_radius, 0.0), maths)
    if response == COSINE:
        return x, y, up
    stretch = level / maths.sqrt(maths.maximum(squared_radius, 1e-12))
    return x * stretch, y * stretch, up
