"""glTF of meshes: names, places, axes and colours as another program reads them."""

import numpy as np
import pytest
import trimesh

from dapple.formats import gltf
from dapple.formats.meshes import Mesh


def test_a_mesh_stands_where_it_was_under_its_name_and_in_its_colour(tmp_path):
    corners = np.array([[1.0, 2.0, 3.0], [2.0, 2.0, 3.0], [1.0, 4.0, 3.0]])
    one = Mesh(corners, np.array([[0, 1, 2]], np.int32), np.zeros(1, np.int32))
    places = np.array([[0.0, 0.0, 0.0], [10.0, 20.0, 0.5]])
    green = np.array([0.1, 0.4, 0.05])
    gltf.write(tmp_path / "a.glb", {"leaf": (one, None, green), "wood": (one, places, green)})
    read = trimesh.load_scene(tmp_path / "a.glb")
    assert set(read.geometry) == {"leaf", "wood"}
    assert read.geometry["leaf"].visual.material.baseColorFactor[1] == pytest.approx(102, abs=1)
    assert read.area == pytest.approx(3.0)
    # glTF is east, up, south: the highest, the most southern and the most eastern point
    assert read.bounds == pytest.approx(np.array([[1.0, 3.0, -24.0], [12.0, 3.5, -2.0]]))
