"""Scenes in the format of the light-model intercomparison on plants: glTF, tables and `scene.json`.

The format is that of github.com/LightModelIntercomparisonOnPlant/TemplateScene. It leaves some
things open; here all vectors have the axes of the glTF files (x east, y up, z south), and a sky is
a list of points of equal solid angle, each with the direction in which its light travels and its
radiance.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from dapple.errors import InputError
from dapple.formats import gltf, json, tables
from dapple.formats.meshes import Mesh
from dapple.frames import (
    across,
    angles_from_direction,
    direction_from_angles,
    local_to_gltf,
)
from dapple.scene.facing import facing_of
from dapple.scene.point_sky import PointSky, even_points, with_sun
from dapple.scene.scene_optics import Optics
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene
from dapple.sky.sky_radiance import FLUXES, in_directions

BANDS_NM = {"blue": (400.0, 500.0), "green": (500.0, 600.0), "red": (600.0, 700.0)}
COLOURS = {"plants": (0.2, 0.5, 0.1), "background": (0.4, 0.35, 0.3), "sensors": (1.0, 1.0, 1.0)}
Nodes = dict[str, tuple[Mesh, np.ndarray | None, np.ndarray]]
"""As `formats.gltf.write` takes them."""
AROUND = 25.0
"""Half of the width of flat ground, in heights of what stands on it."""
POINT_M = 1e-3
"""Width of the plate of a sensor that is a point."""
FLAT_M = 1e-3


@dataclass(frozen=True)
class LitScene:
    """A scene, its sensors and the light of one moment.

    Attributes
    ----------
    scene : Scene
        Without voxels.
    optics : Optics
        In the bands, by material; wavelengths are the middles of the bands.
    sensors : pandas.DataFrame
        `sensor`, `x_m`, `y_m`, `z_m` and, where any is tilted, `tilt_deg` and `azimuth_deg`.
    bands_nm : mapping
        Least and greatest wavelength of each band by its name.
    sky : PointSky
        In the bands, sun included.
    aperture_m : float
        Diameter of a disc as large as a sensor.
    """

    scene: Scene
    optics: Optics
    sensors: pd.DataFrame
    bands_nm: Mapping[str, tuple[float, float]]
    sky: PointSky
    aperture_m: float


def at_highest_sun(
    scene: Scene, optics: Optics, sky: xr.Dataset, sensors: pd.DataFrame, aperture_m: float
) -> LitScene:
    """A scene as it is lit at the time of the highest sun, in three broad bands.

    Reflectance and transmittance of a band are means weighted by the light of that time.

    Raises
    ------
    InputError
        Voxels, which the format does not know.
    """
    if scene.voxels is not None:
        raise InputError("reconstruction", "voxels", "surfaces", "Take polygons or surfels.")
    now = sky.isel(time=[int(np.argmin(sky["sun_zenith_deg"].to_numpy()))])
    beam, diffuse = (now[name].transpose("time", "band").to_numpy()[0] for name in FLUXES)
    inside = np.array(
        [
            (optics.wavelength_nm >= low) & (optics.wavelength_nm < high)
            for low, high in BANDS_NM.values()
        ],
        float,
    )
    inside[-1] += optics.wavelength_nm == max(high for _, high in BANDS_NM.values())
    weight = inside * (beam + diffuse)
    grouped = optics.each(lambda values: (weight @ values) / np.maximum(weight.sum(axis=1), 1e-30))
    direction = even_points()
    relative = in_directions(now, *angles_from_direction(direction))[0]
    even = PointSky(direction, relative[:, None])
    points = PointSky(direction, relative[:, None] * (inside @ diffuse) / even.horizontal())
    sun = direction_from_angles(float(now["sun_zenith_deg"][0]), float(now["sun_azimuth_deg"][0]))
    if sun[2] > 0.0:
        points = with_sun(points, sun, inside @ beam)
    return LitScene(scene, grouped, sensors, BANDS_NM, points, aperture_m)


def write(folder: Path, lit: LitScene, description: str) -> None:
    """Write a scene into a folder, which is made where it is missing."""
    folder.mkdir(parents=True, exist_ok=True)
    meshes: dict[str, Nodes] = {"plants": {}, "background": {}}
    materials: dict[str, dict[str, str]] = {"plants": {}, "background": {}}
    for number, one in enumerate(lit.scene.filled):
        name = f"{one.optics}_{number}"
        of = "background" if one.optics == lit.scene.ground_optics else "plants"
        meshes[of][name] = (one.mesh, one.places_m, np.array(COLOURS[of]))
        nodes = [name]
        if one.places_m is not None:
            nodes = [f"{name}_{place}" for place in range(len(one.places_m))]
        materials[of] |= dict.fromkeys(nodes, one.optics)
    meshes["background"]["flat"] = (
        _flat_ground(lit.scene),
        None,
        np.array(COLOURS["background"]),
    )
    materials["background"]["flat"] = lit.scene.ground_optics
    meshes["sensors"] = _plates(lit.sensors, lit.aperture_m)
    for of, nodes_of in meshes.items():
        gltf.write(folder / f"{of}.gltf", nodes_of)
    for of, of_node in materials.items():
        table = pd.DataFrame(of_node.items(), columns=["id", "material"])
        tables.write(folder / f"spectral_{of}.csv", table, digits=None)
    scale = pd.DataFrame({"id": list(materials["plants"]), "plant": 1})
    tables.write(folder / "scale_plants.csv", scale, digits=None)
    for band, name in enumerate(lit.bands_nm):
        rows = pd.DataFrame(-local_to_gltf(lit.sky.direction), columns=["x", "y", "z"])
        rows["luminance"] = lit.sky.radiance[:, band]
        tables.write(folder / f"sky_{name}.csv", rows, digits=None)
    json.write(folder / "scene.json", _facts(lit, description))


def _facts(lit: LitScene, description: str) -> dict:
    materials = {
        name: {
            material: _lambertian(lit.optics, material, band) for material in lit.optics.reflectance
        }
        for band, name in enumerate(lit.bands_nm)
    }
    return {
        "Description": description,
        "Plant Architecture": ["plants.gltf"],
        "Background": ["background.gltf"],
        "Sensor": ["sensors.gltf"],
        "Scale": ["scale_plants.csv"],
        "Spectral_Band": {name: list(limits) for name, limits in lit.bands_nm.items()},
        "Spectral_Properties": {
            "materials": materials,
            "mapping": ["spectral_plants.csv", "spectral_background.csv"],
        },
        "Illumination": {"sky": {name: f"sky_{name}.csv" for name in lit.bands_nm}, "light": {}},
        "Measurements": {},
    }


def _lambertian(optics: Optics, material: str, band: int) -> str:
    """As the format writes it: reflectance alone of what is opaque, else transmittance too."""
    shares = [optics.reflectance_of(material)[band]]
    if material in optics.transmittance:
        shares.append(optics.transmittance_of(material)[band])
    return " ".join(["Lambertian", *(f"{share:.6g}" for share in shares)])


def _flat_ground(scene: Scene) -> Mesh:
    """A square below everything, so wide that what lies beyond hardly lights it."""
    low, high = scene.bounds_m
    half = AROUND * max(high[2] - scene.ground_z_m, 1.0)
    corners = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]) * half
    corners = np.column_stack([corners + (0.5 * (low + high))[:2], np.full(4, scene.ground_z_m)])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def _plates(sensors: pd.DataFrame, aperture_m: float) -> Nodes:
    """A square plate for each sensor, as large as its disc."""
    half = 0.5 * max(POINT_M, np.sqrt(np.pi / 4.0) * aperture_m)
    facing = facing_of(sensors)
    upright = np.tile([0.0, 0.0, 1.0], (len(sensors), 1)) if facing is None else facing
    faces, one = np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32)
    plates: Nodes = {}
    centres = sensors[POSITION].to_numpy(np.float64)
    for name, centre, normal in zip(sensors["sensor"], centres, upright, strict=True):
        first, second = half * across(normal)
        corners = centre + np.array(
            [-first - second, first - second, first + second, second - first]
        )
        plates[str(name)] = (Mesh(corners, faces, one), None, np.array(COLOURS["sensors"]))
    return plates
