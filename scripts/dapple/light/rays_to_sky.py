"""What a point sees of the sun's disc and of the sky, by explicit shadow rays.

Meshes block; turbid voxels transmit exp(-G * integral of plant area density), marched exactly
from voxel to voxel. Made for many points and times, as in fitting a tree to records of its shade.
"""

from collections.abc import Callable, Iterator
from typing import Any

import drjit as dr
import numpy as np

from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, NAMED, Response
from dapple.progress import Progress
from dapple.scene import patterns, traced
from dapple.scene.surfaces import Scene
from dapple.scene.traced import TracedScene
from dapple.sky.patches import Patches, patches

RAYS_PER_KERNEL = 1 << 22
"""Bounds memory: a ray takes about 100 bytes."""
EVEN = NAMED["hemispherical"]
"""Rays that are spread evenly over the solid angle."""

SunRays = Callable[[np.ndarray, int, int, int], tuple[np.ndarray, np.ndarray]]
SkyRays = Callable[[np.ndarray, int, int, int], np.ndarray]


def sun_rays(
    scene: TracedScene,
    points_m: np.ndarray,
    sun_directions: np.ndarray,
    *,
    sun_diameter_deg: float,
    seed: int,
    aperture_m: float = 0.0,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
    progress: Progress | None = None,
) -> SunRays:
    """Prepare rays from sensors' entrances to the sun's disc.

    Parameters
    ----------
    scene : TracedScene
        The ground does not matter.
    points_m : (n, 3) float64
        Local frame [m].
    sun_directions : (t, 3) float64
        Unit vectors towards the middle of the sun.
    sun_diameter_deg : float
        Angular diameter of the disc [deg].
    seed : int
        Shifts the pattern differently for each pair of point and sun and each replicate.
    aperture_m : float
        Diameter of the entrance around each point; 0 is a point [m].
    facing : (n, 3) float64 or None
        Unit normals of the entrances; None: level ones.
    keys : (n,) uint32 or None
        As in `visibility.sunlit`.
    progress : Progress or None
        Is told of the rays.

    Returns
    -------
    callable
        Of pairs (m,) (point * t + sun), a number of replicates r, the first ray's number and the
        number of rays in a replicate. It returns the sums (m, r) of what the rays see, 0 to 1
        each, nothing below the horizon, and the sums of squares (m,).
    """
    mi = scene.mi
    points, axes = (_columns(mi, vectors) for vectors in (points_m, sun_directions))
    normals = None if facing is None else _columns(mi, facing)
    radius = dr.opaque(mi.Float, float(np.sin(np.radians(0.5 * sun_diameter_deg))))
    half_aperture = dr.opaque(mi.Float, 0.5 * aperture_m)
    n_suns, key = dr.opaque(mi.UInt32, len(sun_directions)), dr.opaque(mi.UInt32, seed)
    names = _names(mi, keys, len(points_m))
    dimensions = 4 if aperture_m else 2

    def block(pairs, pattern, n_replicates: int, n_rays: int):
        ray, item = _rays_of_block(mi, len(pairs), n_replicates * n_rays)
        pair = dr.gather(mi.UInt32, mi.UInt32(pairs.astype(np.uint32)), item)
        point, sun = pair // n_suns, pair % n_suns
        per_set, sets = dr.opaque(mi.UInt32, n_rays), dr.opaque(mi.UInt32, n_replicates)
        named = dr.gather(mi.UInt32, names, point) * n_suns + sun
        u = _shifted(mi, pattern, ray % per_set, named * sets + ray // per_set, key)
        axis = mi.Vector3f(*(dr.gather(mi.Float, a, sun) for a in axes))
        start = mi.Point3f(*(dr.gather(mi.Float, a, point) for a in points))
        x, y = _disc(u[0], u[1])
        way = dr.normalize(mi.Frame3f(axis).to_world(mi.Vector3f(radius * x, radius * y, 1.0)))
        if aperture_m:
            x, y = _disc(u[2], u[3])
            start += half_aperture * _turned(mi, mi.Vector3f(x, y, 0.0), normals, point)
        seen = scene.transmittance(start, way, (way.z > 0) & (axis.z > 0))
        sums, squares = (dr.block_sum(x, n_rays) for x in (seen, seen * seen))
        dr.eval(sums, squares)
        return (np.array(x, np.float64).reshape(-1, n_replicates) for x in (sums, squares))

    def trace(pairs: np.ndarray, n_replicates: int, first: int, n_rays: int):
        pattern = _columns(mi, patterns.kronecker(first + n_rays, dimensions)[first:])
        sums, squares = np.empty((len(pairs), n_replicates)), np.empty(len(pairs))
        for part in _blocks(len(pairs), n_replicates * n_rays):
            sums[part], square = block(pairs[part], pattern, n_replicates, n_rays)
            squares[part] = square.sum(axis=1)
            if progress is not None:
                progress.add((part.stop - part.start) * n_replicates * n_rays)
        return sums, squares

    return trace


def sky_rays(
    scene: TracedScene,
    points_m: np.ndarray,
    sky: Patches,
    *,
    seed: int,
    response: Response = COSINE,
    facing: np.ndarray | None = None,
    keys: np.ndarray | None = None,
) -> SkyRays:
    """Prepare rays from points to the patches of the sky.

    Parameters
    ----------
    scene : TracedScene
        The ground does not matter.
    points_m : (n, 3) float64
        Local frame [m].
    sky : Patches
        Subdivision of the sky into p patches.
    seed : int
        Shifts the pattern differently for each point, replicate and patch.
    response : Response
        Of the sensors at the points.
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level.
    keys : (n,) uint32 or None
        As in `visibility.sunlit`.

    Returns
    -------
    callable
        Of points (m,), a number of replicates r, the first ray's number and the number of rays in
        a patch and replicate. It returns the sums (m, r, p) of what the rays bring of what a level
        sensor in the open reads of a patch, 0 to 1 each, or more where a sensor is tilted.

    Notes
    -----
    For level sensors rays are spread over a patch as light counts, so that each counts the same.
    What a tilted sensor reads of light differs within a patch and from sensor to sensor: rays are
    spread evenly over the solid angle, and weighted.
    """
    mi = scene.mi
    points = _columns(mi, points_m)
    normals = None if facing is None else _columns(mi, facing)
    drawn = response if facing is None else EVEN
    width = 2 * np.pi / np.repeat(sky.row_count, sky.row_count)
    start = (np.arange(sky.n) - np.repeat(sky.row_start, sky.row_count) - 0.5) * width
    below = sensor_response.share_below(drawn, sky.row_sine)
    low, high = (np.repeat(bound, sky.row_count) for bound in (below[:-1], below[1:]))
    # Within a patch the share that comes from below and the azimuth are even.
    table = _columns(mi, np.stack([low, high - low, start, width], axis=1))
    weight = mi.Float(sky.solid_angle_sr / sky.seen_solid_angle_sr(response))
    n_patches, key = dr.opaque(mi.UInt32, sky.n), dr.opaque(mi.UInt32, seed)
    names = _names(mi, keys, len(points_m))

    def block(items, per_point: int, pattern, n_rays: int):
        ray, number = _rays_of_block(mi, len(items), n_rays)
        item = dr.gather(mi.UInt32, mi.UInt32(items.astype(np.uint32)), number)
        of_point = dr.opaque(mi.UInt32, per_point)
        point = item // of_point
        named = dr.gather(mi.UInt32, names, point) * of_point + item % of_point
        u = _shifted(mi, pattern, ray, named, key)
        low, height, start, width = (
            dr.gather(mi.Float, column, item % n_patches) for column in table
        )
        level, up = sensor_response.height(drawn, dr.fma(u[0], height, low), dr)
        east, north = dr.sincos(dr.fma(u[1], width, start))
        way = mi.Vector3f(level * east, level * north, up)
        origin = mi.Point3f(*(dr.gather(mi.Float, a, point) for a in points))
        seen = scene.transmittance(origin, way, way.z > 0)
        if normals is not None:
            cosine = dr.dot(way, _gathered(mi, normals, point))
            counts = sensor_response.value(response, cosine, dr)
            seen *= counts * dr.gather(mi.Float, weight, item % n_patches)
        return np.array(dr.block_sum(seen, n_rays))

    def trace(chosen: np.ndarray, n_replicates: int, first: int, n_rays: int):
        pattern = _columns(mi, patterns.kronecker(first + n_rays, 2)[first:])
        per_point = n_replicates * sky.n
        items = (chosen[:, None] * per_point + np.arange(per_point)).ravel()
        sums = np.empty(len(items), np.float32)
        for part in _blocks(len(items), n_rays):
            sums[part] = block(items[part], per_point, pattern, n_rays)
        return sums.reshape(len(chosen), n_replicates, sky.n)

    return trace


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
        self.scene = traced.load(scene, variant)

    def sun_visibility(
        self, points_m: np.ndarray, sun_directions: np.ndarray, *, n_disc: int, **options: Any
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
        **options
            Of `sun_rays`.

        Returns
        -------
        (n, m) float32
            0 (shade) to 1 (full sun); with turbid voxels the mean transmittance.
        """
        shape = len(points_m), len(sun_directions)
        trace = sun_rays(self.scene, points_m, sun_directions, **options)
        seen = trace(np.arange(shape[0] * shape[1]), 1, 0, n_disc)[0] / n_disc
        return seen.reshape(shape).astype(np.float32)

    def sky_visibility(
        self,
        points_m: np.ndarray,
        *,
        n: int,
        seed: int,
        response: Response = COSINE,
        facing: np.ndarray | None = None,
    ) -> np.ndarray:
        """What is left of an even sky's reading at each point: diffuse light below over above.

        Parameters
        ----------
        points_m : (p, 3) array
            Local frame [m].
        n : int
            Rays per point.
        seed : int
        response : Response
            Of sensors at the points.
        facing : (p, 3) array or None
            Their unit normals; None: they are level.

        Returns
        -------
        (p,) float32
            1 in the open for a level sensor.
        """
        dome = patches(1)
        trace = sky_rays(self.scene, points_m, dome, seed=seed, response=response, facing=facing)
        return trace(np.arange(len(points_m)), 1, 0, n)[:, 0, 0] / np.float32(n)


def _names(mi, keys: np.ndarray | None, n: int):
    """Which random numbers each of n points draws."""
    return dr.arange(mi.UInt32, n) if keys is None else mi.UInt32(keys.astype(np.uint32))


def _columns(mi, values: np.ndarray) -> list:
    """The columns of (n, k) numbers as Dr.Jit arrays."""
    return [mi.Float(np.ascontiguousarray(v, np.float32)) for v in np.asarray(values, float).T]


def _blocks(n_items: int, rays_per_item: int) -> Iterator[slice]:
    """Ranges of items whose rays fit one kernel."""
    step = max(1, RAYS_PER_KERNEL // rays_per_item)
    for low in range(0, n_items, step):
        yield slice(low, min(low + step, n_items))


def _rays_of_block(mi, n_items: int, per_item: int):
    """Number of each ray within its item, and the number of the item in the block."""
    index = dr.arange(mi.UInt32, n_items * per_item)
    rays = dr.opaque(mi.UInt32, per_item)
    return index % rays, index // rays


def _shifted(mi, pattern: list, ray, item, key) -> list:
    """Pattern points with a shift that belongs to the item, whatever the block it falls in."""
    words = mi.sample_tea_32(item, key)
    if len(pattern) > 2:
        words = (*words, *mi.sample_tea_32(*words))
    points = [
        dr.gather(mi.Float, column, ray) + mi.Float(word) * 2.0**-32
        for column, word in zip(pattern, words, strict=True)
    ]
    return [point - dr.floor(point) for point in points]


def _gathered(mi, columns: list, index):
    """Vectors by their numbers."""
    return mi.Vector3f(*(dr.gather(mi.Float, column, index) for column in columns))


def _turned(mi, vector, normals: list | None, index):
    """Vectors in the frame of a sensor, whose normal is z there, as they lie in the scene."""
    if normals is None:
        return vector
    return mi.Frame3f(_gathered(mi, normals, index)).to_world(vector)


def _disc(u, v):
    """Even points of the disc of radius 1."""
    sine, cosine = dr.sincos(dr.two_pi * v)
    radius = dr.sqrt(u)
    return radius * cosine, radius * sine
