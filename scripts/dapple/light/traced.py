"""A scene as the path kernel sees it: Mitsuba's meshes, an endless ground, turbid voxels."""

from types import ModuleType

import drjit as dr
import numpy as np
import xarray as xr

from dapple import engine
from dapple.formats.meshes import Mesh
from dapple.light.scene import Scene
from dapple.structure import leaf_angles

N_ANGLES = 1024
"""Entries of the tables of leaf angles."""
MAX_DRAWS = 64
"""Leaf normals that are drawn before the last is taken; one in two is accepted on average."""


class TracedScene:
    """What backward paths can meet; no dataclass, since Dr.Jit would make loop state of it.

    Attributes
    ----------
    mi : module
        Mitsuba, its variant set.
    meshes : mitsuba.Scene
        Leaf and wood.
    leaf : mitsuba shape pointer
        Tells leaf from wood.
    ground_z_m : float
        Height of the ground, an endless plane [m].
    grid : TurbidGrid or None
        Turbid voxels.
    ray_offset_m : float
        How far a scattered ray starts from its surface [m].
    """

    ray_offset_m = 1e-5

    def __init__(self, mi: ModuleType, meshes, leaf, ground_z_m: float, grid: "TurbidGrid | None"):
        self.mi, self.meshes, self.leaf = mi, meshes, leaf
        self.ground_z_m, self.grid = ground_z_m, grid


def load(scene: Scene, variant: str = "llvm_ad_mono") -> TracedScene:
    """Hand the meshes to Mitsuba and the voxels to Dr.Jit."""
    mi = engine.load(variant)
    shapes = {kind: _mitsuba_mesh(mi, kind, mesh) for kind, mesh in scene.meshes.items()}
    loaded = mi.load_dict({"type": "scene", **shapes}, optimize=False)
    leaf = mi.ShapePtr(shapes["leaf"]) if "leaf" in shapes else dr.zeros(mi.ShapePtr)
    grid = TurbidGrid(mi, scene.voxels) if scene.voxels is not None else None
    return TracedScene(mi, loaded, leaf, scene.ground_z_m, grid)


def _mitsuba_mesh(mi, name: str, mesh: Mesh):
    """A mesh without texture coordinates and vertex normals."""
    loaded = mi.Mesh(name, len(mesh.vertices_m), len(mesh.faces))
    parameters = mi.traverse(loaded)
    parameters["vertex_positions"] = mesh.vertices_m.astype(np.float32).ravel()
    parameters["faces"] = mesh.faces.astype(np.uint32).ravel()
    parameters.update()
    return loaded


class TurbidGrid:
    """Voxels filled with infinitely small leaves.

    Attributes
    ----------
    corner_m, size_m, shape
        Lower corner [m], edge [m], number of voxels in x, y, z.
    density : (nx * ny * nz,) Dr.Jit Float
        Plant area density [m² m⁻³], z fastest.
    projection : (N_ANGLES,) Dr.Jit Float
        G at equally spaced |cos| of the ray's zenith angle.
    inclination_cos : (N_ANGLES,) Dr.Jit Float
        Quantiles of the cosine of the leaves' inclination.
    """

    def __init__(self, mi: ModuleType, voxels: xr.Dataset):
        """Take a voxel dataset; unknown voxels count as empty."""
        density = np.nan_to_num(voxels["plant_area_density_m2_m3"].transpose("x", "y", "z").values)
        distribution = voxels.attrs["leaf_angle_distribution"]
        projection = leaf_angles.projection(distribution, np.arccos(np.linspace(0, 1, N_ANGLES)))
        quantiles = leaf_angles.normal_cosine_quantiles(distribution, N_ANGLES)
        self.mi = mi
        self.size_m = float(voxels.attrs["voxel_size_m"])
        self.corner_m = [float(voxels[axis][0]) - 0.5 * self.size_m for axis in "xyz"]
        self.shape = density.shape
        self.density = mi.Float(density.astype(np.float32).ravel())
        self.projection = mi.Float(projection.astype(np.float32))
        self.inclination_cos = mi.Float(quantiles.astype(np.float32))

    def _lookup(self, table, share):
        """A table over 0 to 1, linear between its entries."""
        position = dr.clip(share, 0, 1) * (N_ANGLES - 1)
        low = dr.minimum(self.mi.UInt32(position), N_ANGLES - 2)
        left, right = (dr.gather(self.mi.Float, table, low + k) for k in (0, 1))
        return dr.lerp(left, right, position - self.mi.Float(low))

    @dr.syntax
    def leaf_normal(self, direction, rng, active):
        """Draw a leaf normal by its area projected on the ray: from the distribution, accepted
        with the chance |cos| of its angle to the ray."""
        mi = self.mi
        normal = mi.Normal3f(0, 0, 1)
        draws = mi.UInt32(0)
        searching = mi.Bool(active)
        while searching:
            z = self._lookup(self.inclination_cos, rng.next_float32())
            sine, cosine = dr.sincos(2 * dr.pi * rng.next_float32())
            r = dr.safe_sqrt(1 - z * z)
            normal[searching] = mi.Normal3f(r * cosine, r * sine, z)
            draws += 1
            accepted = rng.next_float32() < dr.abs(dr.dot(normal, direction))
            searching &= ~accepted & (draws < MAX_DRAWS)
        return normal

    @dr.syntax
    def free_path(self, origin, direction, end_m, optical_depth, active):
        """Distance at which an optical depth is used up, infinite if that is beyond `end_m`."""
        mi = self.mi
        corner, shape = mi.Vector3f(self.corner_m), mi.Vector3f(self.shape)
        # A zero component would make 0 * inf; a tiny one never reaches its plane.
        d = dr.select(dr.abs(direction) < 1e-12, 1e-12, direction)
        low = (corner - origin) / d
        high = (corner + shape * self.size_m - origin) / d
        t = dr.maximum(dr.max(dr.minimum(low, high)), 0)
        last = dr.minimum(dr.min(dr.maximum(low, high)), end_m)
        voxel = dr.clip(dr.floor((origin + d * t - corner) / self.size_m), 0, shape - 1)
        forward = mi.Vector3f(dr.select(d > 0, 1, 0))
        step = 2 * forward - 1
        extinction = self._lookup(self.projection, dr.abs(direction.z))
        found = mi.Float(dr.inf)
        rest = mi.Float(optical_depth)
        marching = active & (t < last)
        while marching:
            planes = (corner + (voxel + forward) * self.size_m - origin) / d
            leave = dr.min(planes)
            flat = mi.UInt32((voxel.x * self.shape[1] + voxel.y) * self.shape[2] + voxel.z)
            sigma = extinction * dr.gather(mi.Float, self.density, flat, marching)
            here = dr.maximum(dr.minimum(leave, last) - t, 0)
            used_up = marching & (sigma * here >= rest) & (sigma > 0)
            found[used_up] = t + rest / sigma
            rest -= sigma * here
            t = dr.maximum(leave, t)
            across = mi.Vector3f(dr.select(planes == leave, 1, 0))
            voxel += step * across
            inside = dr.all((voxel >= 0) & (voxel < shape))
            marching &= ~used_up & inside & (t < last)
        return found
