"""Backward light paths through meshes and turbid voxels: one Dr.Jit kernel for every scene.

A path starts at a sensor and ends when it leaves the scene. On its way it only counts what it met:
leaf reflections a, leaf transmissions b, bark reflections c, ground reflections d. Each leaf event
reflects or transmits with equal chance, so that a path stands for 2^(a + b) times its own share of
light, times rho^a tau^b rho_bark^c rho_ground^d in any band: spectra come later.
"""

from dataclasses import dataclass

import drjit as dr
import numpy as np

from dapple.light.traced import TracedScene

PLASTIC_STEPS = (3242174889, 2447445414)
"""2³² over the plastic number and over its square: steps of the R2 sequence (Roberts 2018)."""


@dataclass(frozen=True)
class Paths:
    """Paths that left the scene.

    Attributes
    ----------
    start : (m,) int32
        Index of the point where each path started.
    direction : (m, 3) float32
        Unit vector in which it left: its light came from there.
    orders : (m, 4) uint8
        Leaf reflections, leaf transmissions, bark and ground reflections on its way.
    n_cut : int
        Paths given up because they met more than `max_orders` surfaces.
    """

    start: np.ndarray
    direction: np.ndarray
    orders: np.ndarray
    n_cut: int


def trace(
    scene: TracedScene,
    points_m: np.ndarray,
    n_paths: int,
    *,
    max_orders: int,
    seed: int,
    aperture_m: float = 0.0,
) -> Paths:
    """Trace paths backward from horizontal cosine sensors that look up.

    Parameters
    ----------
    scene : TracedScene
        What the paths can meet.
    points_m : (n, 3) float64
        Sensors in the local frame [m].
    n_paths : int
        Paths from each point; their first directions follow a shifted R2 sequence.
    max_orders : int
        A path that meets more surfaces is given up (and counted).
    seed : int
        Of the random numbers; the result does not depend on the number of threads.
    aperture_m : float
        Diameter of the sensors' receiving discs [m].

    Returns
    -------
    Paths
        In order of sensor and path.
    """
    mi = scene.mi
    n = len(points_m)
    index = dr.arange(mi.UInt32, n * n_paths)
    start = index // n_paths
    rng = mi.PCG32(initstate=mi.UInt64(seed), initseq=mi.UInt64(index))
    first = mi.warp.square_to_cosine_hemisphere(_stratified(mi, start, index % n_paths, seed))
    on_disc = mi.warp.square_to_uniform_disk(mi.Point2f(rng.next_float32(), rng.next_float32()))
    centre = [dr.gather(mi.Float, mi.Float(points_m[:, k]), start) for k in range(3)]
    radius = 0.5 * aperture_m
    origin = mi.Point3f(centre[0] + radius * on_disc.x, centre[1] + radius * on_disc.y, centre[2])
    direction, escaped, *orders = _follow(
        mi, scene, origin, mi.Vector3f(first), rng, mi.Bool(True), mi.UInt32(max_orders)
    )
    kept = dr.compress(escaped)
    direction = dr.gather(mi.Vector3f, direction, kept)
    start = dr.gather(mi.UInt32, start, kept)
    orders = [dr.gather(mi.UInt32, order, kept) for order in orders]
    return Paths(
        start=np.array(start).astype(np.int32),
        direction=np.array(direction).T.astype(np.float32),
        orders=np.stack([np.array(order) for order in orders], axis=1).astype(np.uint8),
        n_cut=n * n_paths - len(kept),
    )


def _stratified(mi, start, path, seed):
    """Points of the R2 sequence, shifted at random for each sensor."""
    shift = mi.PCG32(initstate=mi.UInt64(seed) + 1, initseq=mi.UInt64(start))
    scale = 2.0**-32
    u, v = (
        mi.Float(shift.next_uint32() + path * mi.UInt32(step)) * scale for step in PLASTIC_STEPS
    )
    # The conversion to float32 may round up to 1, which is outside the square.
    return mi.Point2f(dr.minimum(u, dr.one_minus_epsilon(mi.Float)), v)


@dr.syntax
def _follow(mi, scene, origin, direction, rng, active, max_orders):
    """Follow paths until they leave the scene; return last directions and what they met."""
    a, b, c, d = mi.UInt32(0), mi.UInt32(0), mi.UInt32(0), mi.UInt32(0)
    met = mi.UInt32(0)
    escaped = mi.Bool(False)
    while active:
        ray = mi.Ray3f(origin, direction)
        found = scene.meshes.ray_intersect_preliminary(ray, coherent=False, active=active)
        to_ground = dr.select(
            direction.z < 0, (scene.ground_z_m - origin.z) / direction.z, mi.Float(dr.inf)
        )
        on_ground = to_ground < found.t
        distance = dr.minimum(found.t, to_ground)
        in_voxel = mi.Bool(False)
        if dr.hint(scene.grid is not None, mode="scalar"):
            optical_depth = -dr.log(1 - rng.next_float32())
            free = scene.grid.free_path(origin, direction, distance, optical_depth, active)
            in_voxel = free < distance
            distance = dr.minimum(free, distance)
        on_ground &= ~in_voxel
        leaves_scene = active & (distance == dr.inf)
        escaped |= leaves_scene
        active &= ~leaves_scene

        on_mesh = active & ~on_ground & ~in_voxel
        surface = found.compute_surface_interaction(ray, mi.RayFlags.Minimal, on_mesh)
        normal = mi.Normal3f(0, 0, 1)
        normal[on_mesh] = surface.n
        if dr.hint(scene.grid is not None, mode="scalar"):
            drawn = scene.grid.leaf_normal(direction, rng, active & in_voxel)
            normal[in_voxel] = drawn
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)

        u, v, choice = rng.next_float32(), rng.next_float32(), rng.next_float32()
        leaf = in_voxel | (on_mesh & (surface.shape == scene.leaf))
        transmitted = leaf & (choice < 0.5)
        reflected = leaf & ~transmitted
        side = dr.select(transmitted, -normal, normal)
        scattered = mi.Frame3f(side).to_world(mi.warp.square_to_cosine_hemisphere(mi.Point2f(u, v)))
        # Surfaces push the next ray off themselves; a point in a turbid voxel has no surface.
        push = dr.select(in_voxel, 0.0, scene.ray_offset_m)
        origin[active] = origin + direction * distance + side * push
        direction[active] = scattered
        a += dr.select(active & reflected, 1, 0)
        b += dr.select(active & transmitted, 1, 0)
        c += dr.select(on_mesh & ~leaf, 1, 0)
        d += dr.select(active & on_ground, 1, 0)
        met += 1
        active &= met <= max_orders
    return direction, escaped, a, b, c, d
