"""Images of a virtual plot from above, by Mitsuba's own path tracer: every material its own colour.

The simulated images that chlorophyll is retrieved with are made otherwise, but for Mitsuba's rays:
leaves are strips of needles and not facets, every tree has its own optics, the ground is patchy,
paths have no largest order, and light is traced band by band in Mitsuba's integrator.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.frames import direction_from_angles
from dapple.progress import followed
from dapple.scene import patterns
from dapple.scene.mitsuba_plugins import register
from dapple.scene.mitsuba_scene import dark_sun, sky_emitter, triangles
from dapple.scene.render_scene import RenderScene
from dapple.streams import stream_seed
from dapple.virtual.plot_optics import Materials

CHUNK_RAYS = 1 << 20
"""Rays traced together: always this many, so that one kernel serves and memory stays small."""

ROULETTE_DEPTH = 3
"""Weak paths are ended by chance from here on; without a largest order nothing is cut off."""

SUN_WEIGHT = 8.0
"""So often is the sun asked for light where the sky is asked once: that has the least noise."""


@dataclass(frozen=True)
class View:
    """Looking straight down, without perspective, on whole pixels of a north-up grid.

    Attributes
    ----------
    left_m, top_m : float
        North-west corner, local frame [m].
    rows, columns : int
    pixel_m : float
        Edge of a pixel [m].
    """

    left_m: float
    top_m: float
    rows: int
    columns: int
    pixel_m: float

    @classmethod
    def over(cls, size_m: tuple[float, float], pixel_m: float) -> "View":
        """The whole pixels of a plot from 0, 0 to its size, from the north-west corner."""
        columns, rows = (int(edge / pixel_m + 1e-6) for edge in size_m)
        if rows < 1 or columns < 1:
            raise InputError(
                "chlorophyll.pixel_m",
                f"{pixel_m:g} m in a plot of {size_m[0]:g} x {size_m[1]:g} m",
                "pixels smaller than the plot",
                "Choose smaller pixels.",
            )
        return cls(0.0, float(size_m[1]), rows, columns, pixel_m)


@dataclass
class PaintedScene:
    """A Mitsuba scene of one mesh whose colours can be changed without rebuilding it."""

    render: RenderScene
    bsdf: Any
    materials: Materials
    top_m: float

    def paint(self, bands: list[int]) -> None:
        """Use up to three bands as Mitsuba's colours; missing ones repeat the last."""
        chosen = [bands[min(k, len(bands) - 1)] for k in range(3)]
        self.bsdf.paint(
            self.materials.reflectance[:, chosen], self.materials.transmittance[:, chosen]
        )


def build(mesh: Mesh, materials: Materials, *, variant: str = "llvm_ad_rgb") -> PaintedScene:
    """Put a world of any materials into a Mitsuba scene.

    Parameters
    ----------
    mesh : Mesh
        Everything: leaves, wood, ground.
    materials : Materials
        Opaque ones have no transmittance.

    Raises
    ------
    InputError
        Reflectance and transmittance below 0 or together above 1.
    """
    total = materials.reflectance + materials.transmittance
    lowest = min(materials.reflectance.min(), materials.transmittance.min())
    if lowest < 0 or total.max() > 1 + 1e-6:
        raise InputError(
            "materials",
            f"shares of light from {lowest:.3g} to {total.max():.3g}",
            "0 to 1, reflectance and transmittance together too",
            "Check the spectra.",
        )
    mi = engine.load(variant)
    register()
    bsdf = mi.load_dict({"type": "painted"})
    bsdf.assign(materials.of_face.astype(np.uint32))
    shape = (181, 360)
    content = {
        "type": "scene",
        "sun": dark_sun(mi) | {"sampling_weight": SUN_WEIGHT},
        "sky": sky_emitter(mi, shape) | {"sampling_weight": 1.0},
        "world": triangles(mi, "world", mesh, bsdf),
    }
    low, high = mesh.vertices_m[:, 2].min(), mesh.vertices_m[:, 2].max()
    render = RenderScene(mi, mi.load_dict(content), 3, float(low), variant, shape)
    return PaintedScene(render, bsdf, materials, float(high))


def photograph(
    scene: PaintedScene,
    view: View,
    *,
    sun_zenith_deg: float,
    sun_azimuth_deg: float,
    diffuse_share: np.ndarray,
    paths_per_pixel: Sequence[int],
    seed: int,
) -> np.ndarray:
    """Reflectance of every pixel in every band.

    Parameters
    ----------
    scene : PaintedScene
    view : View
    sun_zenith_deg, sun_azimuth_deg : float
        Azimuth clockwise from north [°].
    diffuse_share : (b,) float
        Of the light on level ground: what comes from a sky of even radiance, not from the sun.
    paths_per_pixel : sequence of int
        For every three bands that are traced together; spread evenly over the pixel.
    seed : int
        Same seed, same image.

    Returns
    -------
    (b, rows, columns) float32
        pi times radiance over irradiance of level ground; row 0 in the north.

    Notes
    -----
    Light reaches the world from the upper hemisphere alone, at its edges too: nothing repeats
    sideways. Three bands are traced together, then the rest.
    """
    diffuse = np.asarray(diffuse_share, np.float64)
    n_bands = scene.materials.reflectance.shape[1]
    if diffuse.shape != (n_bands,) or diffuse.min() < 0 or diffuse.max() > 1:
        raise InputError(
            "chlorophyll.diffuse_share",
            str(diffuse.tolist()),
            f"{n_bands} shares from 0 to 1",
            "Give one share for each band.",
        )
    towards_sun = direction_from_angles(sun_zenith_deg, sun_azimuth_deg)
    image = np.empty((n_bands, view.rows * view.columns), np.float32)
    for first, paths in zip(range(0, n_bands, 3), paths_per_pixel, strict=True):
        bands = list(range(first, min(first + 3, n_bands)))
        padded = np.array([bands[min(k, len(bands) - 1)] for k in range(3)])
        scene.paint(bands)
        scene.render.set_sun(towards_sun, (1 - diffuse[padded]) / towards_sun[2])
        scene.render.set_sky(lambda zenith, azimuth: np.ones_like(zenith), diffuse[padded])
        seen = _expose(scene, view, paths, stream_seed(seed, "bands", first))
        image[bands] = np.pi * seen[: len(bands)]
    return image.reshape(n_bands, view.rows, view.columns)


def _expose(scene: PaintedScene, view: View, paths: int, seed: int) -> np.ndarray:
    """Radiance (3, pixels) in the colours that the scene is painted with."""
    mi = scene.render.mi
    tracer = mi.load_dict({"type": "path", "max_depth": -1, "rr_depth": ROULETTE_DEPTH})
    sampler = mi.load_dict({"type": "independent"})
    n_pixels, at_once = view.rows * view.columns, max(CHUNK_RAYS // paths, 1)
    radiance = np.empty((3, n_pixels))
    parts = followed(range(0, n_pixels, at_once), "pixels of three bands")
    for number, begin in enumerate(parts):
        pixel = np.arange(begin, min(begin + at_once, n_pixels))
        own = stream_seed(seed, number)
        row, column = np.divmod(pixel, view.columns)
        place = patterns.shifted(paths, 2, (len(pixel),), own)
        x = view.left_m + (column[:, None] + place[..., 0]) * view.pixel_m
        y = view.top_m - (row[:, None] + place[..., 1]) * view.pixel_m
        start = mi.Point3f(
            mi.Float(x.ravel().astype(np.float32)),
            mi.Float(y.ravel().astype(np.float32)),
            mi.Float(scene.top_m + 1.0),
        )
        ray = mi.RayDifferential3f(start, mi.Vector3f(0.0, 0.0, -1.0))
        sampler.seed(own, x.size)
        colour, _, _ = tracer.sample(scene.render.scene, sampler, ray)
        radiance[:, pixel] = np.array(colour).reshape(3, len(pixel), paths).mean(axis=2)
    return radiance


def with_noise(
    image: np.ndarray, *, relative: float = 0.01, absolute: float = 0.001, seed: int
) -> np.ndarray:
    """Add a sensor's noise, independent between pixels and bands.

    Parameters
    ----------
    image : (b, rows, columns) float
        Reflectance.
    relative : float
        Standard deviation as a share of the value.
    absolute : float
        Standard deviation of a dark pixel.
    seed : int
    """
    noise = np.random.default_rng(seed).standard_normal(image.shape)
    return (image + np.hypot(relative * image, absolute) * noise).astype(np.float32)
