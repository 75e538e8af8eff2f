"""Build Mitsuba's scene from ours: leaves, wood, turbid voxels, ground, a sky map and a sun.

Mitsuba's three colour channels serve as three spectral bands. Everything stays in the local
frame (x east, y north, z up); only the sky map has axes of its own, turned here.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.scene.mitsuba_plugins import register
from dapple.scene.surfaces import Optics, Scene, TurbidGrid, turbid_grid

SPHERICAL_G = 0.5
"""Projection of a unit of leaf area with spherical angles, in any direction (Ross 1981)."""


@dataclass
class RenderScene:
    """A Mitsuba scene whose sun and sky can be set without rebuilding it.

    Attributes
    ----------
    mi : module
        `mitsuba` in the variant that the scene belongs to.
    scene : mitsuba.Scene
    n_bands : int
        Bands in use, 1 to 3; the remaining channels repeat the last one.
    ground_z_m : float
    variant : str
        Of Mitsuba.
    sun_radius_rad : float
        Half the angular diameter of the sun's disc.
    sky_shape : (rows, columns)
        Of the sky map.
    medium : mitsuba.Medium or None
    medium_box_m : (2, 3) float64 or None
        Low and high corner of the box that the medium fills.
    """

    mi: ModuleType
    scene: Any
    n_bands: int
    ground_z_m: float
    variant: str
    sun_radius_rad: float
    sky_shape: tuple[int, int]
    medium: Any = None
    medium_box_m: np.ndarray | None = None

    def __post_init__(self) -> None:
        self._parameters = self.mi.traverse(self.scene)
        self._parameters.keep(["sun.to_world", "sun.irradiance.value", "sky.data", "sky.scale"])

    @property
    def integrator(self) -> str:
        """The name of the Mitsuba integrator that the scene needs."""
        return "path" if self.medium is None else "volpath"

    def in_medium(self, points_m: np.ndarray) -> np.ndarray:
        """(n,) whether points lie in the box that the turbid medium fills."""
        if self.medium_box_m is None:
            return np.zeros(len(points_m), dtype=bool)
        low, high = self.medium_box_m
        return ((points_m > low) & (points_m < high)).all(axis=1)

    def set_sun(self, direction: np.ndarray, beam_normal: np.ndarray) -> None:
        """Let parallel light come from `direction` (3,) with irradiance `beam_normal` (n_bands,).

        Rays do not meet this sun: it only lights what scatters. Nothing needs rebuilding.
        """
        beam = channels(beam_normal, self.n_bands, fill=0.0)
        self._parameters["sun.irradiance.value"] = self.mi.Color3f(*beam.tolist())
        self._parameters["sun.to_world"] = self.mi.Transform4f(facing(self.mi, -direction))
        self._parameters.update()

    def set_sky(
        self,
        relative_radiance: Callable[[np.ndarray, np.ndarray], np.ndarray],
        diffuse_horizontal: np.ndarray,
    ) -> None:
        """Fill the sky map.

        Parameters
        ----------
        relative_radiance : callable
            Of zenith and azimuth [deg], arrays of the same shape; of any scale.
        diffuse_horizontal : (n_bands,) array
            Irradiance of the open sky on the level; the map is scaled to give it exactly.
        """
        light = channels(diffuse_horizontal, self.n_bands, fill=0.0)
        if light.any():
            self._fill_sky(sky_map(relative_radiance, self.sky_shape)[:, :, None] * light, 1.0)
        else:
            # a black map cannot be sampled: keep a bright one and scale it to nothing
            self._fill_sky(np.ones((*self.sky_shape, 3)), 0.0)

    def set_even_sky(self, radiance: np.ndarray) -> None:
        """Give all directions, those below the horizon too, the same radiance (n_bands,)."""
        light = channels(radiance, self.n_bands, fill=0.0)
        self._fill_sky(np.broadcast_to(light, (*self.sky_shape, 3)), 1.0)

    def _fill_sky(self, radiance: np.ndarray, scale: float) -> None:
        # Mitsuba's map repeats its first column at the end
        closed = np.concatenate([radiance, radiance[:, :1]], axis=1)
        self._parameters["sky.data"] = self.mi.TensorXf(closed.astype(np.float32))
        self._parameters["sky.scale"] = self.mi.Float(scale)
        self._parameters.update()


def channels(values: np.ndarray, n_bands: int, fill: float | None = None) -> np.ndarray:
    """Fill (n_bands,) values up to three channels, with `fill` or the last value."""
    values = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if values.shape != (n_bands,):
        raise InputError(
            "bands",
            f"values of shape {values.shape}",
            f"one value for each of the {n_bands} bands of the scene",
            "Sum the bands with scene.group_flux first.",
        )
    last = values[-1] if fill is None else fill
    return np.concatenate([values, np.full(3 - n_bands, last)])


def sky_map(
    relative_radiance: Callable[[np.ndarray, np.ndarray], np.ndarray], shape: tuple[int, int]
) -> np.ndarray:
    """Radiance on a grid of directions, scaled to unit irradiance on the level.

    Parameters
    ----------
    relative_radiance : callable
        Of zenith and azimuth [deg].
    shape : (rows, columns)
        Rows run from the zenith to the nadir, both included; an odd number of them puts one on
        the horizon. Columns run clockwise from half a column east of north.

    Returns
    -------
    (rows, columns) float64
        0 below the horizon. The light that the interpolation leaks into the first row below it
        meets the ground from beneath.
    """
    rows, columns = shape
    zenith = np.linspace(0.0, np.pi, rows)
    up = zenith <= 0.5 * np.pi + 1e-9
    azimuth_deg = (np.arange(columns) + 0.5) * 360.0 / columns
    # skies go as exp(b / cos zenith): the horizon itself is a limit
    zenith_deg = np.minimum(np.degrees(zenith[up]), 89.99)
    radiance = np.zeros(shape)
    radiance[up] = relative_radiance(*np.meshgrid(zenith_deg, azimuth_deg, indexing="ij"))
    weight = _row_weights(rows) * (2.0 * np.pi / columns)
    return radiance / (radiance * weight[:, None]).sum()


@cache
def _row_weights(rows: int) -> np.ndarray:
    """Integral of cos z sin z dz over the upper hemisphere with each row's interpolation weight."""
    step = np.pi / (rows - 1)
    fine = (np.arange(200_000) + 0.5) * (0.5 * np.pi / 200_000)
    place = fine / step
    row = place.astype(np.int64)
    value = np.cos(fine) * np.sin(fine) * (0.5 * np.pi / len(fine))
    part = place - row
    weight = np.bincount(row, value * (1.0 - part), rows)
    return weight + np.bincount(row + 1, value * part, rows)


def build(
    scene: Scene,
    optics: Optics,
    *,
    variant: str = "llvm_ad_rgb",
    sun_diameter_deg: float = 0.53,
    sky_step_deg: float = 1.0,
    ground_radius_m: float = 1000.0,
) -> RenderScene:
    """Build the Mitsuba scene once; sun and sky are dark until they are set.

    Parameters
    ----------
    scene : Scene
    optics : Optics
        One to three bands (`group_bands` gathers more).
    variant : str
        An rgb variant of Mitsuba.
    sun_diameter_deg : float
        Angular diameter of the sun's disc; 0.53 on average over a year [deg].
    sky_step_deg : float
        Resolution of the sky map; divides 90.
    ground_radius_m : float
        The ground is a disc of this radius below the scene's centre.

    Raises
    ------
    InputError
        More than three bands, unknown kinds of mesh, or leaf angles that are not spherical.
    """
    if not 1 <= len(optics) <= 3:
        raise InputError(
            "bands", f"{len(optics)} bands", "1 to 3", "Gather them with scene.group_bands."
        )
    scene.check_kinds()
    mi = engine.load(variant)
    register()
    colour = _colours(mi, optics)
    grid = turbid_grid(scene.voxels)
    if grid is not None and grid.leaf_angle_distribution != "spherical":
        raise InputError(
            "leaf_angle_distribution",
            grid.leaf_angle_distribution,
            "spherical, for which the extinction is the same in all directions (G = 0.5)",
            "For other leaf angles use the transport engine with light.check: false.",
        )
    rows = 2 * round(90.0 / sky_step_deg) + 1
    shape = (rows, 2 * (rows - 1))
    content = {
        "type": "scene",
        "sun": dark_sun(mi),
        "sky": sky_emitter(mi, shape),
        "ground": {
            "type": "disk",
            "to_world": _affine(mi, _below(scene, grid), ground_radius_m),
            "bsdf": {"type": "diffuse", "reflectance": colour["ground_reflectance"]},
        },
        **mesh_shapes(mi, scene.meshes, colour),
    }
    box = None
    if grid is not None:
        content["voxels"], box = _medium_box(mi, grid, colour, scene.ground_z_m)
    loaded = mi.load_dict(content)
    inside = [shape.interior_medium() for shape in loaded.shapes() if shape.id() == "voxels"]
    return RenderScene(
        mi=mi,
        scene=loaded,
        n_bands=len(optics),
        ground_z_m=scene.ground_z_m,
        variant=variant,
        sun_radius_rad=np.radians(0.5 * sun_diameter_deg),
        sky_shape=shape,
        medium=inside[0] if inside else None,
        medium_box_m=box,
    )


def mesh_shapes(mi: ModuleType, meshes: dict[str, Mesh], colour: dict[str, Any]) -> dict[str, Any]:
    """Mitsuba meshes by kind; `colour` holds the reflectances as Mitsuba dictionaries."""
    lambertian = {"wood": "bark_reflectance", "ground": "ground_reflectance"}
    bsdf = {
        "leaf": {
            "type": "bilambertian",
            "reflectance": _plain(mi, colour["leaf_reflectance"]),
            "transmittance": _plain(mi, colour["leaf_transmittance"]),
        },
    } | {
        kind: {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": colour[name]}}
        for kind, name in lambertian.items()
    }
    return {
        f"{kind}_mesh": triangles(mi, kind, mesh, mi.load_dict(bsdf[kind]))
        for kind, mesh in meshes.items()
        if len(mesh.faces)
    }


def triangles(mi: ModuleType, name: str, mesh: Mesh, bsdf: Any) -> Any:
    """A Mitsuba mesh without shading normals, every triangle of one BSDF."""
    properties = mi.Properties()
    properties["bsdf"] = bsdf
    properties["face_normals"] = True
    shape = mi.Mesh(name, len(mesh.vertices_m), len(mesh.faces), props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = np.asarray(mesh.vertices_m, dtype=np.float32).ravel()
    parameters["faces"] = np.asarray(mesh.faces, dtype=np.uint32).ravel()
    parameters.update()
    return shape


def _colours(mi: ModuleType, optics: Optics) -> dict[str, dict]:
    """Optical properties as rgb dictionaries; values that are no share of light are errors."""
    n = len(optics)
    names = [name for name in Optics.__dataclass_fields__ if name != "wavelength_nm"]
    values = {name: channels(getattr(optics, name), n) for name in names}
    values["leaf_albedo"] = values["leaf_reflectance"] + values["leaf_transmittance"]
    for name, share in values.items():
        if share.min() < 0.0 or share.max() > 1.0 + 1e-6:
            raise InputError(
                name, f"{share.min():.3g} to {share.max():.3g}", "0 to 1", "Check the spectra."
            )
    return {
        name: {"type": "rgb", "value": np.minimum(share, 1.0).tolist()}
        for name, share in values.items()
    }


def _plain(mi: ModuleType, colour: dict) -> Any:
    return mi.ScalarColor3f(colour["value"])


def _below(scene: Scene, grid: TurbidGrid | None) -> np.ndarray:
    """The point of the ground below the middle of the plants."""
    corners = [mesh.vertices_m for mesh in scene.meshes.values() if len(mesh.faces)]
    if grid is not None:
        shape = np.array(grid.plant_area_density_m2_m3.shape)
        corners.append(grid.low_m + np.array([np.zeros(3), shape * grid.voxel_size_m]))
    if not corners:
        return np.array([0.0, 0.0, scene.ground_z_m])
    points = np.concatenate(corners)
    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return np.array([middle[0], middle[1], scene.ground_z_m])


def _affine(mi: ModuleType, shift_m: np.ndarray, scale: float | np.ndarray) -> Any:
    scale = np.broadcast_to(np.asarray(scale, dtype=np.float64), 3).tolist()
    transform = mi.ScalarTransform4f()
    return transform.translate(np.asarray(shift_m).tolist()) @ transform.scale(scale)


def facing(mi: ModuleType, way: np.ndarray) -> Any:
    """Transform that turns Mitsuba's z axis to the unit vector `way`."""
    aside = [0.0, 1.0, 0.0] if abs(way[2]) > 0.7 else [0.0, 0.0, 1.0]
    target = np.asarray(way).tolist()
    return mi.ScalarTransform4f().look_at(origin=[0.0, 0.0, 0.0], target=target, up=aside)


def dark_sun(mi: ModuleType) -> dict:
    """Parallel light from the zenith, without light until it is set."""
    return {
        "type": "directional",
        "to_world": facing(mi, np.array([0.0, 0.0, -1.0])),
        "irradiance": {"type": "rgb", "value": [0.0, 0.0, 0.0]},
    }


def sky_emitter(mi: ModuleType, shape: tuple[int, int]) -> dict:
    """A sky map whose axes (x, y up, -z at azimuth 0) are turned to east, up, north."""
    turn = [[1, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]]
    return {
        "type": "envmap",
        "bitmap": mi.Bitmap(np.ones((*shape, 3), dtype=np.float32)),
        "scale": 0.0,
        "to_world": mi.ScalarTransform4f(np.array(turn, dtype=np.float64)),
    }


def _medium_box(
    mi: ModuleType, grid: TurbidGrid, colour: dict[str, Any], ground_z_m: float
) -> tuple[dict, np.ndarray]:
    """A cube of turbid medium with one layer of empty voxels around the filled ones.

    The faces of the cube lie within the empty layer, off its middle, so that they coincide with
    neither voxel faces, nor sensors on a regular grid, nor the ground.
    """
    size = grid.voxel_size_m
    extinction = np.pad(SPHERICAL_G * grid.plant_area_density_m2_m3, 1)
    low = grid.low_m - size
    high = low + size * np.array(extinction.shape)
    inset_low, inset_high = np.full(3, 0.382 * size), np.full(3, 0.382 * size)
    if abs(low[2] + inset_low[2] - ground_z_m) < 0.1 * size:
        inset_low[2] = 0.618 * size
    box = np.stack([low + inset_low, high - inset_high])
    cube = {
        "type": "cube",
        "id": "voxels",
        "to_world": _affine(mi, box.mean(axis=0), 0.5 * (box[1] - box[0])),
        "bsdf": {"type": "null"},
        "interior": {
            "type": "heterogeneous",
            "albedo": colour["leaf_albedo"],
            "sigma_t": {
                "type": "gridvolume",
                # Mitsuba's grids run z, y, x, channel
                "grid": mi.VolumeGrid(
                    np.ascontiguousarray(extinction.transpose(2, 1, 0)[..., None], np.float32)
                ),
                "filter_type": "nearest",
                "to_world": _affine(mi, low, high - low),
            },
            "phase": {
                "type": "leaf_phase",
                "reflectance": _plain(mi, colour["leaf_reflectance"]),
                "transmittance": _plain(mi, colour["leaf_transmittance"]),
            },
        },
    }
    return cube, box
