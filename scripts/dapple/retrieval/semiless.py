"""Semi-LESS (Zhao et al. 2025): images by a four-stream formula whose terms are fitted to a trace.

For every pixel, with soil reflectance r,

    R = ρ_so + r (T1 - r ρ_dd T2) / (1 - r ρ_dd).

The four terms come from images over four reference soils, at several levels of leaf absorption.
Between levels each is a polynomial of the leaf albedo. The leaf enters through its total
absorption 1 - ρ - τ alone, with the ratio of ρ to τ that PROSPECT gives at one structure N (as in
the metamodel of Jiang et al. 2020): other leaf structures are an extrapolation.

What the terms must mean follows from the series of ground reflections R = ρ_so + c1 r + c2 r² +
c3 r³ + ..., to which the formula is equal when T1 = c1, ρ_dd = c3 / c2 = c4 / c3 and
T2 = T1 - c2 / ρ_dd. T1 is thus all light that the ground reflects just once, whatever way it came
and went: for parallel light that is τ_ssoo + τ_sd τ_oo + (τ_ss + τ_sd) τ_do, where τ_ssoo is the
chance that both sun and view get through to the same place. And since light that comes down to
stay for a second reflection has lost what it knew of the sun, c2 / ρ_dd is
(τ_ss + τ_sd) (τ_do + τ_oo), so that T2 = τ_ssoo - τ_ss τ_oo. It is no transmittance and no product
of T1's parts: it is 0 where sun and view get through independently, and taking the product
τ_ss τ_oo (or T1) for T2 leaves the brighter soils wrong. Multiplied by ρ_dd it stays finite where
nothing comes back from above, so that `ρ_dd T2` is what is kept.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from dapple.light.brf import SKY, SUN
from dapple.optics.leaf import leaf_spectra
from dapple.retrieval import coefficients as collision
from dapple.retrieval.coefficients import Coefficients, Combinations, Window

SOILS = (0.0, 0.2, 0.5, 0.8)
"""Reflectances of the reference soils; the first one is black."""
LARGEST_RETURN = 0.95
"""Bound on ρ_dd, which few paths do not tell well."""
CURVE_CHLOROPHYLL_UG_CM2 = (2.0, 10.0, 30.0, 80.0)
CURVE_DRY_MATTER_G_CM2 = (0.0, 0.004, 0.03)
CURVE_NM = np.arange(400.0, 901.0, 5.0)
"""Leaves and wavelengths that give ratios of reflectance to transmittance at every absorption."""


@dataclass(frozen=True)
class Fitted:
    """The terms of every pixel as polynomials of the leaf albedo.

    Attributes
    ----------
    window : Window
        The pixels.
    terms : (2, 4, m, pixels) float32
        Under sun and sky: ρ_so, T1, ρ_dd and ρ_dd T2; their polynomials in ascending powers.
    diffuse_share : (b,) or (n, b) float64
        Of the light on level ground that comes from the sky, in the bands of the images.
    """

    window: Window
    terms: np.ndarray
    diffuse_share: np.ndarray

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return self.window.rows, self.window.columns


def reference_leaves(n_levels: int = 14, structure: float = 1.5) -> tuple[np.ndarray, np.ndarray]:
    """Leaf reflectance and transmittance (n_levels,) at levels of absorption, for one structure.

    Parameters
    ----------
    n_levels : int
        From nearly no to nearly full absorption; denser where leaves are bright, since light that
        is scattered often changes fastest there.
    structure : float
        PROSPECT's N.
    """
    leaves = [
        leaf_spectra(CURVE_NM, n=structure, chlorophyll_ug_cm2=pigment, dry_matter_g_cm2=dry)
        for pigment in CURVE_CHLOROPHYLL_UG_CM2
        for dry in CURVE_DRY_MATTER_G_CM2
    ]
    reflectance, transmittance = (np.concatenate(column) for column in zip(*leaves, strict=True))
    albedo = reflectance + transmittance
    # Chebyshev points keep polynomials from swinging.
    nodes = 0.5 - 0.5 * np.cos(np.pi * (np.arange(n_levels) + 0.5) / n_levels)
    levels = albedo.min() + (albedo.max() - albedo.min()) * nodes
    order = np.argsort(albedo, kind="stable")
    share = np.interp(levels, albedo[order], (reflectance / albedo)[order])
    return levels * share, levels * (1 - share)


def fit(
    coefficients: Coefficients,
    diffuse_share: np.ndarray,
    *,
    n_levels: int = 14,
    structure: float = 1.5,
    degree: int = 6,
    bark: float = 0.2,
    soils: tuple[float, float, float, float] = SOILS,
    pixels_per_chunk: int = 8192,
) -> Fitted:
    """Fit the terms to images of reference leaves and soils.

    The images are those of the same paths as the collision orders': no other noise comes in, and
    one trace gives all 4 * n_levels channels.

    Parameters
    ----------
    coefficients : Coefficients
        Traced once.
    diffuse_share : (b,) float
        Of the light in the bands of the images that will be made.
    n_levels, structure
        As in `reference_leaves`.
    degree : int
        Of the polynomials, below n_levels.
    bark : float
        Reflectance of bark, the same in every band: the published terms know only the leaf's.
    soils : four floats
        Ascending; the first is 0.
    pixels_per_chunk : int
        Bounds memory.

    Returns
    -------
    Fitted
    """
    rho, tau = reference_leaves(n_levels, structure)
    powers = np.vander(rho + tau, degree + 1, increasing=True)
    to_polynomial = np.linalg.pinv(powers)
    leaves = np.repeat(rho, 4)[:, None], np.repeat(tau, 4)[:, None]
    ground = np.tile(soils, n_levels)[:, None]
    terms = np.empty((2, 4, degree + 1, len(coefficients.table)), np.float32)
    for source in (SUN, SKY):
        chunks = collision.image_chunks(
            coefficients,
            Combinations(*leaves, bark, ground, diffuse_share=float(source == SKY)),
            pixels_per_chunk=pixels_per_chunk,
        )
        for pixels, values in chunks:
            four = values.reshape(-1, n_levels, 4).astype(np.float64)
            for k, term in enumerate(solve(four, soils)):
                terms[source, k, :, pixels] = to_polynomial @ term.T
    return Fitted(coefficients.window, terms, np.asarray(diffuse_share, float))


def solve(reflectance: np.ndarray, soils: tuple[float, ...]) -> tuple[np.ndarray, ...]:
    """Terms of the formula from images over four soils.

    Parameters
    ----------
    reflectance : (..., 4) float64
        Over each soil.
    soils : (4,) float
        Their reflectances, ascending from 0.

    Returns
    -------
    rho_so, t1, rho_dd, rho_dd_t2 : (...) float64
        With them the formula gives the four reflectances back, unless ρ_dd met its bounds.
    """
    r = np.asarray(soils[1:], float)
    rho_so = reflectance[..., 0]
    y = (reflectance[..., 1:] - rho_so[..., None]) / r
    # y = T1 + ρ_dd (r y) - ρ_dd T2 r at three soils: eliminate T1, then ρ_dd T2.
    step, rise, own = (np.diff(x, axis=-1) for x in (r, y, r * y))
    below = own[..., 1] * step[0] - own[..., 0] * step[1]
    above = rise[..., 1] * step[0] - rise[..., 0] * step[1]
    known = np.abs(below) > 1e-9
    rho_dd = np.divide(above, below, out=np.zeros_like(above), where=known)
    rho_dd = np.clip(rho_dd, 0.0, LARGEST_RETURN)
    rho_dd_t2 = (rho_dd * (own[..., 0] + own[..., 1]) - (rise[..., 0] + rise[..., 1])) / step.sum()
    t1 = y[..., 0] - rho_dd * r[0] * y[..., 0] + rho_dd_t2 * r[0]
    return rho_so, t1, rho_dd, rho_dd_t2


def formula(rho_so, t1, rho_dd, rho_dd_t2, soil):
    """Reflectance over a soil, from the four terms."""
    return rho_so + soil * (t1 - soil * rho_dd_t2) / (1 - soil * rho_dd)


def images(
    fitted: Fitted,
    leaf_reflectance: np.ndarray,
    leaf_transmittance: np.ndarray,
    soil: np.ndarray,
) -> np.ndarray:
    """One image of given leaves and soil.

    Parameters
    ----------
    fitted : Fitted
        From `fit`; bark and diffuse share are those of the fit.
    leaf_reflectance, leaf_transmittance, soil : (b,) float
        In the bands of the fit, 0 to 1.

    Returns
    -------
    (b, rows, columns) float32
        Reflectance factor.
    """
    rows = (np.asarray(x)[None] for x in (leaf_reflectance, leaf_transmittance, soil))
    values = next(image_chunks(fitted, *rows, pixels_per_chunk=fitted.window.n_pixels))[1][:, 0]
    return np.ascontiguousarray(values.T).reshape(-1, *fitted.shape)


def image_chunks(
    fitted: Fitted,
    leaf_reflectance: np.ndarray,
    leaf_transmittance: np.ndarray,
    soil: np.ndarray,
    *,
    pixels_per_chunk: int = 2048,
) -> Iterator[tuple[slice, np.ndarray]]:
    """Images of many combinations of leaves and soils, some pixels at a time.

    Parameters
    ----------
    fitted : Fitted
        As in `images`.
    leaf_reflectance, leaf_transmittance, soil : (n, b) float
        Of n combinations; a single row serves all.
    pixels_per_chunk : int
        A chunk takes 24 bytes × pixels × combinations × bands of memory.

    Yields
    ------
    pixels : slice
        Of the image's pixels in row-major order.
    values : (pixels, n, b) float32
        Their reflectance factors.
    """
    rho, tau, ground = np.broadcast_arrays(
        *(np.atleast_2d(np.asarray(x, float)) for x in (leaf_reflectance, leaf_transmittance, soil))
    )
    share = np.broadcast_to(fitted.diffuse_share, rho.shape).reshape(-1).astype(np.float32)
    flat = ground.reshape(-1).astype(np.float32)
    powers = np.vander((rho + tau).reshape(-1), fitted.terms.shape[2], increasing=True)
    powers = np.ascontiguousarray(powers.T, np.float32)
    for low in range(0, fitted.window.n_pixels, pixels_per_chunk):
        pixels = slice(low, min(low + pixels_per_chunk, fitted.window.n_pixels))
        value = np.zeros((pixels.stop - low, len(flat)), np.float32)
        for source, part in ((SUN, 1 - share), (SKY, share)):
            if part.any():
                terms = (term[:, pixels].T @ powers for term in fitted.terms[source])
                rho_so, t1, rho_dd, rho_dd_t2 = terms
                value += part * formula(rho_so, t1, rho_dd, rho_dd_t2, flat)
        yield pixels, value.reshape(-1, *rho.shape)
