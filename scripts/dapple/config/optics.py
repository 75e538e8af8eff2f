"""Spectra of leaf, bark and ground."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import NotNegative, Section, Share, Some, key


class LeafOptics(Section):
    """PROSPECT-D parameters of the leaves."""

    n: Annotated[float, Ge(1), Le(4)] = key(1.5, "leaf structure index N")
    chlorophyll_ug_cm2: NotNegative = key(45.0, "chlorophyll a + b")
    carotenoids_ug_cm2: NotNegative = key(9.0, "carotenoids")
    brown: NotNegative = key(0.0, "brown pigments, arbitrary units")
    water_cm: NotNegative = key(0.012, "equivalent water thickness")
    dry_matter_g_cm2: NotNegative = key(0.006, "dry matter")


class Spectrum(Section):
    """A reflectance spectrum, linear between its wavelengths."""

    wavelength_nm: Some[float] = key((400.0, 700.0), "wavelengths, ascending")
    reflectance: Some[Share] = key((0.2, 0.2), "one value for each wavelength")
    path: str = key("", "instead: a table of wavelength and reflectance, relative to data_dir")


class Optics(Section):
    """Spectra of leaf, bark and meadow."""

    leaf: LeafOptics = LeafOptics()
    bark: Spectrum = Spectrum(wavelength_nm=(400.0, 550.0, 700.0), reflectance=(0.10, 0.18, 0.26))
    ground: Spectrum = Spectrum(
        wavelength_nm=(400.0, 500.0, 550.0, 600.0, 680.0, 700.0),
        reflectance=(0.03, 0.05, 0.10, 0.07, 0.05, 0.12),
    )
