"""LESS 3 run on the scene of a folder: `python less_run.py FOLDER` writes FOLDER/light.csv.

Needs only `pip install less3d==3.0.0` (the release under the MIT licence). The folder holds

* `scene.json`: objects, their meshes and places, turbid voxels, sensors' plates, numbers of rays;
* OBJ meshes, in each of them one named group and flat normals (`v -east up north`);
* `spectra.csv`: reflectance and transmittance of every surface, a row a band;
* `sensors.csv`: sensors, where they lie and unit vectors to where they face;
* `suns.csv`, `beam.csv`, `diffuse.csv`, `sky.csv`: at each time the sun's place, irradiance in
  every band of a plane that faces the sun and of the level under the open sky, and radiance of the
  sky on 16 zenith angles (0 to 90 deg) times 32 azimuths (clockwise from north).

Places are in LESS' axes: metres, x east, y south, z up, a corner of the scene at the origin. A
sensor is a small white plate that is looked at from right before it; pi times its radiance is its
irradiance. LESS' sun is parallel light: suns spread over the disc stand for it.
"""

import csv
import json
import sys
from pathlib import Path
from typing import Any

import less
import numpy as np

PIXELS = 8
"""Of an edge of a sensor's image; their spread is the error of the mean."""
ORDERS = 2
"""Of scattering that are told apart: 1 is the plate alone, what is above met something else."""
SKY_GRID = (16, 32)
"""Zenith angles and azimuths of LESS' skies with a direction."""
GOLDEN = 0.5 * (np.sqrt(5.0) - 1.0)


class Sky:
    """An atmosphere that gives the scene the light it is told."""

    def __init__(
        self, bands: list[float], beam: np.ndarray, diffuse: np.ndarray, radiance: np.ndarray
    ):
        """Irradiance (b,) of a plane that faces the sun and of the level, and (16, 32) relative
        radiance of the sky."""
        self.bands, self.beam, self.diffuse, self.radiance = bands, beam, diffuse, radiance

    def surface_illumination(self, source: object, wavelengths: np.ndarray) -> tuple[Any, ...]:
        """As LESS asks: beam, diffuse, no coefficients of a model, and radiance by direction."""
        beam, level = (np.interp(wavelengths, self.bands, x) for x in (self.beam, self.diffuse))
        if np.ptp(self.radiance) == 0.0:  # an even sky is LESS' own, and faster
            return beam, level, None, None
        return beam, level, None, (level[:, None, None] * self.radiance).astype(np.float32)


def table(path: Path, skip: int = 0) -> np.ndarray:
    """Numbers of a CSV file with a header, without its first columns."""
    with path.open(newline="") as file:
        rows = list(csv.reader(file))[1:]
    return np.array([[float(cell) for cell in row[skip:]] for row in rows])


def column(path: Path, name: str) -> list[str]:
    """A column of a CSV file as text."""
    with path.open(newline="") as file:
        return [row[name] for row in csv.DictReader(file)]


def properties(folder: Path) -> tuple[list[float], dict[str, less.Lambertian]]:
    """The bands [nm], and what each surface is made of."""
    with (folder / "spectra.csv").open(newline="") as file:
        names = next(csv.reader(file))[1:]
    values = table(folder / "spectra.csv")
    found: dict[str, dict[str, np.ndarray]] = {}
    for name, value in zip(names, values[:, 1:].T, strict=True):
        surface, kind = name.rsplit("_", 1)
        found.setdefault(surface, {})[kind] = value
    for kinds in found.values():
        kinds |= {"back_reflectance": kinds["reflectance"], "wavelengths": values[:, 0]}
    return list(values[:, 0]), {name: less.Lambertian(**kinds) for name, kinds in found.items()}


def build(folder: Path, facts: dict[str, Any], optics: dict[str, Any]) -> less.Scene:
    """The scene with its ground, objects, voxels and plates."""
    scene = less.Scene()
    scene.size = (facts["size_m"], facts["size_m"])
    scene.terrain = less.Terrain(property=optics[facts["ground"]])
    for one in facts["objects"]:
        mesh = less.Object(one["name"], mesh=str(folder / one["mesh"]))
        mesh.set_property(one["group"], optics[one["optics"]])
        scene.add(mesh, positions=one["places_m"])
    if turbid := facts["voxels"]:
        for number, one in enumerate(turbid["classes"]):
            cubes = less.Object(f"voxels_{number}")
            boundary = less.TurbidBoundary(str(folder / turbid["mesh"]), group="cube")
            cubes.add_component("cube", boundary)
            leaves = less.OpticalVegetation(
                leaf=optics[turbid["optics"]],
                leaf_area_density=one["leaf_area_density_m2_m3"],
                leaf_angle_distribution=turbid["leaf_angle_distribution"],
            )
            cubes.set_property("cube", leaves)
            scene.add(cubes, positions=one["centres_m"], scales=turbid["edge_m"])
    for one in facts["plates"]:
        plates = less.Object(one["name"], mesh=str(folder / one["mesh"]))
        plates.set_property("plate", less.Lambertian(reflectance=1.0))
        scene.add(plates, positions=one["places_m"])
    return scene


def in_disc(n_fine: int = 50) -> np.ndarray:
    """(p,) weights of pixels, which see a square, for the mean over the disc in it."""
    axis = (np.arange(PIXELS * n_fine) + 0.5) / (PIXELS * n_fine) - 0.5
    inside = np.hypot(axis[:, None], axis) < 0.5
    weight = inside.reshape(PIXELS, n_fine, PIXELS, n_fine).sum(axis=(1, 3)).ravel()
    return weight / weight.sum()


def mean_and_variance(pixels: np.ndarray, error: np.ndarray) -> tuple[float, float]:
    """Mean over a sensor's disc of what pixels (p,) see with standard errors, and its variance."""
    weight = in_disc()
    return float(weight @ pixels), float(weight**2 @ error**2)


def seen(
    scene: less.Scene,
    place: np.ndarray,
    facts: dict[str, Any],
    bands: list[float],
    quality: int,
    orders: int,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Irradiance of a plate as its pixels see it, (p,) over all bands: straight, and scattered.

    The third is the standard error of their sum; bands share their paths, so their errors add up.
    Each pixel takes `quality` rays; light meets at most so many surfaces (`orders`) on its way.
    """
    plate = facts["plate"]
    target, facing = place[:3], place[3:]
    position = target + plate["camera_m"] * facing
    north_is_aside = abs(facing[1]) < 0.7
    camera = less.Perspective(
        image_size=PIXELS,
        fov=2.0 * float(np.degrees(np.arctan(0.5 * plate["seen_m"] / plate["camera_m"]))),
        position=tuple(position.tolist()),
        target=tuple(target.tolist()),
        up=(0, 1, 0) if north_is_aside else (1, 0, 0),
    )
    sensor = less.OpticalImager(
        camera,
        bands=bands,
        quality=max(1, quality),
        outputs=("radiance", "standard_error", "scattering_order"),
        max_output_order=ORDERS,
    )
    image = scene.simulate(sensor, scattering_order=orders + 1)
    by_order = np.asarray(image.scattering_orders, dtype=np.float64)
    par = np.pi * by_order.sum(axis=-1).reshape(len(by_order), -1)
    error = np.pi * np.asarray(image.standard_error, dtype=np.float64).sum(axis=-1).ravel()
    return par[:2].sum(axis=0), par[2:].sum(axis=0), error


def suns(
    zenith_deg: float, azimuth_deg: float, diameter_deg: float, n: int, seed: list[int]
) -> list[tuple[float, float]]:
    """Zenith and azimuth [deg] of points that are spread evenly over the sun's disc."""
    if diameter_deg == 0.0:
        return [(zenith_deg, azimuth_deg)]
    turn, along = np.random.default_rng(seed).random(2)
    sine = np.sin(np.radians(0.5 * diameter_deg)) * np.sqrt((np.arange(n) + along) / n)
    angle = 2.0 * np.pi * (turn + GOLDEN * np.arange(n))
    flat = np.stack([sine * np.cos(angle), sine * np.sin(angle)], axis=1)
    zenith, azimuth = np.radians([zenith_deg, azimuth_deg])
    axis = np.array(
        [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)]
    )
    aside = np.array([np.cos(azimuth), -np.sin(azimuth), 0.0])
    way = flat @ np.stack([aside, np.cross(axis, aside)])
    way += np.sqrt(1.0 - sine**2)[:, None] * axis
    tilt = np.degrees(np.arccos(np.clip(way[:, 2], -1.0, 1.0)))
    return list(zip(tilt, np.degrees(np.arctan2(way[:, 0], way[:, 1])) % 360.0, strict=True))


def under_the_sun(
    scene: less.Scene,
    place: np.ndarray,
    facts: dict[str, Any],
    bands: list[float],
    beam: np.ndarray,
    angles: tuple[float, float],
    seed: list[int],
) -> tuple[float, float, float]:
    """Straight and scattered light of the sun, and the variance of their sum.

    What scatters is lit by one sun in the middle: penumbras do not change its mean.
    """
    rays = facts["rays"]
    sky = Sky(bands, beam, np.zeros(len(bands)), np.zeros(SKY_GRID))

    def lit(way: tuple[float, float], quality: int, orders: int) -> tuple[np.ndarray, ...]:
        source = less.Sun(zenith=way[0], azimuth=way[1], irradiance=1.0)
        scene.illumination = less.Illumination(source=source, atmosphere=sky)
        return seen(scene, place, facts, bands, quality, orders)

    quality = round(rays["rays"] / PIXELS**2)
    straight, scattered, error = lit(angles, quality, rays["max_orders"])
    more, variance = mean_and_variance(scattered, error)
    points = suns(*angles, rays["sun_diameter_deg"], rays["suns"], seed)
    if len(points) == 1:
        return mean_and_variance(straight, error)[0], more, variance
    few = 1 if facts["voxels"] is None else quality // len(points)
    parts = np.zeros((len(points), PIXELS**2))
    for number, way in enumerate(points):
        if way[0] < 90.0:
            parts[number] = lit(way, few, 0)[0]
    # between suns, and between places on the disc, which all suns see alike
    spread = np.full(PIXELS**2, parts.mean(axis=0).std(ddof=1))
    direct, between_places = mean_and_variance(parts.mean(axis=0), spread)
    between_suns = (parts @ in_disc()).var(ddof=1) / len(points)
    return direct, more, variance + between_places + between_suns


def main(folder: Path) -> None:
    """Simulate all sensors at all times."""
    facts = json.loads((folder / "scene.json").read_text())
    bands, optics = properties(folder)
    scene = build(folder, facts, optics)
    labels, times = column(folder / "sensors.csv", "sensor"), column(folder / "suns.csv", "time")
    places, angles = table(folder / "sensors.csv", skip=1), table(folder / "suns.csv", skip=1)
    beam, diffuse = table(folder / "beam.csv", skip=1), table(folder / "diffuse.csv", skip=1)
    sky = table(folder / "sky.csv", skip=1).reshape(-1, *SKY_GRID)
    rays = facts["rays"]
    rows = []
    for step, time in enumerate(times):
        for number, label in enumerate(labels):
            direct = from_sky = scattered = variance = 0.0
            if beam[step].any() and angles[step][0] < 90.0:
                seed = [rays["seed"], step, number]
                direct, scattered, variance = under_the_sun(
                    scene, places[number], facts, bands, beam[step], angles[step], seed
                )
            if diffuse[step].any():
                scene.illumination = less.Illumination(
                    source=less.Sun(zenith=0.0, irradiance=1.0),
                    atmosphere=Sky(bands, np.zeros(len(bands)), diffuse[step], sky[step]),
                )
                quality = round(rays["rays"] / PIXELS**2)
                straight, more, error = seen(
                    scene, places[number], facts, bands, quality, rays["max_orders"]
                )
                from_sky, of_sky = mean_and_variance(straight, error)
                scattered += mean_and_variance(more, error)[0]
                variance += of_sky
            parts = (direct, from_sky, scattered)
            rows.append((time, label, sum(parts), *parts, float(np.sqrt(variance))))
    with (folder / "light.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["time", "sensor", "par", "direct", "sky", "scattered", "standard_error"])
        writer.writerows(rows)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
