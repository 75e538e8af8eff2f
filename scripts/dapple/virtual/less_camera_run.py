"""LESS 3 photographs a folder from above: `python less_camera_run.py FOLDER` writes image.npy.

Runs in a process of its own: LESS prints much. The folder holds `world.obj`, whose groups are the
materials `m0`, `m1`, ..., and `world.json`: reflectance and transmittance of each material in each
band, light by band, the frame of the image, and how many paths a pixel takes.
"""

import json
import sys
from pathlib import Path
from typing import Any

import less
import numpy as np

MAX_ORDERS = 100
"""Most surfaces on a path: what is left of light after so many is nothing."""


class EvenSky:
    """The sun's light on a plane that faces it, and that of an even sky on the level."""

    def __init__(self, wavelength_nm: list[float], beam: list[float], diffuse: list[float]):
        self.wavelength_nm, self.beam, self.diffuse = wavelength_nm, beam, diffuse

    def surface_illumination(self, source: object, wavelengths: np.ndarray) -> tuple[Any, ...]:
        """As LESS asks: beam, diffuse, and nothing about where in the sky it comes from."""
        light = (self.beam, self.diffuse)
        return *(np.interp(wavelengths, self.wavelength_nm, part) for part in light), None, None


def main(folder: Path) -> None:
    """Build the scene and take the image."""
    facts = json.loads((folder / "world.json").read_text())
    bands = facts["wavelength_nm"]
    scene = less.Scene()
    scene.size = tuple(facts["size_m"])
    # The world brings its own ground, and dark ground around it; what lies below is dark too.
    scene.terrain = less.Terrain(property=less.Lambertian(reflectance=0.0))
    world = less.Object("world", mesh=str(folder / "world.obj"))
    world.set_property("dark", less.Lambertian(reflectance=0.0))
    pairs = zip(facts["reflectance"], facts["transmittance"], strict=True)
    for number, (reflectance, transmittance) in enumerate(pairs):
        world.set_property(
            f"m{number}",
            less.Lambertian(
                reflectance=np.array(reflectance),
                back_reflectance=np.array(reflectance),
                transmittance=np.array(transmittance),
                wavelengths=np.array(bands),
            ),
        )
    scene.add(world, positions=[facts["place_m"]])
    sky = EvenSky(bands, facts["beam"], facts["diffuse"])
    scene.illumination = less.Illumination(less.Sun(*facts["sun_deg"], irradiance=1.0), sky)
    projection = less.Orthographic(
        image_size=tuple(facts["pixels"]),
        extent=tuple(facts["extent_m"]),
        center=tuple(facts["center_m"]),
        altitude=facts["altitude_m"],
    )
    camera = less.OpticalImager(projection, bands=bands, quality=facts["paths_per_pixel"])
    radiance = np.asarray(scene.simulate(camera, scattering_order=MAX_ORDERS).data)
    np.save(folder / "image.npy", np.moveaxis(np.pi * radiance, -1, 0))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
