"""Meshes survive being written and read, in every program's axes."""

import os
from pathlib import Path

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats import meshes, ply
from dapple.formats.meshes import Mesh
from dapple.structure.polygons import reconstruct

APPLE = Path(os.environ.get("DAPPLE_DATA_DIR", "../shared/data")) / "apple" / "bark.obj"


@pytest.fixture
def mesh():
    return reconstruct(np.random.default_rng(1).random((500, 3)) * 0.3, seed=1)


@pytest.fixture
def tetrahedron():
    """One element that is no flat polygon."""
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    faces = np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]], np.int32)
    return Mesh(vertices, faces, np.zeros(4, np.int32))


def test_ply_loses_nothing(tmp_path, mesh):
    meshes.write_ply(tmp_path / "mesh.ply", mesh, origin_m=(410500.0, 5317080.0, 288.7))
    again = meshes.read_ply(tmp_path / "mesh.ply")
    assert again.vertices_m.tobytes() == mesh.vertices_m.tobytes()
    assert (again.faces == mesh.faces).all()
    assert (again.element == mesh.element).all()
    assert ply.read(tmp_path / "mesh.ply")[3].tolist() == [410500.0, 5317080.0, 288.7]


def test_a_mesh_of_nothing_can_be_written(tmp_path):
    nothing = Mesh(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32))
    meshes.write_ply(tmp_path / "mesh.ply", nothing)
    assert meshes.read_ply(tmp_path / "mesh.ply").n_elements == 0


def test_ply_without_elements_has_one_a_triangle(tmp_path, tetrahedron):
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 4\nproperty float x\n"
        "property float y\nproperty float z\nelement face 4\n"
        "property list uchar uint vertex_index\nend_header\n"
    )
    face = np.zeros(4, [("n", "u1"), ("corners", "<u4", 3)])
    face["n"], face["corners"] = 3, tetrahedron.faces
    body = tetrahedron.vertices_m.astype("<f4").tobytes() + face.tobytes()
    (tmp_path / "other.ply").write_bytes(header.encode() + body)
    again = meshes.read_ply(tmp_path / "other.ply")
    assert again.n_elements == 4
    assert again.area_m2 == pytest.approx(1.5 + np.sqrt(3) / 2, rel=1e-6)


@pytest.mark.parametrize("axes", ["local", "less", "dart"])
def test_obj_keeps_polygons_in_every_program_s_axes(tmp_path, mesh, axes):
    meshes.write_obj(tmp_path / "mesh.obj", mesh, axes=axes)
    again = meshes.read_obj(tmp_path / "mesh.obj", axes=axes)
    assert again.n_elements == mesh.n_elements
    assert again.element_area_m2 == pytest.approx(mesh.element_area_m2, abs=2e-6)
    assert again.vertices_m.min(axis=0) == pytest.approx(mesh.vertices_m.min(axis=0), abs=1e-5)
    assert again.vertices_m.max(axis=0) == pytest.approx(mesh.vertices_m.max(axis=0), abs=1e-5)


def test_less_wants_height_second_and_east_backwards(tmp_path):
    triangle = Mesh(
        np.array([[1, 2, 3], [4, 2, 3], [1, 5, 3.0]]), np.array([[0, 1, 2]]), np.array([0])
    )
    meshes.write_obj(tmp_path / "mesh.obj", triangle, axes="less")
    assert "v -1.00000 3.00000 2.00000\n" in (tmp_path / "mesh.obj").read_text()


def test_an_element_that_is_no_flat_polygon_is_written_as_triangles(tmp_path, tetrahedron):
    meshes.write_obj(tmp_path / "mesh.obj", tetrahedron, axes="local")
    again = meshes.read_obj(tmp_path / "mesh.obj", axes="local")
    assert again.n_elements == 4
    assert again.area_m2 == pytest.approx(tetrahedron.area_m2)


def test_a_face_may_repeat_its_first_corner(tmp_path):
    text = (
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 0\nf 1 2 3 4 5\nf 1/7 2/8 3/9 1/7\nf -4 -3 -2\n"
    )
    (tmp_path / "closed.obj").write_text(text)
    mesh = meshes.read_obj(tmp_path / "closed.obj", axes="local")
    assert mesh.element_area_m2 == pytest.approx([1.0, 0.5, 0.5])
    assert len(mesh.vertices_m) == 4


def test_the_bark_of_the_published_apple_tree():
    if not APPLE.is_file():
        pytest.skip(f"no {APPLE}: set DAPPLE_DATA_DIR to the folder of the real data")
    bark = meshes.read_obj(APPLE, axes="less")
    assert bark.n_elements == 9517
    assert bark.vertices_m[:, 2].max() == pytest.approx(6.5, abs=0.1)  # a tree of 6.6 m
    assert np.ptp(bark.vertices_m, axis=0) == pytest.approx([8.09, 7.34, 6.52], abs=0.01)
    assert bark.area_m2 == pytest.approx(8.0575, abs=0.001)
    assert bark.element_area_m2.min() > 0
    assert bark.element_area_m2.max() < 0.06**2 * np.sqrt(3)  # a 5 cm voxel holds each


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("", "no face"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\n", "no face"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "vertex 4"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 1\n", "2 corners"),
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nf \n", "face 2 with 0 corners"),
        ("v 0 0 0\nv 1 0\nf 1 2 3\n", "line 2"),
    ],
)
def test_a_damaged_obj_is_refused(tmp_path, text, found):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(InputError, match=found):
        meshes.read_obj(tmp_path / "bad.obj", axes="local")


def test_unknown_axes_are_refused(tmp_path, mesh):
    with pytest.raises(InputError, match="less, dart or local"):
        meshes.write_obj(tmp_path / "mesh.obj", mesh, axes="blender")
    assert list(tmp_path.iterdir()) == []


def test_a_damaged_ply_is_refused(tmp_path, mesh):
    path = tmp_path / "mesh.ply"
    with pytest.raises(InputError, match="no file"):
        meshes.read_ply(path)
    meshes.write_ply(path, mesh)
    whole = path.read_bytes()
    path.write_bytes(whole[:-10])
    with pytest.raises(InputError, match="truncated"):
        meshes.read_ply(path)
    path.write_bytes(whole[:60])
    with pytest.raises(InputError, match="without end_header"):
        meshes.read_ply(path)
    path.write_bytes(whole.replace(b"binary_little_endian", b"ascii"))
    with pytest.raises(InputError, match="kind ascii"):
        meshes.read_ply(path)


def test_elements_know_their_tilt():
    upright = Mesh(np.array([[0, 0, 0], [0, 1, 0], [0, 0, 1.0]]), np.array([[0, 1, 2]]), [0])
    flat = Mesh(np.array([[0, 0, 0], [0, 1, 0], [1, 0, 0.0]]), np.array([[0, 1, 2]]), [0])
    both = meshes.concatenate(
        [Mesh(m.vertices_m, m.faces, np.array(m.element)) for m in (upright, flat)]
    )
    assert both.tilt_deg == pytest.approx([90, 0])


def test_polygons_that_are_there_from_both_sides_count_once(tmp_path):
    (tmp_path / "leaves.obj").write_text(
        "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 5\n"
        "f 1 2 3 4\nf 4 3 2 1\nf 1 2 5\nf 5 2 1\nf 2 3 5\n"
    )
    mesh = meshes.without_backs(meshes.read_obj(tmp_path / "leaves.obj", axes="local"))
    assert mesh.n_elements == 3
    assert mesh.element.tolist() == [0, 0, 1, 2]
    assert mesh.area_m2 == pytest.approx(1.0 + 2.5 + 0.5 * np.sqrt(26), rel=1e-6)
