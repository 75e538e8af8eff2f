"""Optical properties of a virtual plot: needles by tree and height, bark, and ground in patches."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.stats import truncnorm

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import Band, Camera
from dapple.optics.default_spectra import FOREST_SOIL, LITTER
from dapple.optics.leaf import camera_leaves

WET_LOSS = 0.5
"""Share of a dry soil's reflectance that it loses when saturated (Lobell and Asner 2002)."""
BELL = np.linspace(-1.1, 1.1, 23)
"""Where a band's response is told, in full widths at half its maximum."""


@dataclass(frozen=True)
class Materials:
    """What the faces of a scene are made of.

    Attributes
    ----------
    reflectance, transmittance : (m, b) float64
        Of each material in each band, 0 to 1.
    of_face : (t,) int32
        Material of each triangle.
    """

    reflectance: np.ndarray
    transmittance: np.ndarray
    of_face: np.ndarray


def chlorophyll(
    n: int,
    *,
    mean_ug_cm2: float,
    sd_ug_cm2: float,
    range_ug_cm2: tuple[float, float],
    seed: int,
) -> np.ndarray:
    """Leaf chlorophyll content (n,) of trees: normal, cut off at a range [µg cm⁻²]."""
    low, high = range_ug_cm2
    if not (sd_ug_cm2 > 0 and low < mean_ug_cm2 < high):
        raise InputError(
            "chlorophyll.world.lcc_mean_ug_cm2",
            f"{mean_ug_cm2:g} with an SD of {sd_ug_cm2:g}",
            f"a mean within {low:g} to {high:g} and an SD above 0",
            "Widen lcc_range_ug_cm2 or correct the mean.",
        )
    cut = (np.array([low, high]) - mean_ug_cm2) / sd_ug_cm2
    return truncnorm.rvs(
        *cut, loc=mean_ug_cm2, scale=sd_ug_cm2, size=n, random_state=np.random.default_rng(seed)
    )


def layers(leaves: Mesh, n_layers: int) -> np.ndarray:
    """Height layer (n_elements,) of every shoot of a tree: equally deep, 0 the lowest."""
    total = np.bincount(leaves.element, leaves.vertices_m[leaves.faces, 2].mean(axis=1))
    height = total / np.bincount(leaves.element)
    share = (height - height.min()) / max(np.ptp(height), 1e-9)
    return np.minimum((share * n_layers).astype(np.int32), n_layers - 1)


def part_factor(
    part: np.ndarray, area_m2: np.ndarray, deviation: np.ndarray, lowest_to_highest: float
) -> np.ndarray:
    """Chlorophyll of each part of a crown as a multiple of the tree's mean.

    Parameters
    ----------
    part, area_m2 : (n_elements,)
        Part and area of every shoot. Parts are numbered layer by layer from below.
    deviation : (n_layers, n_kinds) float64
        Of the kinds of shoots within each layer, as a share of the layer's chlorophyll.
    lowest_to_highest : float
        Chlorophyll of the lowest over that of the highest layer; linear between.

    Returns
    -------
    (n_layers * n_kinds,) float64
        Its mean over the leaf area is 1.
    """
    height = np.arange(len(deviation)) / max(len(deviation) - 1, 1)
    layer = lowest_to_highest + (1.0 - lowest_to_highest) * height
    factor = (layer[:, None] * (1.0 + deviation)).ravel()
    weight = np.bincount(part, area_m2, factor.size)
    return factor * weight.sum() / (factor * weight).sum()


def needles(
    lcc_ug_cm2: np.ndarray,
    camera: Camera,
    *,
    structure_n: np.ndarray | float,
    dry_matter_g_cm2: np.ndarray | float,
    brown: np.ndarray | float,
    water_cm: np.ndarray | float,
    chlorophyll_per_carotenoid: np.ndarray | float,
) -> tuple[np.ndarray, np.ndarray]:
    """Reflectance and transmittance (n, b) of needles with chlorophyll (n,), by PROSPECT-5."""
    return camera_leaves(
        camera,
        n=structure_n,
        chlorophyll_ug_cm2=lcc_ug_cm2,
        carotenoids_ug_cm2=np.asarray(lcc_ug_cm2) / chlorophyll_per_carotenoid,
        brown=brown,
        water_cm=water_cm,
        dry_matter_g_cm2=dry_matter_g_cm2,
        prospect_version="5",
    )


def as_built(nominal: Camera, *, centre_sd_nm: float, width_sd: float, seed: int) -> Camera:
    """A camera as it left the factory: bell curves that lie a little beside the nominal windows.

    Parameters
    ----------
    nominal : Camera
        As its maker describes it; response curves that are told are moved and stretched.
    centre_sd_nm, width_sd : float
        Standard deviation of centres [nm], and of widths as a share; cut off at twice that.
    seed : int
    """
    rng, bands = np.random.default_rng(seed), []
    for band in nominal:
        shift, stretch = np.clip(rng.standard_normal(2), -2, 2) * (centre_sd_nm, width_sd)
        if band.response:
            at_nm, response = np.array(band.response).T
            at_nm = at_nm - band.centre_nm
        else:
            at_nm, response = BELL * band.width_nm, 0.5 ** (4 * BELL**2)
        at_nm = band.centre_nm + shift + at_nm * (1.0 + stretch)
        curve = tuple(zip(at_nm.tolist(), response.tolist(), strict=True))
        bands.append(Band(band.name, band.centre_nm, band.width_nm, curve))
    return Camera(tuple(bands))


def in_bands(spectrum: Mapping[str, Sequence[float]], camera: Camera) -> np.ndarray:
    """A spectrum of `optics.default_spectra` in the bands of a camera (b,)."""
    wavelength_nm, reflectance = (np.array(spectrum[k]) for k in ("wavelength_nm", "reflectance"))
    return camera_mean(wavelength_nm, reflectance, camera)


def ground_patches(
    centres_m: np.ndarray,
    camera: Camera,
    *,
    brightness: float,
    moisture: float,
    litter_share: float,
    variation: float,
    patch_m: float = 2.5,
    seed: int,
) -> np.ndarray:
    """Reflectance (n, b) of the ground at places (n, 2), in patches.

    A brown forest soil mixes with litter of needles. Two smooth textures vary them: one the
    moisture of the soil, one the share of litter.

    Parameters
    ----------
    centres_m : (n, 2) float64
        Places [m].
    camera : Camera
    brightness, moisture, litter_share : float
        A factor of the dry soil's reflectance, and means: of moisture as a share of saturation,
        and of the ground under litter.
    variation : float
        Standard deviation of moisture and of litter share.
    patch_m : float
        Typical width of patches of litter; those of moisture are twice as wide [m].
    seed : int
    """
    moist = np.clip(moisture + variation * _texture(centres_m, 2 * patch_m, seed), 0, 1)
    litter = np.clip(litter_share + variation * _texture(centres_m, patch_m, seed + 1), 0, 1)
    darker = brightness * (1.0 - WET_LOSS * moist[:, None])
    soil = np.clip(darker * in_bands(FOREST_SOIL, camera), 0, 1)
    litter = litter[:, None]
    return (1 - litter) * soil + litter * in_bands(LITTER, camera)


def _texture(xy_m: np.ndarray, width_m: float, seed: int, n_waves: int = 40) -> np.ndarray:
    """Smooth noise of mean 0 and standard deviation 1: waves of random direction and length."""
    rng = np.random.default_rng(seed)
    direction, phase = rng.uniform(0, 2 * np.pi, (2, n_waves))
    number = 2 * np.pi / (width_m * rng.uniform(1.0, 4.0, n_waves))
    vector = number[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)
    total = np.zeros(len(xy_m))
    for wave, shift in zip(vector, phase, strict=True):
        total += np.sin(xy_m @ wave + shift)
    return total * np.sqrt(2.0 / n_waves)
