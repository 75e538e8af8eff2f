"""What light meets: meshes of leaves, wood and terrain, turbid voxels, the ground, and optics."""

from dataclasses import dataclass, field
from itertools import combinations

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.formats.meshes import Mesh

MESH_KINDS = ("leaf", "wood", "ground")


@dataclass(frozen=True)
class Scene:
    """One reconstruction of a place, in the local frame.

    Attributes
    ----------
    meshes : dict of str to Mesh
        By optical kind: `leaf` (bi-Lambertian), `wood` and `ground` (Lambertian, opaque). The
        latter is terrain that is not flat.
    voxels : xarray.Dataset or None
        Turbid leaf medium: `plant_area_density_m2_m3` (x, y, z), attribute `voxel_size_m`.
    ground_z_m : float
        Height of the flat Lambertian ground around and below everything [m]; with terrain no higher
        than its lowest point, since it has no hole where the terrain is.
    """

    meshes: dict[str, Mesh] = field(default_factory=dict)
    voxels: xr.Dataset | None = None
    ground_z_m: float = 0.0

    @property
    def bounds_m(self) -> np.ndarray:
        """(2, 3) lowest and highest coordinates of meshes and filled voxels [m]."""
        corners = [mesh.vertices_m for mesh in self.meshes.values() if len(mesh.vertices_m)]
        if (grid := turbid_grid(self.voxels)) is not None:
            size = np.array(grid.plant_area_density_m2_m3.shape) * grid.voxel_size_m
            corners.append(np.array([grid.low_m, grid.low_m + size]))
        points = np.concatenate(corners)
        return np.array([points.min(axis=0), points.max(axis=0)])

    def check_kinds(self) -> None:
        """Make sure that engines know what they are given.

        Raises
        ------
        InputError
            An unknown kind of mesh, or terrain that dips below the flat ground.
        """
        if unknown := set(self.meshes) - set(MESH_KINDS):
            raise InputError(
                "Scene.meshes",
                f"the kind {sorted(unknown)[0]}",
                f"one of {', '.join(MESH_KINDS)}",
                "Give each mesh an optical kind.",
            )
        terrain = self.meshes.get("ground")
        lowest = np.inf if terrain is None else terrain.vertices_m[:, 2].min(initial=np.inf)
        if lowest < self.ground_z_m:
            raise InputError(
                "Scene.ground_z_m",
                f"{self.ground_z_m:.3f} m",
                f"at most {lowest:.3f} m, where the terrain is lowest",
                "Lower the flat ground: it would hide parts of the terrain.",
            )


@dataclass(frozen=True)
class Optics:
    """Optical properties per band: arrays of shape (b,), 0 to 1, and b band centres [nm]."""

    wavelength_nm: np.ndarray
    leaf_reflectance: np.ndarray
    leaf_transmittance: np.ndarray
    bark_reflectance: np.ndarray
    ground_reflectance: np.ndarray

    def __len__(self) -> int:
        return len(self.wavelength_nm)


@dataclass(frozen=True)
class TurbidGrid:
    """A box of voxels that hold leaves, cropped to those that are not empty.

    Attributes
    ----------
    plant_area_density_m2_m3 : (nx, ny, nz) float64
        Finite, not negative; one-sided leaf area per volume.
    low_m : (3,) float64
        Outer corner of the first voxel, local frame [m].
    voxel_size_m : float
        Edge of the cubic voxels [m].
    leaf_angle_distribution : str
        Of the leaves' normals.
    """

    plant_area_density_m2_m3: np.ndarray
    low_m: np.ndarray
    voxel_size_m: float
    leaf_angle_distribution: str


def turbid_grid(voxels: xr.Dataset | None) -> TurbidGrid | None:
    """Crop a voxel dataset to the box of its filled voxels; unknown (NaN) voxels count as empty.

    Parameters
    ----------
    voxels : xarray.Dataset or None
        `plant_area_density_m2_m3` (x, y, z), attributes `voxel_size_m` and
        `leaf_angle_distribution` (spherical where it is missing).

    Returns
    -------
    TurbidGrid or None
        None where there is no voxel with leaves.

    Raises
    ------
    InputError
        A negative density.
    """
    if voxels is None:
        return None
    density = voxels["plant_area_density_m2_m3"].transpose("x", "y", "z")
    values = np.nan_to_num(density.to_numpy().astype(np.float64), nan=0.0)
    if values.min(initial=0.0) < 0.0:
        raise InputError(
            "plant_area_density_m2_m3",
            f"a density of {values.min():.3g} m2/m3",
            "no negative density",
            "Check the estimator that made the voxels.",
        )
    if not values.any():
        return None
    size = float(voxels.attrs["voxel_size_m"])
    box, low = [], []
    for axis, name in enumerate("xyz"):
        others = tuple(other for other in range(3) if other != axis)
        filled = np.flatnonzero(values.any(axis=others))
        box.append(slice(filled[0], filled[-1] + 1))
        low.append(float(density[name].to_numpy()[filled[0]]) - 0.5 * size)
    angles = str(voxels.attrs.get("leaf_angle_distribution", "spherical")).lower()
    return TurbidGrid(values[tuple(box)], np.array(low), size, angles)


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
    albedo = optics.leaf_reflectance + optics.leaf_transmittance
    order = np.argsort(albedo, kind="stable")
    group = np.empty(n_bands, dtype=np.int64)
    group[order] = _least_variance_groups(albedo[order], flux[order], n)
    total = group_flux(flux, group, n)
    fields = ("wavelength_nm", "leaf_reflectance", "leaf_transmittance")
    fields += ("bark_reflectance", "ground_reflectance")
    means = {
        name: group_flux(flux * np.asarray(getattr(optics, name)), group, n)
        / np.where(total > 0.0, total, 1.0)
        for name in fields
    }
    return Optics(**means), group


def group_flux(values: np.ndarray, group: np.ndarray, n: int) -> np.ndarray:
    """Sum fluxes (..., b) of bands to fluxes (..., n) of their groups."""
    return np.stack([values[..., group == k].sum(axis=-1) for k in range(n)], axis=-1)


def _least_variance_groups(value: np.ndarray, weight: np.ndarray, n: int) -> np.ndarray:
    """Cut ascending values into n runs with the least weighted variance within; by trial."""
    zeroth, first, second = (
        np.concatenate([[0.0], np.cumsum(weight * value**power)]) for power in range(3)
    )
    index = np.arange(len(value))
    best, best_cost = None, np.inf
    for cuts in combinations(range(1, len(value)), n - 1):
        edges = np.array([0, *cuts, len(value)])
        mass, moment = np.diff(zeroth[edges]), np.diff(first[edges])
        explained = np.divide(moment**2, mass, out=np.zeros(n), where=mass > 0.0)
        cost = second[-1] - explained.sum() + (mass <= 0.0).sum()
        if cost < best_cost:
            best, best_cost = edges, cost
    return np.searchsorted(best[1:], index, side="right")
