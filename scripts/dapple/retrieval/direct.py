"""Images of one leaf and soil at a time, by Mitsuba's own camera and path tracer.

The reference for images made of paths that were traced once: nothing but the meshes and the BSDF
of leaves (`light.mitsuba_plugins`) is shared. Colour channels are spectral bands, three at a time.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from time import perf_counter

import numpy as np

from dapple import engine
from dapple.light import mitsuba_scene
from dapple.light.scene import Optics, Scene
from dapple.retrieval.coefficients import Window
from dapple.streams import stream_seed

CAMERA_ABOVE_M = 10.0
"""The camera's plane is so far above the highest plant."""


@dataclass(frozen=True)
class Render:
    """Images by independent passes, and the time that they took.

    Attributes
    ----------
    passes : (s, b, rows, columns) float32
        Reflectance factors; their mean is the image, their spread its noise.
    n_paths : int
        Per pixel in all.
    build_s, render_s : float
        Wall time of handing over the scene and of rendering [s].
    """

    passes: np.ndarray
    n_paths: int
    build_s: float
    render_s: float

    @property
    def image(self) -> np.ndarray:
        """(b, rows, columns) float32."""
        return self.passes.mean(axis=0)


def render(
    scene: Scene,
    window: Window,
    sun_direction: np.ndarray,
    optics: Optics,
    diffuse_share: np.ndarray,
    *,
    n_paths: int,
    seed: int,
    n_passes: int = 2,
    max_depth: int = 128,
    roulette_depth: int = 5,
    variant: str = "llvm_ad_rgb",
) -> Render:
    """Render one combination of leaves and surfaces.

    Parameters
    ----------
    scene : Scene
        Meshes; turbid voxels work too.
    window : Window
        The pixels.
    sun_direction : (3,) float64
        Unit vector towards the sun, above the horizon.
    optics : Optics
        In any number of bands.
    diffuse_share : (b,) float
        Of the light on level ground that comes from a sky of even radiance.
    n_paths : int
        Per pixel, in equal parts for every pass; rounded up to a grid of strata.
    seed : int
        Of the random numbers.
    n_passes : int
        Independent images of which the result is the mean.
    max_depth : int
        Longest path in segments.
    roulette_depth : int
        From this depth on weak paths are ended by chance.
    variant : str
        An rgb variant of Mitsuba.

    Returns
    -------
    Render
    """
    mi = engine.load(variant)
    integrator = mi.load_dict({"type": "path", "max_depth": max_depth, "rr_depth": roulette_depth})
    per_pass = strata(-(-n_paths // n_passes))
    camera = mi.load_dict(_camera(mi, window, float(scene.bounds_m[1, 2]), per_pass))
    images, build_s, render_s = [], 0.0, 0.0
    for bands in _threes(len(optics)):
        started = perf_counter()
        some = Optics(*(np.asarray(getattr(optics, k))[bands] for k in Optics.__dataclass_fields__))
        loaded = mitsuba_scene.build(scene, some, variant=variant)
        share = np.asarray(diffuse_share, float)[bands]
        loaded.set_sun(np.asarray(sun_direction), (1 - share) / sun_direction[2])
        loaded.set_sky(lambda zenith, _: np.ones_like(zenith), share)
        _weigh_lights(mi, loaded.scene, float(share.mean()))
        build_s += perf_counter() - started
        started = perf_counter()
        passes = [
            np.array(
                mi.render(
                    loaded.scene,
                    sensor=camera,
                    integrator=integrator,
                    spp=per_pass,
                    seed=stream_seed(seed, "direct", str(bands), k),
                )
            )
            for k in range(n_passes)
        ]
        images.append(np.pi * np.stack(passes)[..., : len(some)])
        render_s += perf_counter() - started
    stacked = np.concatenate(images, axis=-1).transpose(0, 3, 1, 2).astype(np.float32)
    return Render(np.ascontiguousarray(stacked), per_pass * n_passes, build_s, render_s)


def strata(n: int) -> int:
    """The number of samples, at least n, that fills a grid."""
    rows = max(1, int(np.sqrt(n)))
    return rows * -(-n // rows)


def _weigh_lights(mi, scene, sky_share: float) -> None:
    """Let paths ask the sun and the sky for light as often as befits what they bring."""
    parameters = mi.traverse(scene)
    sky = min(max(sky_share, 0.05), 0.95)
    parameters["sun.sampling_weight"], parameters["sky.sampling_weight"] = 1 - sky, sky
    parameters.update()


def _threes(n: int) -> Iterator[slice]:
    """Slices of at most three bands."""
    for low in range(0, n, 3):
        yield slice(low, min(low + 3, n))


def _camera(mi, window: Window, top_z_m: float, n_samples: int) -> dict:
    """An orthographic camera that looks down, north at the top of its image."""
    width, height = window.columns * window.pixel_m, window.rows * window.pixel_m
    middle = [window.left_m + 0.5 * width, window.top_m - 0.5 * height]
    above = top_z_m + CAMERA_ABOVE_M
    down = mi.ScalarTransform4f().look_at(
        origin=[*middle, above], target=[*middle, above - 1.0], up=[0.0, 1.0, 0.0]
    )
    # Its view is 2 units wide; the height follows from the film.
    return {
        "type": "orthographic",
        "to_world": down @ mi.ScalarTransform4f().scale([0.5 * width, 0.5 * width, 1.0]),
        "near_clip": 1e-2,
        "far_clip": 1e4,
        "film": {
            "type": "hdrfilm",
            "width": window.columns,
            "height": window.rows,
            "pixel_format": "rgb",
            "rfilter": {"type": "box"},
        },
        "sampler": {"type": "multijitter", "sample_count": n_samples},
    }
