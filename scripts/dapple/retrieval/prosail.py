"""One-dimensional images: SAIL over the plant area index of every cell."""

import numpy as np

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.retrieval.spectra import Spectra

SPHERICAL_MEAN_ANGLE_DEG = 57.0
"""Mean leaf angle at which the ellipsoidal distribution is spherical (Campbell 1990)."""


def plant_area_index(
    plants: Mesh, *, left_m: float, top_m: float, cell_m: float, shape: tuple[int, int]
) -> np.ndarray:
    """Area of facets over the area of their cell.

    Parameters
    ----------
    plants : Mesh
        Facets of leaf and wood, in the frame of `left_m` and `top_m`.
    left_m, top_m : float
        Outer north-west corner of the cells [m].
    cell_m : float
        Edge of a cell [m].
    shape : (int, int)
        Rows and columns of cells. Triangles whose centre lies beyond are left out.

    Returns
    -------
    (rows, columns) float64
        One-sided plant area per ground area [m² m⁻²].
    """
    centre = plants.vertices_m[plants.faces].mean(axis=1)
    row = np.floor((top_m - centre[:, 1]) / cell_m).astype(np.int64)
    column = np.floor((centre[:, 0] - left_m) / cell_m).astype(np.int64)
    inside = (row >= 0) & (row < shape[0]) & (column >= 0) & (column < shape[1])
    cell = row[inside] * shape[1] + column[inside]
    area = np.bincount(cell, plants.triangle_area_m2[inside], shape[0] * shape[1])
    return area.reshape(shape) / cell_m**2


def images(
    plant_area_index: np.ndarray,
    spectra: Spectra,
    *,
    sun_zenith_deg: float,
    diffuse_share: np.ndarray,
    leaf_angle_deg: float = SPHERICAL_MEAN_ANGLE_DEG,
    hot_spot: float = 0.01,
) -> np.ndarray:
    """Reflectance of every cell as if it were an endless level canopy, seen from the nadir.

    Parameters
    ----------
    plant_area_index : (rows, columns) float
        Of each cell [m² m⁻²].
    spectra : Spectra
        Leaves and soils of n combinations.
    sun_zenith_deg : float
        Below 90.
    diffuse_share : (b,) or (n, b) float
        Share of the irradiance of level ground that comes from the sky.
    leaf_angle_deg : float
        Mean of the ellipsoidal leaf angle distribution.
    hot_spot : float
        Leaf size over canopy height; seen from the nadir under a low sun it hardly matters.

    Returns
    -------
    (rows * columns, n, b) float32
        Reflectance of level ground, as chunks of `training.aggregate` want it.

    Raises
    ------
    InputError
        The sun is not above the horizon, or a plant area index is negative or unknown.

    Notes
    -----
    SAIL with a hot spot (Verhoef et al. 2007) as implemented in the package `prosail`. Sun and
    sky are weighted by their shares: R = (1 - d) R_so + d R_do. It knows no shadows of
    neighbours, no crowns and no gaps between them.
    """
    if not 0.0 <= sun_zenith_deg < 90.0:
        raise InputError(
            "sun_zenith_deg", f"{sun_zenith_deg}", "0 to less than 90", "Images are taken by day."
        )
    area = np.asarray(plant_area_index, float).ravel()
    if not (area >= 0).all():
        raise InputError(
            "plant area index", f"{area.min()}", "0 or more in every cell",
            "Check the facets of the scene.",
        )  # fmt: skip
    from prosail.FourSAIL import foursail  # takes seconds to import

    n, bands = spectra.leaf_reflectance.shape
    leaf_r, leaf_t, soil = (
        np.ascontiguousarray(values, float).ravel()
        for values in (
            spectra.leaf_reflectance, spectra.leaf_transmittance, spectra.soil_reflectance,
        )
    )  # fmt: skip
    sky = np.broadcast_to(diffuse_share, (n, bands)).ravel()
    values = np.empty((len(area), n, bands), np.float32)
    for cell, index in enumerate(area):
        terms = foursail(
            leaf_r, leaf_t, leaf_angle_deg, 0.0, 2, index, hot_spot, sun_zenith_deg, 0.0, 0.0, soil
        )
        hemispherical, bidirectional = terms[14], terms[17]
        mixed = (1.0 - sky) * bidirectional + sky * hemispherical
        values[cell] = np.reshape(mixed, (n, bands))
    return values
