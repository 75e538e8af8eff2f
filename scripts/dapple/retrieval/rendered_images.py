"""Images of one leaf and soil at a time, by Mitsuba's own camera and path tracer.

The reference for images made of paths that were traced once: nothing but the meshes and the BSDF
of leaves (`scene.mitsuba_plugins`) is shared. Colour channels are spectral bands, three at a time.
"""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from dapple import engine
from dapple.retrieval.coefficients import Window
from dapple.scene import mitsuba_scene
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene
from dapple.streams import stream_seed

CHANNELS = 3
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
    seconds : float
        Wall time [s].
    """

    passes: np.ndarray
    n_paths: int
    seconds: float

    @property
    def image(self) -> np.ndarray:
        """(b, rows, columns) float32."""
        return self.passes.mean(axis=0)


class Renderer:
    """A scene that is handed to Mitsuba once, whatever its leaves, soil and light.

    Parameters
    ----------
    scene : Scene
        Meshes.
    variant : str
        An rgb variant of Mitsuba.
    """

    def __init__(self, scene: Scene, *, variant: str = "llvm_ad_rgb"):
        grey = Optics.of_tree(*np.full((5, CHANNELS), 0.2))
        self.loaded = mitsuba_scene.build(scene, grey, variant=variant)
        self.variant, self.top_z_m = variant, float(scene.bounds_m[1, 2])

    def render(
        self,
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
    ) -> Render:
        """Render one combination of leaves and surfaces.

        Parameters
        ----------
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

        Returns
        -------
        Render
        """
        started = perf_counter()
        mi = engine.load(self.variant)
        integrator = {"type": "path", "max_depth": max_depth, "rr_depth": roulette_depth}
        integrator = mi.load_dict(integrator)
        per_pass = strata(-(-n_paths // n_passes))
        camera = mi.load_dict(_camera(mi, window, self.top_z_m, per_pass))
        images = []
        for low in range(0, len(optics), CHANNELS):
            bands = slice(low, min(low + CHANNELS, len(optics)))
            share = self._set(optics, diffuse_share, bands)
            self.loaded.set_sun(np.asarray(sun_direction), (1 - share) / sun_direction[2])
            self.loaded.set_sky(lambda zenith, _: np.ones_like(zenith), share)
            passes = [
                np.array(
                    mi.render(
                        self.loaded.scene,
                        sensor=camera,
                        integrator=integrator,
                        spp=per_pass,
                        seed=stream_seed(seed, "direct", low, k),
                    )
                )
                for k in range(n_passes)
            ]
            images.append(np.pi * np.stack(passes)[..., : bands.stop - low])
        stacked = np.concatenate(images, axis=-1).transpose(0, 3, 1, 2)
        stacked = np.ascontiguousarray(stacked, np.float32)
        return Render(stacked, per_pass * n_passes, perf_counter() - started)

    def _set(self, optics: Optics, diffuse_share: np.ndarray, bands: slice) -> np.ndarray:
        """Give leaves and surfaces their colours; returns the diffuse share of the channels."""
        mi = self.loaded.mi

        def channels(values) -> np.ndarray:
            some = np.asarray(values, float)[bands]
            return np.pad(some, (0, CHANNELS - len(some)), mode="edge")

        self.loaded.set_optics(optics.each(channels))
        share = channels(diffuse_share)
        # Paths ask the sun and the sky for light as often as befits what they bring.
        sky = float(np.clip(share.mean(), 0.05, 0.95))
        parameters = mi.traverse(self.loaded.scene)
        parameters["sun.sampling_weight"], parameters["sky.sampling_weight"] = 1 - sky, sky
        parameters.update()
        return share


def strata(n: int) -> int:
    """The number of samples, at least n, that fills a grid."""
    rows = max(1, int(np.sqrt(n)))
    return rows * -(-n // rows)


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
