"""Spectra of leaf, bark and ground."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le

from dapple.config.base import NotNegative, Section, Share, Some, key
from dapple.optics.default_spectra import BARK, LEAF, MEADOW


class SpectrumTable(Section):
    """A measured spectrum."""

    path: str = key("", "table of wavelength and values, relative to data_dir")
    wavelength_column: str = key("", "column of wavelengths; empty: by its usual name")
    reflectance_column: str = key("", "column of reflectance; empty: by its usual name")
    decimal: Literal["", ".", ","] = key("", "decimal sign; empty: as the cells show")


class LeafOptics(SpectrumTable):
    """Parameters of PROSPECT-D, or a measured spectrum of both sides' light instead."""

    path: str = key(
        "", "instead: a table of wavelength, reflectance and transmittance, relative to data_dir"
    )
    transmittance_column: str = key("", "column of transmittance; empty: by its usual name")
    n: Annotated[float, Ge(1), Le(4)] = key(LEAF["n"], "leaf structure index N")
    chlorophyll_ug_cm2: NotNegative = key(LEAF["chlorophyll_ug_cm2"], "chlorophyll a + b")
    carotenoids_ug_cm2: NotNegative = key(LEAF["carotenoids_ug_cm2"], "carotenoids")
    brown: NotNegative = key(LEAF["brown"], "brown pigments, arbitrary units")
    water_cm: NotNegative = key(LEAF["water_cm"], "equivalent water thickness")
    dry_matter_g_cm2: NotNegative = key(LEAF["dry_matter_g_cm2"], "dry matter")


class Spectrum(SpectrumTable):
    """A reflectance spectrum, linear between its wavelengths."""

    path: str = key("", "instead: a table of wavelength and reflectance, relative to data_dir")

    wavelength_nm: Some[float] = key((400.0, 700.0), "wavelengths, ascending")
    reflectance: Some[Share] = key((0.2, 0.2), "one value for each wavelength")


class Optics(Section):
    """Spectra of leaf, bark and meadow."""

    leaf: LeafOptics = LeafOptics()
    bark: Spectrum = Spectrum.model_validate(BARK)
    ground: Spectrum = Spectrum.model_validate(MEADOW)
