"""Reflectance of bark and ground: one value, a table, or a file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.findings import Finding
from dapple.optics import spectrum_table
from dapple.optics.bands import band_mean

Spectrum = float | str | Path | Mapping[str, object]
COLUMNS = {"wavelength_column", "reflectance_column", "decimal"}


def reflectance(
    source: Spectrum,
    wavelength_nm: np.ndarray,
    *,
    where: str = "reflectance",
    noticed: list[Finding] | None = None,
) -> np.ndarray:
    """Reflectance per band from a number, a table or a file.

    Parameters
    ----------
    source : float, mapping or path
        One value for all bands; a mapping with the keys `wavelength_nm` and `reflectance`, linear
        between its entries; or a file (see `spectrum_table.read`), also as the key `path` with the
        names of its columns.
    wavelength_nm : (b,) float
        Band centres [nm].
    where : str
        The configuration key, for messages.
    noticed : list or None
        What is noticed about a file is appended to it.

    Returns
    -------
    (b,) float64
        Mean over each band.

    Raises
    ------
    InputError
        Values outside 0 to 1, not numbers, or a table that does not cover the bands.
    """
    if isinstance(source, Mapping) and source.get("path"):
        columns = {key: str(value) for key, value in source.items() if key in COLUMNS}
        return of_file(str(source["path"]), wavelength_nm, where, noticed, **columns)
    if isinstance(source, (str, Path)):
        return of_file(source, wavelength_nm, where, noticed)
    if isinstance(source, Mapping):
        table = _table(source, where)
    else:
        value = float(source)
        table = pd.Series(value, index=[wavelength_nm[0] - 1.0, wavelength_nm[-1] + 1.0])
    wrong = ~table.between(0.0, 1.0)
    if wrong.any():
        raise InputError(
            where,
            f"{table[wrong].iloc[0]:g} at {table.index[wrong][0]:g} nm",
            "a reflectance of 0 to 1",
            "Divide by 100 if the spectrum is in percent.",
        )
    low, high = table.index.min(), table.index.max()
    if not (low <= wavelength_nm[0] and wavelength_nm[-1] <= high) or table.index.has_duplicates:
        raise InputError(
            where,
            f"a table of {len(table)} rows over {low:g} to {high:g} nm",
            f"each wavelength once, {wavelength_nm[0]:g} to {wavelength_nm[-1]:g} nm covered",
            "Add the missing wavelengths or remove repeated ones.",
        )
    return band_mean(table.index.to_numpy(float), table.to_numpy(float), wavelength_nm)


def of_file(
    path: str | Path,
    wavelength_nm: np.ndarray,
    where: str,
    noticed: list[Finding] | None = None,
    **columns: Any,
) -> np.ndarray:
    """Reflectance (b,) per band from a file; see `reflectance`."""
    spectrum = spectrum_table.read(
        path, (wavelength_nm[0], wavelength_nm[-1]), key=f"optics.{where.split()[0]}", **columns
    )
    if noticed is not None:
        noticed.extend(spectrum.findings)
    return band_mean(spectrum.wavelength_nm, spectrum.values["reflectance"], wavelength_nm)


def _table(source: Mapping[str, object], where: str) -> pd.Series:
    wavelengths, values = (list(source[key]) for key in ("wavelength_nm", "reflectance"))  # type: ignore[call-overload]
    if len(wavelengths) != len(values):
        raise InputError(
            where,
            f"{len(wavelengths)} wavelengths and {len(values)} reflectances",
            "as many of the one as of the other",
            "Give one reflectance per wavelength.",
        )
    return pd.Series(values, index=wavelengths, dtype=float).sort_index()
