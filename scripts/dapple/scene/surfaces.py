"""What light meets: surfaces of leaves, wood and terrain, turbid voxels, the ground."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.scene.counters import Counters

LEAF, WOOD, GROUND = "leaf", "wood", "ground"
"""Names of the usual optics."""


@dataclass(frozen=True)
class Surface:
    """A mesh, what it is made of and where it stands.

    Attributes
    ----------
    mesh : Mesh
        Local frame [m].
    optics : str
        Name of its spectra in `scene_optics.Optics`.
    is_leaf : bool
        A bi-Lambertian leaf, both faces of which reflect and transmit; else opaque and Lambertian.
    places_m : (k, 3) float64 or None
        The mesh stands at these places, shifted from where it is, and is stored once; None: where
        it is [m]. Surfaces of one plant have the same places.
    """

    mesh: Mesh
    optics: str = LEAF
    is_leaf: bool = True
    places_m: np.ndarray | None = None


def of_kinds(
    leaf: Mesh | None = None, wood: Mesh | None = None, ground: Mesh | None = None
) -> tuple[Surface, ...]:
    """Surfaces of the usual optics: one kind of leaves, wood, terrain that is not flat."""
    kinds = {LEAF: leaf, WOOD: wood, GROUND: ground}
    return tuple(
        Surface(mesh, name, is_leaf=name == LEAF)
        for name, mesh in kinds.items()
        if mesh is not None
    )


@dataclass(frozen=True)
class Scene:
    """One reconstruction of a place, in the local frame.

    Attributes
    ----------
    surfaces : sequence of Surface
        Meshes, each with its optics; several may share theirs.
    voxels : xarray.Dataset or None
        Turbid leaf medium: `plant_area_density_m2_m3` (x, y, z), attribute `voxel_size_m`.
    ground_z_m : float
        Height of the flat Lambertian ground around and below everything [m]; with terrain no higher
        than its lowest point, since it has no hole where the terrain is.
    voxel_optics, ground_optics : str
        Names of the optics of the voxels' leaves and of the ground, flat or terrain.
    """

    surfaces: Sequence[Surface] = ()
    voxels: xr.Dataset | None = None
    ground_z_m: float = 0.0
    voxel_optics: str = LEAF
    ground_optics: str = GROUND

    @property
    def filled(self) -> tuple[Surface, ...]:
        """Surfaces that have triangles."""
        return tuple(surface for surface in self.surfaces if len(surface.mesh.faces))

    @property
    def counters(self) -> Counters:
        """What light paths count in this scene: leaves before opaque surfaces, the ground last.

        Raises
        ------
        InputError
            One name for leaves and for something opaque.
        """
        leaves = [surface.optics for surface in self.surfaces if surface.is_leaf]
        leaves += [] if self.voxels is None else [self.voxel_optics]
        others = [surface.optics for surface in self.surfaces if not surface.is_leaf]
        others = [name for name in others if name != self.ground_optics] + [self.ground_optics]
        if both := set(leaves) & set(others):
            raise InputError(
                "Scene.surfaces",
                f"the optics `{min(both)}` of leaves and of an opaque surface",
                "each name for one of both",
                "Name the optics of one of them differently.",
            )
        return Counters(tuple(dict.fromkeys(leaves)), tuple(dict.fromkeys(others)))

    @property
    def bounds_m(self) -> np.ndarray:
        """(2, 3) lowest and highest coordinates of meshes and filled voxels [m]."""
        corners = [_corners(surface) for surface in self.filled]
        if (grid := turbid_grid(self.voxels)) is not None:
            size = np.array(grid.plant_area_density_m2_m3.shape) * grid.voxel_size_m
            corners.append(np.array([grid.low_m, grid.low_m + size]))
        points = np.concatenate(corners)
        return np.array([points.min(axis=0), points.max(axis=0)])

    @property
    def plants(self) -> list[tuple[np.ndarray | None, list[Surface]]]:
        """Surfaces that have triangles, together with those that stand at the same places.

        Of each plant its places (None: where it is) and surfaces; leaves come first, as everywhere.
        """
        found: list[tuple[np.ndarray | None, list[Surface]]] = []
        order = self.counters
        for surface in sorted(self.filled, key=lambda one: order.reflected(one.optics)):
            at = surface.places_m
            for places, together in found:
                if places is at or (
                    places is not None and at is not None and np.array_equal(places, at)
                ):
                    together.append(surface)
                    break
            else:
                found.append((at, [surface]))
        return found

    def of(self, optics: str) -> tuple[Surface, ...]:
        """Surfaces of these optics."""
        return tuple(surface for surface in self.surfaces if surface.optics == optics)

    def check(self) -> None:
        """Make sure that the flat ground hides no terrain.

        Raises
        ------
        InputError
            Terrain dips below the flat ground.
        """
        terrain = [_corners(one) for one in self.filled if one.optics == self.ground_optics]
        if (lowest := min((low[2] for low, _ in terrain), default=np.inf)) < self.ground_z_m:
            raise InputError(
                "Scene.ground_z_m",
                f"{self.ground_z_m:.3f} m",
                f"at most {lowest:.3f} m, where the terrain is lowest",
                "Lower the flat ground: it would hide parts of the terrain.",
            )


def _corners(surface: Surface) -> np.ndarray:
    """(2, 3) lowest and highest coordinates of a surface at all its places [m]."""
    corners = surface.mesh.vertices_m.min(axis=0), surface.mesh.vertices_m.max(axis=0)
    if surface.places_m is None:
        return np.array(corners)
    places = surface.places_m.min(axis=0), surface.places_m.max(axis=0)
    return np.array(corners) + np.array(places)


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
