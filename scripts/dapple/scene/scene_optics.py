"""Optical properties of all surfaces of a scene: from spectra or a file, in many bands or few."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import netcdf
from dapple.optics.bands import par_bands
from dapple.optics.default_spectra import BARK, MEADOW
from dapple.optics.leaf import leaf_spectra, measured_leaf
from dapple.optics.surface_spectra import Spectrum, reflectance

LEAF_FILE = {
    "path",
    "wavelength_column",
    "reflectance_column",
    "transmittance_column",
    "decimal",
}
"""Options of a leaf that belong to a measured spectrum."""


@dataclass(frozen=True)
class Optics:
    """Optical properties of surfaces in b bands, by name of surface.

    Attributes
    ----------
    wavelength_nm : (b,) float64
        Centres of the bands [nm].
    reflectance : dict of str to (b,) float64
        0 to 1.
    transmittance : dict of str to (b,) float64
        Of leaves, 0 to 1; what is not named here is opaque.
    """

    wavelength_nm: np.ndarray
    reflectance: Mapping[str, np.ndarray]
    transmittance: Mapping[str, np.ndarray]

    @classmethod
    def of_tree(
        cls,
        wavelength_nm: np.ndarray,
        leaf_reflectance: np.ndarray,
        leaf_transmittance: np.ndarray,
        wood_reflectance: np.ndarray,
        ground_reflectance: np.ndarray,
    ) -> "Optics":
        """Of the usual surfaces `leaf`, `wood` and `ground`, (b,) each."""
        reflected = {"leaf": leaf_reflectance, "wood": wood_reflectance}
        reflected["ground"] = ground_reflectance
        return cls(wavelength_nm, reflected, {"leaf": leaf_transmittance})

    def __len__(self) -> int:
        return len(self.wavelength_nm)

    def reflectance_of(self, name: str) -> np.ndarray:
        """(b,) reflectance of a surface.

        Raises
        ------
        InputError
            There are no optics of that name.
        """
        return self._of(self.reflectance, name, "reflectance")

    def reflectance_at(self, name: str, wavelength_nm: Sequence[float]) -> np.ndarray:
        """(n,) reflectance of a surface at wavelengths [nm], linear between bands."""
        return np.interp(wavelength_nm, self.wavelength_nm, self.reflectance_of(name))

    def transmittance_of(self, name: str) -> np.ndarray:
        """(b,) transmittance of a leaf; raises as `reflectance_of`."""
        return self._of(self.transmittance, name, "transmittance")

    def albedo(self, name: str) -> np.ndarray:
        """(b,) share of light that a leaf sends on to either side."""
        return self.reflectance_of(name) + self.transmittance_of(name)

    def each(self, change: Callable[[np.ndarray], np.ndarray]) -> "Optics":
        """The same surfaces with every array (b,) changed, wavelengths too."""
        return Optics(
            change(self.wavelength_nm),
            {name: change(values) for name, values in self.reflectance.items()},
            {name: change(values) for name, values in self.transmittance.items()},
        )

    def of_band(self, band: int) -> "Optics":
        """The same surfaces in one band alone."""
        return self.each(lambda values: values[band : band + 1])

    def with_black(self, name: str) -> "Optics":
        """The same, but one surface reflects nothing."""
        black = {name: np.zeros(len(self))}
        return Optics(self.wavelength_nm, {**self.reflectance, **black}, self.transmittance)

    @staticmethod
    def _of(table: Mapping[str, np.ndarray], name: str, what: str) -> np.ndarray:
        if name not in table:
            raise InputError(
                "optics",
                f"no {what} of `{name}`, only of {', '.join(table) or 'nothing'}",
                "the optics of every surface of the scene",
                "Add its spectra, or name the surface's optics as they are called there.",
            )
        return table[name]


def from_spectra(
    *,
    leaf: Mapping[str, float | str] | None = None,
    bark: Spectrum = BARK,
    ground: Spectrum = MEADOW,
    wavelength_nm: np.ndarray | None = None,
    noticed: list[Finding] | None = None,
) -> Optics:
    """Optical properties of leaves, wood and ground in every band.

    Parameters
    ----------
    leaf : mapping or None
        Keyword arguments of `dapple.optics.leaf.leaf_spectra`, or `path` and those of
        `measured_leaf`; None: the defaults of the former.
    bark, ground : float, mapping or path
        See `reflectance`.
    wavelength_nm : (b,) float or None
        Band centres [nm]; None: 400 to 700 nm in steps of 5 nm.
    noticed : list or None
        What is noticed about files of spectra is appended to it.

    Returns
    -------
    Optics
    """
    wavelength = par_bands() if wavelength_nm is None else np.asarray(wavelength_nm, float)
    return Optics.of_tree(
        wavelength,
        *_leaf(leaf or {}, wavelength, noticed),
        reflectance(bark, wavelength, where="bark reflectance", noticed=noticed),
        reflectance(ground, wavelength, where="ground reflectance", noticed=noticed),
    )


def _leaf(
    options: Mapping[str, Any], wavelength_nm: np.ndarray, noticed: list[Finding] | None
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and transmittance (b,) of leaves, measured or by PROSPECT."""
    columns = {key: value for key, value in options.items() if key in LEAF_FILE}
    if path := columns.pop("path", ""):
        return measured_leaf(path, wavelength_nm, noticed=noticed, **columns)
    return leaf_spectra(
        wavelength_nm, **{key: value for key, value in options.items() if key not in LEAF_FILE}
    )


def write(path: str | Path, optics: Optics) -> None:
    """Write optical properties as NetCDF with the dimension `band`."""
    variables = {
        f"{name}_{kind}": ("band", values, {"units": "1", "long_name": f"{kind} of {name}"})
        for kind in ("reflectance", "transmittance")
        for name, values in getattr(optics, kind).items()
    }
    centre = {"units": "nm", "long_name": "centre of the band"}
    netcdf.write(
        path, xr.Dataset(variables, {"wavelength_nm": ("band", optics.wavelength_nm, centre)})
    )


def read(path: str | Path) -> Optics:
    """Read optical properties as `write` writes them."""
    dataset = netcdf.read(path)
    reflected, passed = (
        {
            str(name).removesuffix(f"_{kind}"): values.to_numpy()
            for name, values in dataset.data_vars.items()
            if str(name).endswith(f"_{kind}")
        }
        for kind in ("reflectance", "transmittance")
    )
    return Optics(dataset["wavelength_nm"].to_numpy(), reflected, passed)


def group_bands(
    optics: Optics, direct: np.ndarray, diffuse: np.ndarray, n: int = 3
) -> tuple[Optics, np.ndarray]:
    """Gather bands into a few groups of like leaves, weighted by photon flux.

    What differs between bands is mostly how much a leaf scatters, so the bands are ordered by
    leaf albedo and cut where the flux-weighted variance of albedo within groups is least.

    Parameters
    ----------
    optics : Optics
        Properties of b bands.
    direct, diffuse : (b,) or (time, b) array
        Photon flux of the beam and the sky; only their ratios between bands matter.
    n : int
        Number of groups, 1 to 3.

    Returns
    -------
    Optics
        Flux-weighted properties of the n groups.
    group : (b,) int64
        The group of each band; `group_flux` sums fluxes accordingly.
    """
    if not 1 <= n <= 3 or n > len(optics):
        raise InputError(
            "n_bands", f"{n} groups of {len(optics)} bands", "1 to 3", "Ask for fewer groups."
        )
    n_bands = len(optics)
    flux = sum(np.reshape(values, (-1, n_bands)).sum(axis=0) for values in (direct, diffuse))
    if flux.sum() <= 0.0:
        flux = np.ones(n_bands)
    albedo = _mean_albedo(optics)
    order = np.argsort(albedo, kind="stable")
    group = np.empty(n_bands, dtype=np.int64)
    group[order] = _least_variance_groups(albedo[order], flux[order], n)
    total = group_flux(flux, group, n)

    def mean(values: np.ndarray) -> np.ndarray:
        return group_flux(flux * values, group, n) / np.where(total > 0.0, total, 1.0)

    return optics.each(mean), group


def _mean_albedo(optics: Optics) -> np.ndarray:
    """(b,) of all kinds of leaves; of all surfaces where there are no leaves."""
    albedos = [optics.albedo(name) for name in optics.transmittance]
    return np.mean(albedos or list(optics.reflectance.values()), axis=0)


def group_flux(values: np.ndarray, group: np.ndarray, n: int) -> np.ndarray:
    """Sum fluxes (..., b) of bands to fluxes (..., n) of their groups."""
    return np.stack([values[..., group == k].sum(axis=-1) for k in range(n)], axis=-1)


def _least_variance_groups(value: np.ndarray, weight: np.ndarray, n: int) -> np.ndarray:
    """Cut ascending values into n runs with the least weighted variance within; by trial."""
    zeroth, first, second = (
        np.concatenate([[0.0], np.cumsum(weight * value**power)]) for power in range(3)
    )
    index = np.arange(len(value))
    best, best_cost = np.zeros(n + 1, int), np.inf
    for cuts in combinations(range(1, len(value)), n - 1):
        edges = np.array([0, *cuts, len(value)])
        mass, moment = np.diff(zeroth[edges]), np.diff(first[edges])
        explained = np.divide(moment**2, mass, out=np.zeros(n), where=mass > 0.0)
        cost = second[-1] - explained.sum() + (mass <= 0.0).sum()
        if cost < best_cost:
            best, best_cost = edges, cost
    return np.searchsorted(best[1:], index, side="right")
