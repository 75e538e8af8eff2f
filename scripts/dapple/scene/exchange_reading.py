"""Read a scene in the format of the light-model intercomparison on plants (see `exchange`)."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple.errors import InputError
from dapple.formats import gltf, json
from dapple.formats.meshes import Mesh, concatenate
from dapple.frames import angles_from_direction, gltf_to_local
from dapple.scene.exchange import FLAT_M, LitScene
from dapple.scene.point_sky import PointSky
from dapple.scene.scene_optics import Optics
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import GROUND, Scene, Surface

LEVEL = 1.0 - 1e-6
"""Cosine from which on a sensor counts as level."""


def read(path: str | Path) -> LitScene:
    """Read a scene, its sensors and its light.

    Flat background becomes the endless ground; without background the ground is black. Lamps,
    scales and measurements are not read.

    Parameters
    ----------
    path : path
        `scene.json`, beside which its files lie.

    Raises
    ------
    InputError
        A file or key is missing, or a material is not Lambertian or has two different faces.
    """
    path = Path(path)
    facts = _facts(path)
    bands = {
        name: (float(low), float(high)) for name, (low, high) in facts["Spectral_Band"].items()
    }
    optics = _optics(path, facts, bands)
    material = _mapping(path, facts, optics)
    plants, background = (
        dict(_by_material(path, facts, key, material))
        for key in ("Plant Architecture", "Background")
    )
    surfaces = [
        Surface(mesh, name, is_leaf=name in optics.transmittance) for name, mesh in plants.items()
    ]
    scene, optics = _with_ground(surfaces, background, optics)
    sensors, aperture_m = _sensors(path, facts)
    return LitScene(scene, optics, sensors, bands, _sky(path, facts, bands), aperture_m)


def _facts(path: Path) -> dict[str, Any]:
    if not path.is_file():
        raise InputError(path, "no such file", "scene.json of a scene", "Give its path.")
    try:
        facts = json.read(path)
    except ValueError as error:
        raise InputError(path, f"no JSON ({error})", "scene.json", "Write it again.") from error
    for key in ("Plant Architecture", "Sensor", "Spectral_Band", "Spectral_Properties"):
        if not facts.get(key):
            raise InputError(path, f"no `{key}`", "a scene with sensors and spectra", "Add it.")
    return facts


def _optics(path: Path, facts: dict, bands: Mapping[str, tuple[float, float]]) -> Optics:
    """Reflectance and transmittance of every material in every band."""
    shares: dict[str, list[list[float]]] = {}
    for band in bands:
        for name, text in facts["Spectral_Properties"]["materials"].get(band, {}).items():
            shares.setdefault(name, []).append(_lambertian(path, f"{band}, {name}", text))
    for name, found in shares.items():
        if len(found) != len(bands):
            raise InputError(
                path,
                f"`{name}` in {len(found)} bands",
                f"all {len(bands)} bands",
                "Add the others.",
            )
    middle = np.array([0.5 * (low + high) for low, high in bands.values()])
    reflected = {name: np.array([one[0] for one in found]) for name, found in shares.items()}
    passed = {
        name: np.array([one[1] for one in found])
        for name, found in shares.items()
        if len(found[0]) > 1
    }
    return Optics(middle, reflected, passed)


def _lambertian(path: Path, where: str, text: Any) -> list[float]:
    """Reflectance, and transmittance of what lets light through."""
    kind, *numbers = text.split() if isinstance(text, str) else ("a file of scattering",)
    try:
        shares = [float(number) for number in numbers]
    except ValueError:
        shares = []
    if len(shares) == 4 and shares[:2] == shares[2:]:
        shares = shares[:2]
    if kind.lower() != "lambertian" or len(shares) not in (1, 2) or not 0 <= sum(shares) <= 1:
        raise InputError(
            path,
            f"`{text}` ({where})",
            "`Lambertian R` or `Lambertian R T`, alike on both faces, R + T at most 1",
            "Give the material so.",
        )
    return shares


def _mapping(path: Path, facts: dict, optics: Optics) -> dict[tuple[str, str], str]:
    """Material by file and node; a table named after a file counts for that file."""
    found = {}
    for name in facts["Spectral_Properties"].get("mapping", []):
        table = _table(path.parent / name)
        of_file = Path(name).stem.removeprefix("spectral_")
        for node, material in table.iloc[:, :2].astype(str).itertuples(index=False):
            if material.strip() in optics.reflectance:
                found[of_file, node.strip()] = material.strip()
    return found


def _table(path: Path) -> pd.DataFrame:
    """Of commas or blanks, its first line perhaps a header."""
    if not path.is_file():
        raise InputError(path, "no such file", "a table that scene.json names", "Add it.")
    return pd.read_csv(path, header=None, sep=r"[,;\s]+", engine="python", dtype=str)


def _by_material(
    path: Path, facts: dict, key: str, material: dict[tuple[str, str], str]
) -> Iterator[tuple[str, Mesh]]:
    """Meshes of all files of a list, those of one material together."""
    meshes: dict[str, list[Mesh]] = {}
    for name in facts.get(key, []):
        for node, mesh in gltf.read(path.parent / name).items():
            of = material.get((Path(name).stem, node))
            if of is None:
                raise InputError(
                    path.parent / name,
                    f"node `{node}` without a material",
                    f"a row of it in spectral_{Path(name).stem}.csv, of a material of scene.json",
                    "Add the row.",
                )
            meshes.setdefault(of, []).append(mesh)
    yield from ((of, concatenate(parts)) for of, parts in meshes.items())


def _with_ground(
    surfaces: list[Surface], background: dict[str, Mesh], optics: Optics
) -> tuple[Scene, Optics]:
    """Flat background as endless ground; of several materials the largest."""
    if not background:
        black = {GROUND: np.zeros(len(optics))}
        reflected = {**optics.reflectance, **black}
        optics = Optics(optics.wavelength_nm, reflected, optics.transmittance)
        lowest = min(float(one.mesh.vertices_m[:, 2].min()) for one in surfaces)
        return Scene(tuple(surfaces), ground_z_m=lowest, ground_optics=GROUND), optics
    ground = max(background, key=lambda name: background[name].area_m2)
    lowest = min(float(mesh.vertices_m[:, 2].min()) for mesh in background.values())
    for name, mesh in background.items():
        raised = mesh.vertices_m[mesh.faces][..., 2].max(axis=1) > lowest + FLAT_M
        if raised.any():
            rest = Mesh(mesh.vertices_m, mesh.faces[raised], mesh.element[raised])
            surfaces.append(Surface(rest, name, is_leaf=name in optics.transmittance))
    return Scene(tuple(surfaces), ground_z_m=lowest, ground_optics=ground), optics


def _sensors(path: Path, facts: dict) -> tuple[pd.DataFrame, float]:
    """Middle and normal of every sensor, and the diameter of a disc of their mean area."""
    rows, areas = [], []
    for name in facts["Sensor"]:
        for node, mesh in gltf.read(path.parent / name).items():
            area = mesh.triangle_area_m2
            centre = area @ mesh.vertices_m[mesh.faces].mean(axis=1) / area.sum()
            normal = mesh.triangle_normal.sum(axis=0)
            tilt_deg, azimuth_deg = map(float, angles_from_direction(normal))
            if np.cos(np.radians(tilt_deg)) > LEVEL:
                tilt_deg = azimuth_deg = 0.0
            rows.append([node, *centre, tilt_deg, azimuth_deg])
            areas.append(area.sum())
    table = pd.DataFrame(rows, columns=["sensor", *POSITION, "tilt_deg", "azimuth_deg"])
    return table, float(np.sqrt(4.0 * np.mean(areas) / np.pi))


def _sky(path: Path, facts: dict, bands: Mapping[str, tuple[float, float]]) -> PointSky:
    """Points of the sky, the same in every band; their light comes down."""
    named = facts.get("Illumination", {}).get("sky", {})
    directions, columns = [], []
    for band in bands:
        if band not in named:
            raise InputError(path, f"no sky of `{band}`", "a sky for every band", "Add it.")
        table = _table(path.parent / named[band]).apply(pd.to_numeric, errors="coerce").dropna()
        values = table.to_numpy(float)
        if values.ndim != 2 or values.shape[1] != 4 or not len(values):
            raise InputError(
                path.parent / named[band], "other columns", "x y z luminance", "Write it so."
            )
        towards = gltf_to_local(values[:, :3])
        towards /= np.linalg.norm(towards, axis=1, keepdims=True)
        # the way that light travels, or the way to where it comes from: all are of one kind
        directions.append(towards * np.sign(np.median(towards[:, 2])))
        columns.append(values[:, 3])
    if any(
        one.shape != directions[0].shape or not np.allclose(one, directions[0])
        for one in directions
    ):
        raise InputError(path, "skies of other points in other bands", "one set", "Write them so.")
    return PointSky(directions[0], np.stack(columns, axis=1))
