"""Reflectance of bark and ground: one value, a table, or a file."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.optics.bands import band_mean

# Assumed, not measured: between measured branches of birch and larch (0.07 to 0.18, spectral
# database of LESS, Qi et al. 2019) and the bark colour of the published apple tree (red 0.37,
# green 0.36, blue 0.33; Frey et al. 2025).
BARK = {"wavelength_nm": (400.0, 550.0, 700.0), "reflectance": (0.10, 0.18, 0.26)}

# Assumed, typical of green grass in summer: dark in blue and red, a green peak, the red edge.
MEADOW = {
    "wavelength_nm": (400.0, 500.0, 550.0, 600.0, 680.0, 700.0),
    "reflectance": (0.03, 0.05, 0.10, 0.07, 0.05, 0.12),
}

Spectrum = float | str | Path | Mapping[str, Sequence[float] | str]


def read(path: str | Path) -> pd.Series:
    """Read a reflectance spectrum from CSV.

    Parameters
    ----------
    path : path
        Columns `wavelength_nm` and `reflectance`, or `front_reflectance` as in the tables
        that LESS exports.

    Returns
    -------
    pandas.Series
        Reflectance by ascending wavelength [nm].

    Raises
    ------
    InputError
        No such file or columns.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a CSV table of a spectrum", "Check the path.")
    table = pd.read_csv(path)
    names = [name for name in ("reflectance", "front_reflectance") if name in table]
    if "wavelength_nm" not in table or not names:
        raise InputError(
            path,
            f"columns {', '.join(map(str, table.columns))}",
            "`wavelength_nm` and `reflectance` (or `front_reflectance`)",
            "Rename the columns.",
        )
    return table.set_index("wavelength_nm")[names[0]].sort_index()


def reflectance(
    source: Spectrum, wavelength_nm: np.ndarray, *, where: str = "reflectance"
) -> np.ndarray:
    """Reflectance per band from a number, a table or a file.

    Parameters
    ----------
    source : float, mapping or path
        One value for all bands; a table with the keys `wavelength_nm` and `reflectance`,
        linear between its entries; or a CSV file (see `read`), also as the key `path`.
    wavelength_nm : (b,) float
        Band centres [nm].
    where : str
        The configuration key, for messages.

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
        source = source["path"]
    if isinstance(source, (str, Path)):
        table, where = read(source), f"{where} ({source})"
    elif isinstance(source, Mapping):
        table = _table(source, where)
    else:
        table = pd.Series(float(source), index=[wavelength_nm[0] - 1.0, wavelength_nm[-1] + 1.0])
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


def _table(source: Mapping[str, Sequence[float] | str], where: str) -> pd.Series:
    wavelengths, values = source["wavelength_nm"], source["reflectance"]
    if len(wavelengths) != len(values):
        raise InputError(
            where,
            f"{len(wavelengths)} wavelengths and {len(values)} reflectances",
            "as many of the one as of the other",
            "Give one reflectance per wavelength.",
        )
    return pd.Series(values, index=wavelengths, dtype=float).sort_index()
