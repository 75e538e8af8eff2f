"""Images of a virtual plot from above by LESS 3, which shares no code with dapple's own tracing."""

import json
import tempfile
from pathlib import Path

import numpy as np
from scipy.cluster.vq import kmeans2

from dapple import frames, less3
from dapple.formats import less_obj
from dapple.formats.meshes import Mesh, concatenate
from dapple.virtual.camera import View
from dapple.virtual.plot_optics import Materials

RUNNER = Path(__file__).with_name("less_camera_run.py")

MOST_ALIKE = 128
"""Kinds of opaque surfaces that LESS is given: the patches of ground are thousands."""

AROUND = 100.0
"""Dark ground around the plot, in its heights. LESS' sky goes on below the horizon where the ground
ends: less than 1 % of the light on an upright leaf at the height of the plot comes from there."""

BELOW_M = 0.02
"""Dark ground lies so far below the lowest place of the plot's, and LESS' own as far below that."""

BESIDE_M = 1.0
"""LESS' scene ends so far beside the plot. Single precision gets lost far from the corner of the
scene: with the dark ground inside it, the needles of a plot were up to 0.8 % too bright."""

ABOVE_M = 10.0
"""The camera is so far above the highest plant."""


def photograph(
    mesh: Mesh,
    materials: Materials,
    view: View,
    *,
    wavelength_nm: np.ndarray,
    sun_zenith_deg: float,
    sun_azimuth_deg: float,
    diffuse_share: np.ndarray,
    paths_per_pixel: int,
    seed: int,
) -> np.ndarray:
    """Reflectance of every pixel in every band.

    Parameters
    ----------
    mesh : Mesh
        Everything: leaves, wood, ground.
    materials : Materials
    view : View
    wavelength_nm : (b,) float
        Of the bands, all different: by which LESS tells them apart.
    sun_zenith_deg, sun_azimuth_deg : float
        Azimuth clockwise from north [°].
    diffuse_share : (b,) float
        Of the light on level ground: what comes from a sky of even radiance, not from the sun.
    paths_per_pixel : int
    seed : int
        Of the kinds of ground; LESS 3.0.0 takes no seed: its paths are the same in every run.

    Returns
    -------
    (b, rows, columns) float32
        pi times radiance over irradiance of level ground; row 0 in the north.

    Raises
    ------
    InputError
        LESS 3 is not installed.
    """
    less3.check("chlorophyll.world.renderer: less")
    order = np.argsort(wavelength_nm)
    used = few(materials, mesh.triangle_area_m2, seed)
    low, high = mesh.vertices_m.min(axis=0), mesh.vertices_m.max(axis=0)
    corner = np.array([low[0] - BESIDE_M, high[1] + BESIDE_M, low[2] - 2 * BELOW_M])
    extent = view.columns * view.pixel_m, view.rows * view.pixel_m
    middle = np.array([[view.left_m + extent[0] / 2, view.top_m - extent[1] / 2, 0.0]])
    diffuse = np.asarray(diffuse_share, float)[order]
    facts = {
        "wavelength_nm": np.asarray(wavelength_nm, float)[order].tolist(),
        "reflectance": used.reflectance[:, order].tolist(),
        "transmittance": used.transmittance[:, order].tolist(),
        "size_m": (high - low + 2 * BESIDE_M)[:2].tolist(),
        "place_m": frames.local_to_less3(np.zeros((1, 3)), corner)[0].tolist(),
        "beam": ((1 - diffuse) / np.cos(np.radians(sun_zenith_deg))).tolist(),
        "diffuse": diffuse.tolist(),
        "sun_deg": [sun_zenith_deg, sun_azimuth_deg],
        "pixels": [view.columns, view.rows],
        "extent_m": extent,
        "center_m": frames.local_to_less3(middle, corner)[0, :2].tolist(),
        "altitude_m": float(high[2] - corner[2] + ABOVE_M),
        "paths_per_pixel": int(paths_per_pixel),
    }
    with tempfile.TemporaryDirectory(prefix="dapple-less-") as name:
        folder = Path(name)
        names = [*(f"m{k}" for k in range(len(used.reflectance))), "dark"]
        parts = [mesh, dark_ground(low, high)]
        group = np.repeat([0, len(names) - 1], [len(part.faces) for part in parts])
        group[: len(used.of_face)] = used.of_face
        less_obj.write(folder / "world.obj", concatenate(parts), names, group)
        (folder / "world.json").write_text(json.dumps(facts))
        print(less3.run(RUNNER, folder, makes="image.npy"))
        return np.load(folder / "image.npy")[np.argsort(order)].astype(np.float32)


def dark_ground(low: np.ndarray, high: np.ndarray) -> Mesh:
    """A level square below and around a plot between two corners (3,), local frame [m]."""
    around = AROUND * (high[2] - low[2])
    (west, south), (east, north) = low[:2] - around, high[:2] + around
    corners = [[west, south], [east, south], [east, north], [west, north]]
    vertices_m = np.column_stack([corners, np.full(4, low[2] - BELOW_M)])
    return Mesh(vertices_m, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def few(materials: Materials, area_m2: np.ndarray, seed: int, most: int = MOST_ALIKE) -> Materials:
    """Materials of which at most about so many are opaque: like ones take their mean.

    Needles, which let light through, stay as they are, and so does bark: an opaque material that
    covers more than an even share of the area (t,) of all opaque faces.
    """
    opaque = np.all(materials.transmittance == 0, axis=1)
    if opaque.sum() <= most:
        return materials
    covered_m2 = np.bincount(materials.of_face, area_m2, len(opaque))
    small = opaque & (covered_m2 <= covered_m2[opaque].sum() / most)
    colour = materials.reflectance[small]
    spread = np.maximum(colour.std(axis=0), 1e-9)
    kind = kmeans2(colour / spread, most, minit="++", rng=np.random.default_rng(seed))[1]
    kept, kind = np.unique(kind, return_inverse=True)
    mean = np.stack([colour[kind == k].mean(axis=0) for k in range(kept.size)])
    number = np.empty(opaque.size, np.int32)
    number[~small] = np.arange(np.count_nonzero(~small))
    number[small] = np.count_nonzero(~small) + kind
    return Materials(
        np.concatenate([materials.reflectance[~small], mean]),
        np.concatenate([materials.transmittance[~small], np.zeros_like(mean)]),
        number[materials.of_face],
    )
