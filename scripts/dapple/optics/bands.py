"""The spectral bands in which dapple computes: photosynthetically active, and of a camera."""

import numpy as np
from scipy.constants import Avogadro, Planck, speed_of_light
from scipy.integrate import cumulative_trapezoid

from dapple.optics.cameras import Camera

PAR_RANGE_NM = (400.0, 700.0)
BAND_STEP_NM = 5.0


def par_bands(step_nm: float = BAND_STEP_NM) -> np.ndarray:
    """Centres of the bands [nm]: 400, 405 … 700; the first and the last are half as wide."""
    start, stop = PAR_RANGE_NM
    return np.linspace(start, stop, round((stop - start) / step_nm) + 1)


def band_edges(centres_nm: np.ndarray) -> np.ndarray:
    """Edges (b + 1,) of the bands [nm]: midway between centres, ending at the outer centres."""
    centres = np.asarray(centres_nm, float)
    return np.concatenate([centres[:1], 0.5 * (centres[1:] + centres[:-1]), centres[-1:]])


def band_width(centres_nm: np.ndarray) -> np.ndarray:
    """Widths (b,) of the bands [nm]."""
    return np.diff(band_edges(centres_nm))


def band_mean(wavelength_nm: np.ndarray, values: np.ndarray, centres_nm: np.ndarray) -> np.ndarray:
    """Average a tabulated spectrum, linear between its wavelengths, over each band.

    Parameters
    ----------
    wavelength_nm : (k,) float
        Ascending wavelengths of the table [nm]; they must cover the bands.
    values : (..., k) float
        The spectrum.
    centres_nm : (b,) float
        Band centres [nm].

    Returns
    -------
    (..., b) float64
        Exact means of the piecewise linear spectrum.
    """
    edges = band_edges(centres_nm)
    return window_mean(wavelength_nm, values, edges[:-1], edges[1:])


def window_mean(
    wavelength_nm: np.ndarray, values: np.ndarray, low_nm: np.ndarray, high_nm: np.ndarray
) -> np.ndarray:
    """Average a tabulated spectrum, linear between its wavelengths, over each window.

    Parameters
    ----------
    wavelength_nm : (k,) float
        Ascending wavelengths of the table [nm]; they must cover the windows.
    values : (..., k) float
        The spectrum.
    low_nm, high_nm : (b,) float
        Edges of the windows [nm], which may overlap or leave gaps.

    Returns
    -------
    (..., b) float64
        Exact means of the piecewise linear spectrum.
    """
    wavelength, values = np.asarray(wavelength_nm, float), np.asarray(values, float)
    low, high = np.asarray(low_nm, float), np.asarray(high_nm, float)
    first, last = low.min(), high.max()
    inside = (wavelength > first) & (wavelength < last)
    nodes = np.union1d(wavelength[inside], np.concatenate([low, high]))
    at_nodes = _between(wavelength, values, nodes)
    integral = cumulative_trapezoid(at_nodes, nodes, axis=-1, initial=0.0)
    at_edges = (integral[..., np.searchsorted(nodes, edge)] for edge in (high, low))
    return np.subtract(*at_edges) / (high - low)


def camera_mean(wavelength_nm: np.ndarray, values: np.ndarray, camera: Camera) -> np.ndarray:
    """Average a tabulated spectrum, linear between its wavelengths, over the bands of a camera.

    Parameters
    ----------
    wavelength_nm : (k,) float
        Ascending wavelengths of the table [nm]; they must cover the bands.
    values : (..., k) float
        The spectrum.
    camera : Camera

    Returns
    -------
    (..., b) float64
        Means weighted by each band's response.
    """
    wavelength, values = np.asarray(wavelength_nm, float), np.asarray(values, float)
    means = np.empty((*values.shape[:-1], len(camera)))
    flat = [k for k, band in enumerate(camera) if not band.response]
    if flat:
        centre, width = np.array(
            [(camera.bands[k].centre_nm, camera.bands[k].width_nm) for k in flat]
        ).T
        means[..., flat] = window_mean(
            wavelength, values, centre - 0.5 * width, centre + 0.5 * width
        )
    for k, band in enumerate(camera):
        if band.response:
            at, response = np.array(band.response).T
            nodes = np.union1d(at, wavelength[(wavelength > at[0]) & (wavelength < at[-1])])
            weight = np.interp(nodes, at, response)
            weight /= np.trapezoid(weight, nodes)
            at_nodes = _between(wavelength, values, nodes)
            means[..., k] = np.trapezoid(at_nodes * weight, nodes, axis=-1)
    return means


def _between(wavelength: np.ndarray, values: np.ndarray, nodes: np.ndarray) -> np.ndarray:
    """Values (..., m) of a piecewise linear spectrum at other wavelengths (m,)."""
    right = np.clip(np.searchsorted(wavelength, nodes), 1, len(wavelength) - 1)
    share = (nodes - wavelength[right - 1]) / (wavelength[right] - wavelength[right - 1])
    return values[..., right - 1] * (1 - share) + values[..., right] * share


def photon_flux(irradiance_w_m2: np.ndarray, wavelength_nm: np.ndarray) -> np.ndarray:
    """Photon flux [µmol m⁻² s⁻¹] of light of one wavelength: E λ / (h c N_A)."""
    joule_per_mole = Planck * speed_of_light * Avogadro / (np.asarray(wavelength_nm, float) * 1e-9)
    return 1e6 * np.asarray(irradiance_w_m2, float) / joule_per_mole
