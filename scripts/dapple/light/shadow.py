"""What a point sees of the sun's disc and of the sky, by explicit shadow rays.

Meshes block; turbid voxels transmit exp(-G * integral of plant area density), marched exactly
from voxel to voxel. Made for many points and times, as in fitting a tree to records of its shade.
"""

from types import ModuleType

import drjit as dr
import numpy as np

from dapple import engine
from dapple.light import patterns
from dapple.light.mitsuba_plugins import register
from dapple.light.mitsuba_scene import SPHERICAL_G, mesh_shapes
from dapple.light.scene import Scene, turbid_grid

RAYS_PER_KERNEL = 4_000_000
"""Bounds memory: a ray takes about 100 bytes."""

BLACK = {"type": "rgb", "value": [0.0, 0.0, 0.0]}


class Tracer:
    """Shadow rays through one scene, whose acceleration structure is built once.

    Parameters
    ----------
    scene : Scene
        Meshes and turbid voxels; the ground does not matter.
    variant : str
        Of Mitsuba.
    """

    def __init__(self, scene: Scene, variant: str = "llvm_ad_rgb"):
        self.variant = variant
        self.mi = mi = engine.load(variant)
        register()
        names = ("leaf_reflectance", "leaf_transmittance", "bark_reflectance")
        shapes = mesh_shapes(mi, scene.meshes, dict.fromkeys(names, BLACK))
        self.scene = mi.load_dict({"type": "scene", **shapes}) if shapes else None
        grid = turbid_grid(scene.voxels)
        self.grid = None
        if grid is not None:
            density = grid.plant_area_density_m2_m3
            self.shape = density.shape
            self.low = mi.Point3f(*(dr.opaque(mi.Float, float(v)) for v in grid.low_m))
            self.size = dr.opaque(mi.Float, grid.voxel_size_m)
            self.grid = mi.Float((SPHERICAL_G * density).astype(np.float32).ravel())

    def sun_visibility(
        self,
        points_m: np.ndarray,
        sun_directions: np.ndarray,
        *,
        n_disc: int,
        seed: int,
        angular_diameter_deg: float = 0.53,
        aperture_m: float = 0.0,
    ) -> np.ndarray:
        """Share of the sun's disc that each point sees in each direction of the sun.

        Parameters
        ----------
        points_m : (n, 3) array
            Local frame [m].
        sun_directions : (m, 3) array
            Unit vectors towards the middle of the sun; below the horizon nothing is seen.
        n_disc : int
            Rays per point and direction, evenly spread over the disc.
        seed : int
            Turns the pattern differently for each point and direction.
        angular_diameter_deg : float
            Of the sun [deg].
        aperture_m : float
            Diameter of the level entrance around each point [m]; 0 is a point.

        Returns
        -------
        (n, m) float32
            0 (shade) to 1 (full sun); with turbid voxels the mean transmittance.
        """
        mi = engine.load(self.variant)
        points = _vectors(mi.Point3f, points_m)
        pattern = mi.Float(patterns.kronecker(n_disc, 4).astype(np.float32).ravel())
        across, along, axis = (
            _vectors(mi.Vector3f, part) for part in _frames(np.asarray(sun_directions, float))
        )
        radius = dr.opaque(mi.Float, float(np.sin(np.radians(0.5 * angular_diameter_deg))))
        entrance = dr.opaque(mi.Float, 0.5 * aperture_m)
        n_points, n_suns = len(points_m), len(sun_directions)
        suns = dr.opaque(mi.UInt32, n_suns)
        visible = np.empty(n_points * n_suns, dtype=np.float32)
        for low, high in _blocks(n_points * n_suns, n_disc):
            ray, pair = _rays_of_block(mi, low, high - low, n_disc)
            u = _shifted(mi, pattern, ray, pair, seed)
            point, sun = pair // suns, pair % suns
            x, y = _disc(u[0], u[1])
            way = dr.gather(mi.Vector3f, across, sun) * x + dr.gather(mi.Vector3f, along, sun) * y
            way = dr.normalize(dr.gather(mi.Vector3f, axis, sun) + radius * way)
            x, y = _disc(u[2], u[3])
            start = dr.gather(mi.Point3f, points, point) + entrance * mi.Vector3f(x, y, 0.0)
            seen = self.transmittance(start, way, way.z > 0.0)
            visible[low:high] = np.array(dr.block_sum(seen, n_disc)) / n_disc
        return visible.reshape(n_points, n_suns)

    def sky_visibility(self, points_m: np.ndarray, *, n: int, seed: int) -> np.ndarray:
        """Cosine-weighted share of the sky that each point sees: diffuse light below over above.

        Parameters
        ----------
        points_m : (p, 3) array
            Local frame [m].
        n : int
            Rays per point, with a cosine law about the zenith.
        seed : int

        Returns
        -------
        (p,) float32
            1 in the open.
        """
        mi = engine.load(self.variant)
        points = _vectors(mi.Point3f, points_m)
        pattern = mi.Float(patterns.kronecker(n, 4).astype(np.float32).ravel())
        visible = np.empty(len(points_m), dtype=np.float32)
        for low, high in _blocks(len(points_m), n):
            ray, point = _rays_of_block(mi, low, high - low, n)
            u = _shifted(mi, pattern, ray, point, seed)
            x, y = _disc(u[0], u[1])
            way = mi.Vector3f(x, y, dr.sqrt(dr.maximum(1.0 - x * x - y * y, 0.0)))
            start = dr.gather(mi.Point3f, points, point)
            seen = self.transmittance(start, way, way.z > 0.0)
            visible[low:high] = np.array(dr.block_sum(seen, n)) / n
        return visible

    def transmittance(self, start, way, active):
        """Share of light that a ray lets through; 0 where it is not active."""
        mi = self.mi
        if self.scene is not None:
            active &= ~self.scene.ray_test(mi.Ray3f(start, way), active)
        if self.grid is None:
            return dr.select(active, mi.Float(1.0), 0.0)
        depth = _march(mi, self.grid, self.shape, (start - self.low) / self.size, way, active)
        return dr.select(active, dr.exp(-depth * self.size), 0.0)


def _march(mi: ModuleType, grid, shape: tuple[int, int, int], start, way, active):
    """Integral of the grid along rays in units of voxels (Amanatides and Woo 1987)."""
    bound = mi.Point3f(*map(float, shape))
    last = mi.Point3i(*(n - 1 for n in shape))
    # an axis that a ray does not move along never limits it
    safe = dr.select(dr.abs(way) > 1e-9, way, dr.copysign(mi.Vector3f(1e-9), way))
    inverse = dr.rcp(safe)
    to_low, to_high = -start * inverse, (bound - start) * inverse
    enter = dr.maximum(dr.max(dr.minimum(to_low, to_high)), 0.0)
    leave = dr.min(dr.maximum(to_low, to_high))
    cell = dr.clip(mi.Point3i(dr.floor(start + enter * safe)), mi.Point3i(0), last)
    forward = mi.Vector3i(dr.select(safe > 0.0, mi.Vector3i(1), mi.Vector3i(-1)))
    ahead = mi.Vector3f(cell) + dr.select(safe > 0.0, mi.Vector3f(1.0), mi.Vector3f(0.0))
    following = (ahead - start) * inverse
    stride = dr.abs(inverse)
    depth, t = mi.Float(0.0), mi.Float(enter)

    def more(t, depth, cell, following, active):
        return active

    def step(t, depth, cell, following, active):
        until = dr.minimum(dr.min(following), leave)
        index = (cell.x * shape[1] + cell.y) * shape[2] + cell.z
        depth += dr.gather(mi.Float, grid, mi.UInt32(index), active) * dr.maximum(until - t, 0.0)
        along_x = (following.x <= following.y) & (following.x <= following.z)
        along_y = ~along_x & (following.y <= following.z)
        moved = dr.mask_t(mi.Vector3f)(along_x, along_y, ~along_x & ~along_y)
        cell = mi.Point3i(cell + dr.select(moved, forward, 0))
        following = following + dr.select(moved, stride, 0.0)
        active &= until < leave
        active &= dr.all((cell >= 0) & (cell <= last))
        return dr.maximum(until, t), depth, cell, following, active

    state = (t, depth, cell, following, active & (enter < leave))
    return dr.while_loop(state, more, step)[1]


def sun_visibility(
    scene: Scene,
    points_m: np.ndarray,
    sun_directions: np.ndarray,
    *,
    n_disc: int,
    seed: int,
    angular_diameter_deg: float = 0.53,
    aperture_m: float = 0.0,
    variant: str = "llvm_ad_rgb",
) -> np.ndarray:
    """`Tracer.sun_visibility` for one call."""
    return Tracer(scene, variant).sun_visibility(
        points_m,
        sun_directions,
        n_disc=n_disc,
        seed=seed,
        angular_diameter_deg=angular_diameter_deg,
        aperture_m=aperture_m,
    )


def sky_visibility(
    scene: Scene, points_m: np.ndarray, *, n: int, seed: int, variant: str = "llvm_ad_rgb"
) -> np.ndarray:
    """`Tracer.sky_visibility` for one call."""
    return Tracer(scene, variant).sky_visibility(points_m, n=n, seed=seed)


def _vectors(kind, values: np.ndarray):
    """(n, 3) numbers as Dr.Jit points or vectors."""
    return kind(np.ascontiguousarray(np.asarray(values).T, dtype=np.float32))


def _blocks(n_items: int, rays_per_item: int):
    """Ranges of items whose rays fit one kernel."""
    step = max(1, RAYS_PER_KERNEL // rays_per_item)
    for low in range(0, n_items, step):
        yield low, min(low + step, n_items)


def _rays_of_block(mi: ModuleType, low: int, n_items: int, per_item: int):
    """Index of each ray within its item's pattern, and the number of the item."""
    index = dr.arange(mi.UInt32, n_items * per_item)
    return index % per_item, index // per_item + dr.opaque(mi.UInt32, low)


def _shifted(mi: ModuleType, pattern, ray, item, seed: int) -> list:
    """Pattern points with a shift that belongs to the item, whatever the block it falls in."""
    first, second = mi.sample_tea_32(item, dr.opaque(mi.UInt32, seed))
    third, fourth = mi.sample_tea_32(first, second)
    shifts = [mi.Float(word) * 2.0**-32 for word in (first, second, third, fourth)]
    points = [dr.gather(mi.Float, pattern, ray * 4 + k) + shifts[k] for k in range(4)]
    return [point - dr.floor(point) for point in points]


def _disc(u, v):
    """Even points of the disc of radius 1."""
    sine, cosine = dr.sincos(dr.two_pi * v)
    radius = dr.sqrt(u)
    return radius * cosine, radius * sine


def _frames(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Two directions across each unit vector (m, 3), at right angles, and the vector itself."""
    helper = np.where(np.abs(axis[:, :1]) < 0.7, [[1.0, 0.0, 0.0]], [[0.0, 1.0, 0.0]])
    across = np.cross(axis, helper)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    return across, np.cross(axis, across), axis
