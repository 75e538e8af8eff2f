"""Scenes are put together from the files of a reconstruction, and sensors from their shade."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.formats import ground_surface, meshes, tables
from dapple.formats.ground_surface import GroundSurface
from dapple.formats.meshes import Mesh
from dapple.registration import shading
from dapple.retrieval import comparison
from dapple.retrieval.coefficients import Window
from dapple.scene import scene_files
from dapple.scene.surfaces import GROUND


def square(path, z_m):
    corners = np.array([[0, 0, z_m], [1, 0, z_m], [1, 1, z_m], [0, 1, z_m]], float)
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))
    meshes.write_ply(path, mesh)
    return str(path)


def files(tmp_path, ground="", shade=""):
    sensors = pd.DataFrame({"sensor": ["a"], "x_m": 0.5, "y_m": 0.5, "z_m": 3.0})
    tables.write(tmp_path / "sensors.csv", sensors)
    leaves = [square(tmp_path / f"leaves_{k}.ply", 5.0 + k) for k in range(2)]
    return SimpleNamespace(
        leaves=leaves, wood=square(tmp_path / "wood.ply", 4.0), ground=ground, shade=shade,
        sensors=str(tmp_path / "sensors.csv"),
    )  # fmt: skip


def test_there_is_a_scene_for_every_placement_of_the_leaves(tmp_path):
    params = SimpleNamespace(ground_z_m=2.0, sensor_table="sensors.csv")
    scenes, sensors = scene_files.with_sensors(files(tmp_path), params)
    assert [scene.bounds_m[1, 2] for scene in scenes] == [5.0, 6.0]
    assert {scene.ground_z_m for scene in scenes} == {2.0}
    assert sensors["sensor"].tolist() == ["a"]


def test_neighbours_are_leaves_and_a_slope_is_ground_with_flat_ground_below_it(tmp_path):
    axis = np.array([-2.0, 0.0, 2.0])
    slope = GroundSurface(axis, axis, np.tile(1.0 + 0.5 * axis, (3, 1)), "a file")
    ground_surface.write(tmp_path / "ground.nc", slope, np.zeros(3))
    params = SimpleNamespace(ground_z_m=None, sensor_table="sensors.csv")
    shade = square(tmp_path / "shade.ply", 8.0)
    inputs = files(tmp_path, str(tmp_path / "ground.nc"), shade)
    (scene, _), _ = scene_files.with_sensors(inputs, params)
    kinds = [(surface.optics, surface.is_leaf) for surface in scene.surfaces]
    assert kinds == [("leaf", True), ("wood", False), (GROUND, False), ("leaf", True)]
    assert scene.ground_z_m == pytest.approx(0.0)


def test_a_gain_is_what_sensors_in_full_sun_read_over_what_the_sky_says():
    simulated = np.full((4, 20), 1500.0)
    sunlit = np.ones((4, 20))
    sunlit[3] = 0.5  # half of the sun: tells no gain
    measured = 1.1 * simulated
    measured[3], measured[0, :5], measured[1, :5] = 9000.0, np.nan, 200.0  # no record; a shadow
    found = shading.open_sky_gain(measured, simulated, sunlit)
    assert found == {"gain": pytest.approx(1.1), "n_gain": 50}
    with pytest.raises(InputError, match=r"Set registration\.gain to none"):
        shading.open_sky_gain(measured[3:], simulated[3:], sunlit[3:])


def test_means_over_cells_know_no_chunks():
    """Of an image that comes in rows of pixels, and of the same image whole."""
    window = Window(0.0, 0.0, 0.5, 6, 4)
    image = np.random.default_rng(2).random((2, 1, 2, 6, 4))  # of two passes alike, one combination
    image[1] = image[0]
    whole = comparison.of_passes(image[:, 0], window, 1.0)
    pixels = image[0, 0].reshape(2, 24).T[:, None, :]
    chunks = ((slice(k, k + 7), pixels[k : k + 7]) for k in range(0, 24, 7))
    parts = comparison.of_chunks(chunks, window, 1.0)
    assert parts.cells == pytest.approx(whole.cells)
    assert (parts.pixels == 4).all()
    both = comparison.together([whole, parts])
    table = comparison.compare(both, comparison.together([whole, whole]), ("red", "green"))
    assert table["rmse"].to_numpy() == pytest.approx(0.0)
    assert set(table["n"]) == {2, 12}
