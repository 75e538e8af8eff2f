"""LESS 3 fires the pulses of a folder: `python less_scanner_run.py FOLDER` writes returns.npy.

Runs in a process of its own: LESS prints much. The folder holds `world.obj`, whose groups are
surfaces of one brightness, `world.json` about them and the scanner, `pulses.npy` (n, 6), origins
and unit directions in the axes of LESS, and `window.npy` (n, 2), ranges between which to look.
`returns.npy` has three rows: number of the pulse, range [m], peak over that of a white plate.
"""

import json
import sys
from pathlib import Path
from typing import Any

import less
import numpy as np
from scipy.spatial import cKDTree

PIECE = 16_384
"""Pulses of one call: LESS keeps their waveforms."""
MARGIN_M = 1.0
"""Beyond the window, so that pulses at its ends have room."""
WHITE_M = 10.0
"""Range of the white plate that echoes are measured against."""
BESIDE = 1e-4
"""A return lies on the axis of its pulse within this angle [rad]."""


class Survey(less.LiDARSurvey):
    """A survey of given pulses."""

    pulses: np.ndarray

    def generate_pulses(self, scene_w: float, scene_d: float) -> np.ndarray:
        return self.pulses


def world(folder: Path, facts: dict[str, Any]) -> less.Scene:
    """The plant above its ground."""
    plant = less.Object("world", mesh=str(folder / "world.obj"))
    for name, reflectance in facts["reflectance"].items():
        plant.set_property(name, _surface(reflectance, facts))
    return _scene(plant, facts["place_m"], facts["size_m"], facts)


def white(folder: Path, facts: dict[str, Any]) -> less.Scene:
    """A white plate that faces a scanner `WHITE_M` to its west, both 10 m above black ground."""
    path = folder / "white.obj"
    corners = [(0, y, z) for y, z in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    path.write_text("\n".join(["g white", *lines, "f 1 2 3", "f 1 3 4", ""]))
    plate = less.Object("white", mesh=str(path))
    plate.set_property("white", _surface(1.0, facts))
    return _scene(plate, [20.0, 20.0, 10.0], [40.0, 40.0], facts | {"ground": 0.0})


def _scene(
    thing: less.Object, place_m: list[float], size_m: list[float], facts: dict[str, Any]
) -> less.Scene:
    scene = less.Scene()
    scene.size = tuple(size_m)
    scene.terrain = less.Terrain(property=less.Lambertian(reflectance=facts["ground"]))
    scene.add(thing, positions=[place_m])
    scene.illumination = less.Illumination(less.Sun(0.0), less.NoAtmosphere())
    return scene


def _surface(reflectance: float, facts: dict[str, Any]) -> less.Lambertian:
    both = np.full(2, reflectance)
    return less.Lambertian(
        reflectance=both,
        back_reflectance=both,
        transmittance=np.zeros(2),
        wavelengths=facts["wavelength_nm"] + np.array([-50.0, 50.0]),
    )


def fired(
    scene: less.Scene, pulses: np.ndarray, window_m: tuple[float, float], facts: dict[str, Any]
) -> np.ndarray:
    """Number of the pulse, range [m] and peak of every return, (3, m); all from one place.

    LESS' points do not say which pulse they are of. They lie on its axis, and no two pulses from
    one place share one.
    """
    survey = Survey(
        scanner=less.Scanner(wavelengths=[facts["wavelength_nm"]], **facts["scanner"]),
        platform=less.Tripod(),
        range_min=max(facts["range_min_m"], window_m[0]),
        range_max=min(facts["range_max_m"], window_m[1]),
        range_resolution=facts["range_step_m"],
    )
    survey.pulses = pulses
    cloud = scene.simulate(survey)
    if not len(cloud.points):
        return np.empty((3, 0))
    ray = cloud.points - pulses[0, :3]
    range_m = np.linalg.norm(ray, axis=1)
    aside, pulse = cKDTree(pulses[:, 3:]).query(ray / range_m[:, None])
    if aside.max() > BESIDE:
        raise ValueError(f"a return of LESS {aside.max():.2g} rad beside every pulse")
    return np.stack([pulse, range_m, cloud.intensity])


def main(folder: Path) -> None:
    """Fire all pulses, those of one place together."""
    facts = json.loads((folder / "world.json").read_text())
    pulses, window = np.load(folder / "pulses.npy"), np.load(folder / "window.npy")
    scene = world(folder, facts)
    moved = 1 + np.flatnonzero((pulses[1:, :3] != pulses[:-1, :3]).any(axis=1))
    found = []
    for place in np.split(np.arange(len(pulses)), moved):
        for own in np.split(place, np.arange(PIECE, len(place), PIECE)):
            ends = window[own, 0].min() - MARGIN_M, window[own, 1].max() + MARGIN_M
            one = fired(scene, pulses[own], ends, facts)
            one[0] += own[0]
            found.append(one)
    shot, range_m, peak = np.concatenate(found, axis=1)
    east = np.array([[20.0 - WHITE_M, 20.0, 10.0, 1.0, 0.0, 0.0]], np.float32)
    ends = WHITE_M - 2.0, WHITE_M + 2.0
    of_white = fired(white(folder, facts), east, ends, facts)[2, 0] * (WHITE_M / range_m) ** 2
    np.save(folder / "returns.npy", np.stack([shot, range_m, peak / of_white]))


if __name__ == "__main__":
    main(Path(sys.argv[1]))
