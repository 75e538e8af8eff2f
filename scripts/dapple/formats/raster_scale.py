"""Reflectance from the numbers of an image, and whether vegetation can reflect so."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats.raster_bands import COLOURS_NM, CameraBand

SCALES = {
    32_768.0: "MicaSense, Metashape",
    65_535.0: "16 bits",
    10_000.0: "Sentinel, DJI Terra",
    255.0: "8 bits",
    100.0: "percent",
}
LARGEST = 2.0
"""Specular glints pass 1; what passes this by much is scaled."""
LOWEST = -0.05
DARKEST_BRIGHTEST, DIM_BRIGHTEST = 0.05, 0.15
"""The brightest band of vegetation reflects more; below the first it is none at all."""


def reflectance(
    path: Path,
    values: np.ndarray,
    declared: float,
    scales: np.ndarray,
    offsets: np.ndarray,
    is_integer: bool,
) -> tuple[np.ndarray, float | str]:
    """Values as reflectance: by the declared scale, the file's own, or as they are.

    Parameters
    ----------
    path : str or Path
        For messages.
    values : (b, rows, columns) float64
    declared : float
        Value that means a reflectance of 1; 0: none is declared.
    scales, offsets : (b,) float64
        The file's own.
    is_integer : bool
        Whether the file holds whole numbers.

    Returns
    -------
    values, factor
        The second says by what they were scaled.

    Raises
    ------
    InputError
        Values that need a scale, and none is told.
    """
    if declared:
        return values / declared, declared
    if (scales != 1.0).any() or (offsets != 0.0).any():
        return values * scales[:, None, None] + offsets[:, None, None], "the file's own"
    high = float(np.nanpercentile(values, 99)) if np.isfinite(values).any() else 0.0
    if is_integer or high > LARGEST:
        known = ", ".join(
            f"{scale:g} ({who})" for scale, who in SCALES.items() if scale >= high / 1.5
        )
        raise InputError(
            path,
            f"{'whole numbers' if is_integer else 'values'} up to {high:g} and no scale",
            "reflectance from 0 to 1, or the value that means 1",
            "Set `scale` of the plot to what the program wrote for a reflectance of 1"
            + (f": {known}." if known else "."),
        )
    return values, 1.0


def check(path: str | Path, values: np.ndarray, camera: Sequence[CameraBand]) -> list[Finding]:
    """Raise an InputError where values cannot be the reflectance of vegetation; tell doubts.

    Parameters
    ----------
    path : str or Path
        For messages.
    values : (b, rows, columns) float64
        Reflectance, NaN without data.
    camera : sequence of bands
    """
    tops = []
    for band, layer in zip(camera, values, strict=True):
        there = layer[np.isfinite(layer)]
        if not there.size:
            raise InputError(
                path, f"no data in band {band.name}", "reflectance",
                "Export the image again; check `nodata` of the plot.",
            )  # fmt: skip
        low, middle, high = np.percentile(there, (1, 50, 99))
        tops.append(high)
        if low < LOWEST or high > LARGEST or not 0 < middle <= 1:
            raise InputError(
                path,
                f"reflectance of {low:.3g} to {high:.3g} (1 to 99 %) in band {band.name}, "
                f"{middle:.3g} at half of the pixels",
                f"{LOWEST:g} to {LARGEST:g}, and between 0 and 1 at most pixels",
                "Check `scale` and `nodata` of the plot.",
            )
    top = max(tops)
    if top > DIM_BRIGHTEST:
        return []
    make = findings.error if top < DARKEST_BRIGHTEST else findings.warning
    too_dim = make(
        path,
        f"reflectance of at most {top:.3g} in every band",
        f"more than {DIM_BRIGHTEST:g} in the brightest: leaves reflect a third of near infrared",
        "Check `scale` of the plot: the images look divided by too much.",
    )
    findings.stop([too_dim])
    return [too_dim]


def check_order(path: str | Path, values: np.ndarray, camera: Sequence[CameraBand]) -> None:
    """Raise an InputError where bands that only their order tells cannot be in it.

    Leaves reflect more of the near infrared than of the red edge. Cameras of MicaSense number the
    red edge last, behind the near infrared.

    Parameters
    ----------
    path : str or Path
        For messages.
    values : (b, rows, columns) float64
        Reflectance, NaN without data.
    camera : sequence of bands
        In the order in which the image's bands were taken.
    """
    middles = np.nanmedian(values, axis=(1, 2))
    edge, infrared = (
        [k for k, band in enumerate(camera) if low <= band.centre_nm < high]
        for low, high in (COLOURS_NM["rededge"], COLOURS_NM["nir"])
    )
    for k in edge:
        for other in infrared:
            if middles[k] > middles[other]:
                order = list(range(1, len(camera) + 1))
                order[k], order[other] = order[other], order[k]
                raise InputError(
                    path,
                    f"{middles[k]:.3g} at {camera[k].centre_nm:g} nm and {middles[other]:.3g} at "
                    f"{camera[other].centre_nm:g} nm, by the order of bands without names",
                    "more of the near infrared than of the red edge from leaves",
                    f"Set `band_order` of the plot; {order} fits.",
                )
