"""A synthetic apple tree, sensors and an afternoon's sky for benchmarks: no data needed."""

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats.meshes import Mesh
from dapple.formats.netcdf import time_coordinate
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds

CENTRE_M, RADII_M = np.array([0.0, 0.0, 4.4]), np.array([3.8, 3.8, 2.3])
LEAF_AREA_M2 = 187.0
LEAVES_PER_SHOOT = 40
SHOOT_RADIUS_M = 0.18


def leaves(n_triangles: int, seed: int = 1) -> Mesh:
    """Square leaves with spherical angles, clumped around shoots in a crown 7 m wide."""
    rng = np.random.default_rng(seed)
    n = max(n_triangles // 2, 1)
    shoots = max(n // LEAVES_PER_SHOOT, 1)
    direction = rng.normal(size=(shoots, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    # More shoots outside than inside, as light would have it.
    shoot = CENTRE_M + direction * rng.random((shoots, 1)) ** 0.25 * RADII_M
    centre = shoot[rng.integers(shoots, size=n)] + rng.normal(size=(n, 3)) * SHOOT_RADIUS_M
    u, v = rng.normal(size=(2, n, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    v = np.cross(u, v)
    v /= np.linalg.norm(v, axis=1, keepdims=True)
    half = 0.5 * np.sqrt(LEAF_AREA_M2 / n)
    corners = [centre + half * (a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    faces = np.arange(n)[:, None] * 4 + np.array([[0, 1, 2, 0, 2, 3]])
    return Mesh(
        np.stack(corners, axis=1).reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), 2),
    )


def stem() -> Mesh:
    """A square stem to the middle of the crown, with no sensor in it."""
    corners = np.array([(0.2, 0.2), (0.4, 0.2), (0.4, 0.4), (0.2, 0.4)])
    vertices = np.concatenate([np.c_[corners, np.zeros(4)], np.c_[corners, np.full(4, 4.0)]])
    sides = [((k, (k + 1) % 4, (k + 1) % 4 + 4), (k, (k + 1) % 4 + 4, k + 4)) for k in range(4)]
    faces = np.array(sides, np.int32).reshape(-1, 3)
    return Mesh(vertices, faces, np.zeros(len(faces), np.int32))


def voxels(mesh: Mesh, size_m: float) -> xr.Dataset:
    """Leaf area per volume of the voxels in which leaves have their centres."""
    centre = mesh.vertices_m[mesh.faces].mean(axis=1)
    low = np.floor(centre.min(axis=0) / size_m) * size_m
    shape = tuple(np.floor((centre.max(axis=0) - low) / size_m).astype(int) + 1)
    cell = np.ravel_multi_index(np.floor((centre - low) / size_m).astype(int).T, shape)
    density = np.bincount(cell, mesh.triangle_area_m2, int(np.prod(shape))).reshape(shape)
    return xr.Dataset(
        {"plant_area_density_m2_m3": (("x", "y", "z"), density / size_m**3)},
        coords={a: low[k] + size_m * (np.arange(shape[k]) + 0.5) for k, a in enumerate("xyz")},
        attrs={"voxel_size_m": size_m, "leaf_angle_distribution": "spherical"},
    )


def scene(kind: str, n_triangles: int = 350_000) -> Scene:
    """`polygons`, or `voxels_0.2` and the like."""
    mesh = leaves(n_triangles)
    if kind == "polygons":
        return Scene(of_kinds(leaf=mesh, wood=stem()))
    return Scene(of_kinds(wood=stem()), voxels(mesh, float(kind.removeprefix("voxels_"))))


def sensors(n: int) -> np.ndarray:
    """(n, 3) places on a square grid under and beside the crown [m]."""
    side = int(np.ceil(np.sqrt(n)))
    place = (np.arange(side) + 0.5) / side * 10 - 5
    x, y = np.meshgrid(place, place)
    return np.stack([x.ravel(), y.ravel(), np.full(side**2, 0.05)], axis=1)[:n]


def optics(n_bands: int = 61) -> Optics:
    """Green leaves: a peak of reflectance and transmittance at 550 nm."""
    wavelength = np.linspace(400, 700, n_bands)
    peak = np.exp(-(((wavelength - 550) / 40) ** 2))
    flat = np.ones(n_bands)
    return Optics.of_tree(
        wavelength, 0.05 + 0.08 * peak, 0.02 + 0.1 * peak, 0.2 * flat, 0.1 + 0.1 * peak
    )


def sky(n_times: int = 306, n_bands: int = 61) -> xr.Dataset:
    """A clear afternoon in August: a tenth to a fifth of light from a sky bright about the sun."""
    zenith = np.linspace(33, 65, n_times)
    azimuth = np.linspace(180, 270, n_times)
    beam = 2500 * np.exp(-0.3 / np.cos(np.radians(zenith)))
    diffuse = 250 * np.cos(np.radians(zenith)) ** 0.4
    per_band = np.ones(n_bands) / n_bands
    units = {"units": "µmol m-2 s-1", "long_name": "light"}
    start = pd.Timestamp("2023-08-10 11:30", tz="UTC")
    times = pd.date_range(start, periods=n_times, freq="1min")
    return xr.Dataset(
        {
            "sun_zenith_deg": ("time", zenith),
            "sun_azimuth_deg": ("time", azimuth),
            "beam_normal_umol_m2_s": (("time", "band"), beam[:, None] * per_band, units),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), diffuse[:, None] * per_band, units),
            "sky_coefficients": (
                ("time", "coefficient"),
                np.tile([-1.0, -0.3, 10.0, -3.0, 0.45], (n_times, 1)),
            ),
        },
        coords={"time": time_coordinate(times)},
        attrs={"sky_model": "perez"},
    )
