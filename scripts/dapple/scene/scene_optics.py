"""All optical properties of a scene together, made from spectra or read from a file."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import xarray as xr

from dapple.formats import netcdf
from dapple.optics.bands import par_bands
from dapple.optics.leaf import leaf_spectra
from dapple.optics.surface_spectra import BARK, MEADOW, Spectrum, reflectance
from dapple.scene.surfaces import Optics

OPTICS_NAMES = {
    "leaf_reflectance": "reflectance of leaves",
    "leaf_transmittance": "transmittance of leaves",
    "bark_reflectance": "reflectance of bark",
    "ground_reflectance": "reflectance of the ground",
}


def from_spectra(
    *,
    leaf: Mapping[str, float | str] | None = None,
    bark: Spectrum = BARK,
    ground: Spectrum = MEADOW,
    wavelength_nm: np.ndarray | None = None,
) -> Optics:
    """Optical properties of leaves, bark and ground in every band.

    Parameters
    ----------
    leaf : mapping or None
        Keyword arguments of `dapple.optics.leaf.leaf_spectra`; None: its defaults.
    bark, ground : float, mapping or path
        See `reflectance`.
    wavelength_nm : (b,) float or None
        Band centres [nm]; None: 400 to 700 nm in steps of 5 nm.

    Returns
    -------
    Optics
    """
    wavelength = par_bands() if wavelength_nm is None else np.asarray(wavelength_nm, float)
    leaf_reflectance, leaf_transmittance = leaf_spectra(wavelength, **(leaf or {}))
    return Optics(
        wavelength_nm=wavelength,
        leaf_reflectance=leaf_reflectance,
        leaf_transmittance=leaf_transmittance,
        bark_reflectance=reflectance(bark, wavelength, where="bark reflectance"),
        ground_reflectance=reflectance(ground, wavelength, where="ground reflectance"),
    )


def write(path: str | Path, optics: Optics) -> None:
    """Write optical properties as NetCDF with the dimension `band`."""
    variables = {
        name: ("band", getattr(optics, name), {"units": "1", "long_name": text})
        for name, text in OPTICS_NAMES.items()
    }
    centre = {"units": "nm", "long_name": "centre of the band"}
    netcdf.write(
        path, xr.Dataset(variables, {"wavelength_nm": ("band", optics.wavelength_nm, centre)})
    )


def read(path: str | Path) -> Optics:
    """Read optical properties as `write` writes them."""
    dataset = netcdf.read(path)
    return Optics(**{name: dataset[name].to_numpy() for name in ("wavelength_nm", *OPTICS_NAMES)})
