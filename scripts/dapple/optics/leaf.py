"""Leaf reflectance and transmittance from biochemistry, with PROSPECT."""

from pathlib import Path

import numpy as np

from dapple.errors import InputError
from dapple.findings import Finding
from dapple.optics import spectrum_table
from dapple.optics.bands import band_mean, camera_mean
from dapple.optics.cameras import Camera
from dapple.optics.default_spectra import LEAF

# What PROSPECT was calibrated on, generously: beyond it the model runs, and means nothing.
LEAF_RANGES = {
    "n": (1.0, 4.0),
    "chlorophyll_ug_cm2": (0.0, 150.0),
    "carotenoids_ug_cm2": (0.0, 50.0),
    "anthocyanin_ug_cm2": (0.0, 50.0),
    "brown": (0.0, 5.0),
    "water_cm": (0.0, 0.1),
    "dry_matter_g_cm2": (0.0, 0.05),
}


def leaf_spectra(
    wavelength_nm: np.ndarray,
    *,
    n: float = LEAF["n"],
    chlorophyll_ug_cm2: float = LEAF["chlorophyll_ug_cm2"],
    carotenoids_ug_cm2: float = LEAF["carotenoids_ug_cm2"],
    anthocyanin_ug_cm2: float = LEAF["anthocyanin_ug_cm2"],
    brown: float = LEAF["brown"],
    water_cm: float = LEAF["water_cm"],
    dry_matter_g_cm2: float = LEAF["dry_matter_g_cm2"],
    prospect_version: str = "D",
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and transmittance of a leaf, averaged over each band.

    Parameters
    ----------
    wavelength_nm : (b,) float
        Band centres [nm], within 400 to 2500.
    n : float
        Leaf structure index N (number of elementary layers), 1 to 4.
    chlorophyll_ug_cm2, carotenoids_ug_cm2, anthocyanin_ug_cm2 : float
        Pigments per leaf area [µg cm⁻²]. PROSPECT-5 knows no anthocyanin.
    brown : float
        Brown pigments, in arbitrary units.
    water_cm, dry_matter_g_cm2 : float
        Equivalent water thickness [cm] and dry matter [g cm⁻²].
    prospect_version : {"5", "D"}
        Which calibration of the absorption coefficients.

    Returns
    -------
    reflectance, transmittance : (b,) float64
        Directional-hemispherical, 0 to 1.

    Raises
    ------
    InputError
        A parameter is outside the range in `LEAF_RANGES`.

    Notes
    -----
    Jacquemoud and Baret (1990), Féret et al. (2008, PROSPECT-5; 2017, PROSPECT-D), as
    implemented in the Python package `prosail`.
    """
    leaf = {
        "n": n,
        "chlorophyll_ug_cm2": chlorophyll_ug_cm2,
        "carotenoids_ug_cm2": carotenoids_ug_cm2,
        "anthocyanin_ug_cm2": anthocyanin_ug_cm2,
        "brown": brown,
        "water_cm": water_cm,
        "dry_matter_g_cm2": dry_matter_g_cm2,
    }
    table_nm, reflectance, transmittance = _prospect(leaf, prospect_version)
    return (
        band_mean(table_nm, reflectance, wavelength_nm),
        band_mean(table_nm, transmittance, wavelength_nm),
    )


def measured_leaf(
    path: str | Path,
    wavelength_nm: np.ndarray,
    *,
    noticed: list[Finding] | None = None,
    **columns: str,
) -> tuple[np.ndarray, np.ndarray]:
    """Measured reflectance and transmittance of a leaf, averaged over each band.

    Parameters
    ----------
    path : path
        A table with both (see `spectrum_table.read`).
    wavelength_nm : (b,) float
        Band centres [nm].
    noticed : list or None
        What is noticed about the file is appended to it.
    **columns
        Names of its columns and its decimal sign.

    Returns
    -------
    reflectance, transmittance : (b,) float64
    """
    used = (float(wavelength_nm[0]), float(wavelength_nm[-1]))
    spectrum = spectrum_table.read(
        path, used, with_transmittance=True, key="optics.leaf", **columns
    )
    if noticed is not None:
        noticed.extend(spectrum.findings)
    both = (spectrum.values[kind] for kind in ("reflectance", "transmittance"))
    reflected, passed = (band_mean(spectrum.wavelength_nm, one, wavelength_nm) for one in both)
    return reflected, passed


def camera_leaves(
    camera: Camera, *, prospect_version: str = "D", **leaf: np.ndarray | float
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and transmittance of many leaves in the bands of a camera.

    Parameters
    ----------
    camera : Camera
        Its bands lie within 400 to 2500 nm.
    prospect_version : {"5", "D"}
        Which calibration of the absorption coefficients.
    **leaf : float or (k,) array
        Parameters of `leaf_spectra`, broadcast against each other.

    Returns
    -------
    reflectance, transmittance : (k, b) float64
        Directional-hemispherical, 0 to 1.

    Raises
    ------
    InputError
        A parameter is unknown or outside the range in `LEAF_RANGES`.
    """
    if unknown := set(leaf) - set(LEAF):
        raise InputError("leaf", min(unknown), f"one of {', '.join(LEAF)}", "Correct the name.")
    columns = np.broadcast_arrays(*np.atleast_1d(*(LEAF | leaf).values()))
    both = np.empty((2, len(columns[0]), len(camera)))
    for k, row in enumerate(zip(*columns, strict=True)):
        one = {name: float(value) for name, value in zip(LEAF, row, strict=True)}
        table_nm, *spectra = _prospect(one, prospect_version)
        both[:, k] = camera_mean(table_nm, np.array(spectra), camera)
    return both[0], both[1]


def _prospect(
    leaf: dict[str, float], prospect_version: str
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Wavelengths [nm], 400 to 2500 in steps of 1, reflectance and transmittance."""
    _check(leaf, prospect_version)
    import prosail  # takes seconds to import, and only this function needs it

    return prosail.run_prospect(
        leaf["n"],
        leaf["chlorophyll_ug_cm2"],
        leaf["carotenoids_ug_cm2"],
        leaf["brown"],
        leaf["water_cm"],
        leaf["dry_matter_g_cm2"],
        ant=leaf["anthocyanin_ug_cm2"],
        prospect_version=prospect_version,
    )


def _check(leaf: dict[str, float], prospect_version: str) -> None:
    for name, value in leaf.items():
        low, high = LEAF_RANGES[name]
        if not low <= value <= high:
            raise InputError(
                f"leaf {name}", f"{value}", f"{low} to {high}", "Mind the unit in the name."
            )
    if prospect_version not in ("5", "D"):
        raise InputError(
            "leaf prospect_version", f"{prospect_version!r}", '"5" or "D"', "Choose one of them."
        )
    if prospect_version == "5" and leaf["anthocyanin_ug_cm2"] > 0:
        raise InputError(
            "leaf anthocyanin_ug_cm2",
            f"{leaf['anthocyanin_ug_cm2']} with PROSPECT-5",
            "0",
            'PROSPECT-5 knows no anthocyanin: set it to 0 or prospect_version to "D".',
        )
