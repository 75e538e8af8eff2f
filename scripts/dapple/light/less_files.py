"""A scene as LESS 3 takes it: a folder with everything that `less_run.py` reads."""

import json
import shutil
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple import frames
from dapple.errors import InputError
from dapple.formats import less_obj, netcdf, tables
from dapple.formats.meshes import Mesh
from dapple.scene.facing import facing_of
from dapple.scene.scene_optics import Optics
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene, turbid_grid
from dapple.sky.sky_radiance import FLUXES, in_directions

FACING = ["facing_x", "facing_y", "facing_z"]
"""Unit normals of the sensors in the axes of LESS."""
RUNNER = Path(__file__).with_name("less_run.py")
SKY_GRID = (16, 32)
"""Zenith angles and azimuths at which LESS 3.0.0 takes the radiance of a sky."""
AROUND = 25.0
"""Ground around a tree, in heights of the tree: what lies beyond lights it by less than 1e-3."""
POINT_M = 1e-3
"""Seen width of a sensor that is a point."""
CAMERA_M = 1e-2
"""Least height of the camera above the plate."""
VOXEL_GAP = 0.998
"""Turbid bodies that touch are opaque in LESS 3.0.0: cubes are smaller by this factor."""
DENSITY_STEP = 0.05
"""Voxels whose densities differ by less than this share are one object, of their mean density."""
TURBID_SUNS = 2
"""Suns that are enough for turbid voxels: their light hardly changes over the sun's disc."""
LIFT_M = 1e-3
"""A plate that lies on the ground is lifted by this much."""


@dataclass(frozen=True)
class LessRays:
    """How LESS 3 samples light.

    Attributes
    ----------
    rays : int
        Of a sensor and time for the sky, and as many again for the sun.
    suns : int
        Parallel suns that stand for the disc.
    max_orders : int
        Most surfaces on a path, the sensor's plate not counted.
    sun_diameter_deg : float
        0: one sun in the middle [deg].
    seed : int
    """

    rays: int
    suns: int
    max_orders: int
    sun_diameter_deg: float
    seed: int


def write(
    folder: Path,
    scene: Scene,
    optics: Optics,
    sky: xr.Dataset,
    sensors: pd.DataFrame,
    rays: LessRays,
    aperture_m: float = 0.0,
) -> None:
    """Write a scene, its light, its sensors and the program that runs LESS 3 on them.

    Parameters
    ----------
    folder : Path
        Made where it is missing.
    scene : Scene
    optics : Optics
        In the bands of the sky, ascending.
    sky : xarray.Dataset
        Sun and sky at the times that are to be simulated.
    sensors : DataFrame
        `sensor`, `x_m`, `y_m`, `z_m` in the local frame, perhaps `tilt_deg` and `azimuth_deg`.
    rays : LessRays
    aperture_m : float
        Diameter of the sensors' receiving discs [m].

    Raises
    ------
    InputError
        Voxels whose leaf angles LESS does not know.
    """
    folder.mkdir(parents=True, exist_ok=True)
    size_m, corner_m = _around(scene)
    seen_m = max(POINT_M, aperture_m)
    facing = facing_of(sensors)
    upright = np.tile([0.0, 0.0, 1.0], (len(sensors), 1)) if facing is None else facing
    places = frames.local_to_less3(sensors[POSITION].to_numpy(np.float64), corner_m)
    places[:, 2] = np.maximum(places[:, 2], LIFT_M)
    objects = []
    for number, one in enumerate(scene.filled):
        name = f"{one.optics}_{number}"
        less_obj.write(folder / f"{name}.obj", one.mesh, [one.optics])
        shifts = np.zeros((1, 3)) if one.places_m is None else one.places_m
        objects.append(
            {
                "name": name,
                "mesh": f"{name}.obj",
                "group": one.optics,
                "optics": one.optics,
                "places_m": frames.local_to_less3(shifts, corner_m).tolist(),
            }
        )
    voxels = _voxels(folder, scene, corner_m)
    if voxels is not None:
        rays = replace(rays, suns=min(rays.suns, TURBID_SUNS))
    facts = {
        "size_m": size_m,
        "corner_m": corner_m.tolist(),
        "ground": scene.ground_optics,
        "objects": objects,
        "voxels": voxels,
        "plate": {"seen_m": seen_m, "camera_m": max(CAMERA_M, seen_m)},
        "plates": _plates(folder, 2.0 * seen_m, places, upright),
        "rays": asdict(rays),
    }
    (folder / "scene.json").write_text(json.dumps(facts, indent=1))
    _write_spectra(folder / "spectra.csv", optics)
    _write_light(folder, sky, optics.wavelength_nm)
    columns = np.concatenate([places, frames.local_to_less3(upright, np.zeros(3))], axis=1)
    table = pd.DataFrame(columns, columns=[*POSITION, *FACING])
    table.insert(0, "sensor", sensors["sensor"].to_numpy())
    tables.write(folder / "sensors.csv", table, digits=None)
    shutil.copyfile(RUNNER, folder / RUNNER.name)


def _around(scene: Scene) -> tuple[float, np.ndarray]:
    """Edge of the square of ground [m], and its north-western corner on the ground, (3,) local."""
    middle, edge = np.zeros(2), 2.0 * AROUND
    if scene.filled or turbid_grid(scene.voxels) is not None:
        low, high = scene.bounds_m
        middle = 0.5 * (low + high)[:2]
        edge = float((high - low)[:2].max() + 2.0 * AROUND * max(high[2] - scene.ground_z_m, 1.0))
    corner = [middle[0] - 0.5 * edge, middle[1] + 0.5 * edge, scene.ground_z_m]
    return edge, np.array(corner)


def _plates(
    folder: Path, width_m: float, places: np.ndarray, facing: np.ndarray
) -> list[dict[str, Any]]:
    """Write a plate for each way that sensors (n, 3) face, and list where such plates lie."""
    ways, way = np.unique(facing, axis=0, return_inverse=True)
    found = []
    for number, normal in enumerate(ways):
        name = f"plate_{number}"
        less_obj.write(folder / f"{name}.obj", _square(width_m, normal), ["plate"])
        mine = places[way.ravel() == number]
        found.append({"name": name, "mesh": f"{name}.obj", "places_m": mine.tolist()})
    return found


def _square(width_m: float, normal: np.ndarray) -> Mesh:
    """A square around the origin with this unit normal."""
    ends = 0.5 * width_m * np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    corners = ends @ frames.across(normal)
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def _cube() -> Mesh:
    """A closed cube of edge 1 around the origin whose faces look out."""
    corners = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)]) - 0.5
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    faces = np.array([[q[0], q[k], q[k + 1]] for q in quads for k in (1, 2)], np.int32)
    return Mesh(corners, faces, np.zeros(len(faces), np.int32))


def _voxels(folder: Path, scene: Scene, corner_m: np.ndarray) -> dict[str, Any] | None:
    """Turbid cubes by classes of density, or None where there are none."""
    grid = turbid_grid(scene.voxels)
    if grid is None:
        return None
    known = ("spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform")
    if grid.leaf_angle_distribution not in known:
        raise InputError(
            "light.engine: less",
            f"voxels with {grid.leaf_angle_distribution} leaf angles",
            f"one of {', '.join(known)}",
            "Choose one of these distributions, or another engine.",
        )
    less_obj.write(folder / "cube.obj", _cube(), ["cube"])
    density = grid.plant_area_density_m2_m3
    where = np.argwhere(density > 0.0)
    values = density[density > 0.0]
    step = np.round(np.log(values) / np.log1p(DENSITY_STEP)).astype(int)
    centres = frames.local_to_less3(grid.low_m + (where + 0.5) * grid.voxel_size_m, corner_m)
    classes = [
        {
            # the way through a smaller cube is shorter: denser leaves make up for it
            "leaf_area_density_m2_m3": float(values[step == k].mean() / VOXEL_GAP),
            "centres_m": centres[step == k].tolist(),
        }
        for k in np.unique(step)
    ]
    return {
        "mesh": "cube.obj",
        "optics": scene.voxel_optics,
        "leaf_angle_distribution": grid.leaf_angle_distribution,
        "edge_m": VOXEL_GAP * grid.voxel_size_m,
        "classes": classes,
    }


def _write_spectra(path: Path, optics: Optics) -> None:
    """Reflectance and transmittance of every surface by band."""
    columns = {"wavelength_nm": optics.wavelength_nm}
    for kind in ("reflectance", "transmittance"):
        for name, values in getattr(optics, kind).items():
            columns[f"{name}_{kind}"] = values
    tables.write(path, pd.DataFrame(columns), digits=None)


def _write_light(folder: Path, sky: xr.Dataset, wavelength_nm: np.ndarray) -> None:
    """Sun and sky of all times, a row each."""
    when = [moment.isoformat() for moment in netcdf.times(sky)]
    angles = {name: sky[name].to_numpy() for name in ("sun_zenith_deg", "sun_azimuth_deg")}
    tables.write(folder / "suns.csv", pd.DataFrame({"time": when, **angles}), digits=None)
    for name, variable in zip(("beam", "diffuse"), FLUXES, strict=True):
        flux = sky[variable].transpose("time", "band").to_numpy()
        table = pd.DataFrame(flux, columns=[f"nm_{nm:g}" for nm in wavelength_nm])
        table.insert(0, "time", when)
        tables.write(folder / f"{name}.csv", table, digits=None)
    table = pd.DataFrame(sky_radiance(sky).reshape(len(when), -1))
    table.insert(0, "time", when)
    tables.write(folder / "sky.csv", table, digits=None)


def sky_radiance(sky: xr.Dataset) -> np.ndarray:
    """Radiance of the sky on LESS' grid for a horizontal irradiance of 1, (t, 16, 32) [sr-1].

    LESS takes it as linear in zenith angle and azimuth between the nodes; so does the integral that
    it is divided by.
    """
    n_zenith, n_azimuth = SKY_GRID
    zenith = np.linspace(0.0, 90.0, n_zenith)
    azimuth = np.arange(n_azimuth) * 360.0 / n_azimuth
    grid = np.meshgrid(np.minimum(zenith, 89.5), azimuth, indexing="ij")
    radiance = in_directions(sky, *grid)
    fine = np.radians((np.arange(9000) + 0.5) * 0.01)
    weight = np.cos(fine) * np.sin(fine) * np.radians(0.01) * 2.0 * np.pi
    around = radiance.mean(axis=2)
    level = np.array([np.interp(np.degrees(fine), zenith, row) @ weight for row in around])
    return radiance / level[:, None, None]
