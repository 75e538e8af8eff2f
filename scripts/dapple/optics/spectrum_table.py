"""Measured spectra from tables: reflectance, or reflectance and transmittance, by wavelength."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import user_tables
from dapple.formats.text_table import Table

WAVELENGTH_NAMES = ("wavelength_nm", "wavelength", "wavelength_um", "wl", "lambda", "nm")
REFLECTANCE_NAMES = ("reflectance", "front_reflectance", "refl")
TRANSMITTANCE_NAMES = ("transmittance", "trans")
MICROMETRES = ("um", "µm", "μm", "micrometer", "micrometre", "microns")
FLAGS = (-999.0, -9999.0, -1.23e34)
NOISE = 0.02
"""So far outside 0 to 1 a measured value may lie: it is cut, and said."""
LARGEST_GAP_NM = 25.0
"""Wavelengths further apart than this are drawn as a straight line, and said."""


@dataclass(frozen=True)
class Spectrum:
    """A spectrum as it was measured.

    Attributes
    ----------
    wavelength_nm : (k,) float64
        Ascending.
    values : dict of str to (k,) float64
        `reflectance` and, where asked for, `transmittance`, 0 to 1 in the range that is used.
    findings : tuple of Finding
        What was noticed, in the range that is used and outside.
    """

    wavelength_nm: np.ndarray
    values: dict[str, np.ndarray]
    findings: tuple[Finding, ...] = ()


def read(
    path: str | Path,
    used_nm: tuple[float, float],
    *,
    with_transmittance: bool = False,
    wavelength_column: str = "",
    reflectance_column: str = "",
    transmittance_column: str = "",
    decimal: str = "",
    key: str = "optics",
) -> Spectrum:
    """Read a spectrum and judge it in the range that is used.

    Parameters
    ----------
    path : path
        A text table in any layout of `dapple.formats.user_tables`, units in header or cells.
    used_nm : two floats
        Shortest and longest wavelength that is used [nm].
    with_transmittance : bool
        A leaf: both, whose sum must not exceed 1.
    wavelength_column, reflectance_column, transmittance_column : str
        Empty: found by the usual names.
    decimal : {"", ".", ","}
        Decimal sign; empty: as the cells show.
    key : str
        Section of the configuration, for messages.

    Raises
    ------
    InputError
        No file or column; a range that is not covered; a wavelength twice; values that are neither
        shares of light nor percent; a leaf that gives back more light than it gets.
    """
    source = user_tables.read(path, decimal=decimal)
    names: dict[str, tuple[str, tuple[str, ...]]] = {
        "reflectance": (reflectance_column, REFLECTANCE_NAMES)
    }
    if with_transmittance:
        names["transmittance"] = (transmittance_column, TRANSMITTANCE_NAMES)
    at_name = _column(source, wavelength_column, WAVELENGTH_NAMES, f"{key}.wavelength_column")
    columns = {
        kind: _column(source, asked, usual, f"{key}.{kind}_column")
        for kind, (asked, usual) in names.items()
    }
    wavelength, unit = _numbers(source, at_name)
    if not len(wavelength):
        raise InputError(path, "no row", "a wavelength in each", "Copy or export the file again.")
    if unit.lower() in MICROMETRES or at_name.lower().endswith("_um"):
        wavelength = 1e3 * wavelength
    elif np.max(wavelength, initial=-np.inf, where=np.isfinite(wavelength)) < 30.0:
        raise InputError(
            f"{path}, column {at_name!r}",
            f"wavelengths up to {np.max(wavelength, initial=0.0, where=wavelength > 0):g}",
            "nanometres",
            "Call the column wavelength_um if it is in micrometres.",
        )
    noticed: list[Finding] = []
    table = pd.DataFrame({"wavelength_nm": wavelength})
    for kind, column in columns.items():
        values, unit = _numbers(source, column)
        where = f"{path}, column {column!r}"
        table[kind] = _share(values, unit, wavelength, used_nm, where, noticed)
    gone = table.isna().any(axis=1)
    if gone.any():
        noticed.append(findings.note(path, f"{gone.sum()} wavelengths without a value, left out"))
    table = table[~gone].sort_values("wavelength_nm", ignore_index=True)
    _check(table, used_nm, path, noticed)
    used = table["wavelength_nm"].between(*used_nm)
    kinds = list(columns)
    if with_transmittance:
        _check_sum(table[used], path)
    kept = {kind: np.clip(table[kind].to_numpy(), 0.0, 1.0) for kind in kinds}
    return Spectrum(table["wavelength_nm"].to_numpy(), kept, tuple(noticed))


def _column(source: Table, asked: str, usual: Sequence[str], key: str) -> str:
    return source.require([asked] if asked else usual, key)


def _numbers(source: Table, column: str) -> tuple[np.ndarray, str]:
    numbers = source.numbers(column, FLAGS)
    return numbers.values, numbers.unit


def _share(
    values: np.ndarray,
    unit: str,
    wavelength: np.ndarray,
    used_nm: tuple[float, float],
    where: str,
    noticed: list[Finding],
) -> np.ndarray:
    """Values as shares of the light that meets the surface: percent divided by 100."""
    inside = (wavelength >= used_nm[0]) & (wavelength <= used_nm[1]) & np.isfinite(values)
    if not inside.any():
        return values
    largest = float(values[inside].max())
    if unit.startswith("%") or unit.lower() in ("percent", "pct"):
        return values / 100.0
    if 1.0 + NOISE < largest <= 100.0 and float(np.median(values[inside])) > 1.0:
        noticed.append(
            findings.warning(
                where,
                f"values up to {largest:g}",
                "reflectance from 0 to 1",
                "Taken as percent; write % behind the name of the column if it is so.",
            )
        )
        return values / 100.0
    return values


def _check(
    table: pd.DataFrame, used_nm: tuple[float, float], path: str | Path, noticed: list[Finding]
) -> None:
    """Range, repetitions, values and gaps where the spectrum is used; noise where it is not."""
    at = table["wavelength_nm"].to_numpy()
    low, high = used_nm
    if not len(at) or at[0] > low or at[-1] < high:
        covered = f"{at[0]:g} to {at[-1]:g} nm" if len(at) else "no wavelength with a value"
        raise InputError(
            path,
            covered,
            f"{low:g} to {high:g} nm",
            "Give a spectrum that covers the bands.",
        )
    if (twice := np.diff(at) == 0).any():
        raise InputError(
            path,
            f"{at[1:][twice][0]:g} nm twice",
            "each wavelength once",
            "Average the samples, or name the column of one of them.",
        )
    inside = (at >= low) & (at <= high)
    for kind in table.columns[1:]:
        values = table[kind].to_numpy()
        beyond = (values < 0.0) | (values > 1.0)
        wrong = inside & ((values < -NOISE) | (values > 1.0 + NOISE))
        if wrong.any():
            raise InputError(
                path,
                f"{kind} {values[wrong][0]:g} at {at[wrong][0]:g} nm",
                "0 to 1, or percent",
                "Divide the spectrum by its scale, or remove the noisy wavelengths.",
            )
        if (noisy := inside & beyond).any():
            noticed.append(
                findings.warning(
                    path,
                    f"{noisy.sum()} values of {kind} a little outside 0 to 1, first "
                    f"{values[noisy][0]:g} at {at[noisy][0]:g} nm",
                    "0 to 1",
                    "They are cut.",
                )
            )
        if (outside := ~inside & beyond).any():
            noticed.append(
                findings.note(
                    path,
                    f"{outside.sum()} impossible values of {kind} between {at[outside][0]:g} and "
                    f"{at[outside][-1]:g} nm, which is not used",
                )
            )
    steps = np.diff(at)
    wide = (steps > LARGEST_GAP_NM) & (at[1:] > low) & (at[:-1] < high)
    if wide.any() and len(at) > 20:
        k = int(np.flatnonzero(wide)[0])
        noticed.append(
            findings.warning(
                path,
                f"no value between {at[k]:g} and {at[k + 1]:g} nm",
                f"steps of {LARGEST_GAP_NM:g} nm at most",
                "A straight line is drawn.",
            )
        )


def _check_sum(leaf: pd.DataFrame, path: str | Path) -> None:
    """A leaf gives back no more light than it gets."""
    total = leaf["reflectance"] + leaf["transmittance"]
    if (total > 1.0 + NOISE).any():
        row = leaf[total > 1.0 + NOISE].iloc[0]
        raise InputError(
            path,
            f"reflectance {row['reflectance']:.3g} and transmittance {row['transmittance']:.3g} at "
            f"{row['wavelength_nm']:g} nm",
            "a sum of 1 at most",
            "Check the reference of the measurement, or the units of both columns.",
        )
