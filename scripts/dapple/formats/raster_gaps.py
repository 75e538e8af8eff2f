"""Where an image has no data: flags, masks, borders of one colour."""

from collections.abc import Sequence

import numpy as np
import rasterio

KNOWN_NODATA = (-10_000.0, -9999.0, -32_767.0, -32_768.0, -99_999.0, -3.4028234663852886e38)
"""What programs write where an image has no data: no reflectance is so low."""
BEYOND_ANY = 1e10
"""So large a number is a flag."""


def flags(
    file: rasterio.DatasetReader, chosen: Sequence[int], declared: float | None
) -> list[float]:
    """Values that mean no data: declared, the file's own, and known ones."""
    own = [file.nodatavals[k - 1] for k in chosen if file.nodatavals[k - 1] is not None]
    given = [declared] if declared is not None else []
    return list(dict.fromkeys([*given, *map(float, own), *KNOWN_NODATA]))


def without_data(
    values: np.ndarray, valid: np.ndarray, empty: Sequence[float], largest: int | None
) -> tuple[np.ndarray, dict[str, float]]:
    """Values with NaN where there are none, and shares of pixels by reason."""
    gone: dict[str, float] = {}
    flagged = np.isin(values, list(empty)).any(axis=0) | ~(np.abs(values) < BEYOND_ANY).all(axis=0)
    black = valid & ~flagged & (values == 0).all(axis=0)
    white = valid & ~flagged & (values == largest).all(axis=0)
    for text, missing in (
        ("outside the image's mask", ~valid & ~flagged),
        ("flagged as no data", flagged),
        ("black in all bands, taken as no data", black),
        ("as bright in all bands as the file can tell, taken as no data", white),
    ):
        if missing.any():
            gone[text] = float(missing.mean())
    return np.where(valid & ~flagged & ~black & ~white, values, np.nan), gone
