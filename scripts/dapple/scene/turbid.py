"""Turbid voxels for Dr.Jit: rays are marched exactly from voxel to voxel.

The march is that of Amanatides and Woo (1987), A Fast Voxel Traversal Algorithm for Ray Tracing.
"""

from types import ModuleType

import drjit as dr
import numpy as np
import xarray as xr

from dapple.scene.surfaces import turbid_grid
from dapple.structure import leaf_angles

N_ANGLES = 1024
"""Entries of the tables of leaf angles."""
MAX_DRAWS = 64
"""Leaf normals that are drawn before the last is taken; one in two is accepted on average."""


def load(mi: ModuleType, voxels: xr.Dataset | None) -> "TurbidVoxels | None":
    """Hand a voxel dataset to Dr.Jit, cropped to what is filled; unknown voxels count as empty.

    Parameters
    ----------
    mi : module
        Mitsuba, its variant set.
    voxels : xarray.Dataset or None
        `plant_area_density_m2_m3` (x, y, z), attributes `voxel_size_m` and
        `leaf_angle_distribution` (spherical where it is missing).

    Returns
    -------
    TurbidVoxels or None
        None where there is no voxel with leaves.

    Raises
    ------
    InputError
        A negative density, or leaf angles that are not known.
    """
    grid = turbid_grid(voxels)
    if grid is None:
        return None
    return TurbidVoxels(
        mi,
        grid.plant_area_density_m2_m3,
        grid.low_m,
        grid.voxel_size_m,
        grid.leaf_angle_distribution,
    )


class TurbidVoxels:
    """A box of voxels filled with infinitely small leaves.

    Attributes
    ----------
    low_m, high_m : (3,) float64
        Corners of the box [m].
    shape : tuple of int
        Number of voxels in x, y, z.
    density : (nx * ny * nz,) Dr.Jit Float
        Plant area density times the edge of a voxel, z fastest.
    projection : (N_ANGLES,) Dr.Jit Float
        G at equally spaced |cos| of the ray's zenith angle.
    inclination_cos : (N_ANGLES,) Dr.Jit Float
        Quantiles of the cosine of the leaves' inclination.
    """

    def __init__(
        self,
        mi: ModuleType,
        density_m2_m3: np.ndarray,
        low_m: np.ndarray,
        size_m: float,
        distribution: str,
    ):
        projection = leaf_angles.projection(distribution, np.arccos(np.linspace(0, 1, N_ANGLES)))
        quantiles = leaf_angles.normal_cosine_quantiles(distribution, N_ANGLES)
        self.mi = mi
        self.low_m, self.high_m = low_m, low_m + size_m * np.array(density_m2_m3.shape)
        # Opaque numbers stay out of the kernel's code: one kernel serves all grids.
        self.size = dr.opaque(mi.Float, size_m)
        self.corner = mi.Vector3f(*(dr.opaque(mi.Float, float(low)) for low in low_m))
        self.shape = mi.Vector3f(*(dr.opaque(mi.Float, float(n)) for n in density_m2_m3.shape))
        self.density = mi.Float((density_m2_m3 * size_m).astype(np.float32).ravel())
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

    def transmittance(self, origin, direction, end_m, active):
        """Share of light that passes from the origin to `end_m` along the ray."""
        infinite = self.mi.Float(dr.inf)
        return dr.exp(-self.march(origin, direction, end_m, infinite, active)[1])

    @dr.syntax
    def march(self, origin, direction, end_m, limit, active):
        """Go along rays until an optical depth or `end_m` is reached.

        Returns
        -------
        found : Float
            Distance at which the optical depth is `limit`, infinite if that is beyond `end_m`.
        depth : Float
            Optical depth on the way.
        """
        mi = self.mi
        # A zero component would make 0 * inf; a tiny one never reaches its plane.
        d = dr.select(dr.abs(direction) < 1e-12, 1e-12, direction)
        inverse = dr.rcp(d)
        low = (self.corner - origin) * inverse
        stride = self.size * inverse
        high = dr.fma(self.shape, stride, low)
        t = dr.maximum(dr.max(dr.minimum(low, high)), 0)
        last = dr.minimum(dr.min(dr.maximum(low, high)), end_m)
        inside = (dr.fma(d, t, origin) - self.corner) / self.size
        voxel = dr.clip(dr.floor(inside), 0, self.shape - 1)
        forward = dr.select(d > 0, mi.Vector3f(1), mi.Vector3f(0))
        move = 2 * forward - 1
        ahead = dr.fma(forward, stride, low)
        per_size = self._lookup(self.projection, dr.abs(direction.z)) / self.size
        found, depth = mi.Float(dr.inf), mi.Float(0)
        marching = active & (t < last)
        while marching:
            planes = dr.fma(voxel, stride, ahead)
            leave = dr.min(planes)
            flat = dr.fma(dr.fma(voxel.x, self.shape.y, voxel.y), self.shape.z, voxel.z)
            sigma = per_size * dr.gather(mi.Float, self.density, mi.UInt32(flat), marching)
            here = sigma * dr.maximum(dr.minimum(leave, last) - t, 0)
            used_up = marching & (depth + here >= limit) & (sigma > 0)
            found[used_up] = t + (limit - depth) / sigma
            depth += here
            t = dr.maximum(leave, t)
            voxel += dr.select(planes == leave, move, 0)
            within = dr.all((voxel >= 0) & (voxel < self.shape))
            marching &= ~used_up & within & (t < last)
        return found, depth
