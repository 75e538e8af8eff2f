"""Large clouds are worked on slab by slab: the same bytes, in the memory of a slab."""

import itertools
import tracemalloc

import laspy
import numpy as np
import pytest

from dapple.cloud import selection, voxel_groups
from dapple.cloud.classify import majority
from dapple.cloud.clean import thin
from dapple.formats import cloud_las, clouds, ground_surface, meshes, ply
from dapple.formats.clouds import Cloud
from dapple.formats.ground_surface import GroundSurface
from dapple.formats.shots import Shots
from dapple.structure import polygon_sizes, polygons
from dapple.structure.returns import kinds_by_place

RNG = np.random.default_rng(8)
XYZ = RNG.uniform([-3, -2, 0], [3, 2, 2], (60_000, 3))
LEAF = RNG.random(len(XYZ)) < 0.6
CLOUD = Cloud(
    XYZ,
    np.array([5e5, 5e6, 100.0]),
    {
        "Reflectance": RNG.normal(-8, 3, len(XYZ)).astype(np.float32),
        "PointSourceId": RNG.integers(1, 4, len(XYZ)).astype(np.uint16),
    },
)


def thinned():
    cloud = thin(CLOUD, 0.1, np.arange(0, len(XYZ), 2))
    return [cloud.xyz_m, *cloud.attributes.values()]


def reconstructed():
    mesh = polygons.reconstruct(XYZ, voxel_size_m=0.1, seed=1)
    return [mesh.vertices_m, mesh.faces, mesh.element]


def told_by_place():
    rng = np.random.default_rng(9)
    n = 500
    way = np.tile([1.0, 0.0, 0.0], (n, 1))
    start = np.column_stack([np.full(n, -4.0), rng.uniform(-2, 2, n), rng.uniform(0, 2, n)])
    unknown = np.full(n, np.nan, np.float32)
    scan, range_m = np.ones(n, np.uint16), np.linspace(0.5, 7.5, n)
    shots = Shots(start, way, scan, np.arange(n + 1), range_m, unknown, unknown, np.zeros(3))
    return [kinds_by_place(XYZ, np.where(LEAF, 4, 0), voxel_size_m=0.1)(shots)]


@pytest.mark.parametrize(
    "work",
    [thinned, lambda: [majority(XYZ, LEAF, 0.1)], reconstructed, told_by_place],
    ids=["thinning", "majority", "polygons", "returns"],
)
def test_slabs_give_the_bytes_of_the_whole(monkeypatch, work):
    whole = [part.tobytes() for part in work()]
    for most in (1, 7_000, 40_000):
        monkeypatch.setattr(voxel_groups, "MOST_POINTS", most)
        assert [part.tobytes() for part in work()] == whole


def test_a_slab_holds_whole_columns_of_voxels_and_about_as_many_points_as_it_may(monkeypatch):
    monkeypatch.setattr(voxel_groups, "MOST_POINTS", 7_000)
    columns = voxel_groups.cells(XYZ[:, 0], 0.1)
    slabs = list(voxel_groups.slabs(columns))
    assert np.array_equal(np.sort(np.concatenate(slabs)), np.arange(len(XYZ)))
    assert max(map(len, slabs)) < 1.4 * 7_000
    ends = [(columns[slab].min(), columns[slab].max()) for slab in slabs]
    assert all(before[1] < after[0] for before, after in itertools.pairwise(ends))


def peak(work):
    tracemalloc.start()
    work()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return most


def areas():
    return polygon_sizes.bracket(XYZ, voxel_size_m=0.1, seed=1)


def test_memory_does_not_grow_with_the_cloud_but_with_a_slab(monkeypatch):
    areas()  # compiled
    whole = peak(areas)
    monkeypatch.setattr(voxel_groups, "MOST_POINTS", len(XYZ) // 20)
    assert peak(areas) < 0.4 * whole


def test_meshes_are_put_together_and_measured_without_a_second_one_in_memory(monkeypatch, tmp_path):
    part = polygons.reconstruct(XYZ[:20_000], voxel_size_m=0.1, seed=1)
    size = 20 * sum(one.nbytes for one in (part.vertices_m, part.faces, part.element))
    for module in (meshes, ply):
        monkeypatch.setattr(module, "PIECE", 1_000)

    parts = [part] * 20
    whole = meshes.concatenate(parts)
    assert not parts  # each went when it had been copied
    assert whole.n_elements == 20 * part.n_elements
    assert whole.area_m2 == pytest.approx(20 * part.area_m2)
    assert peak(lambda: whole.area_m2) < 0.5 * size
    assert peak(lambda: meshes.write_ply(tmp_path / "whole.ply", whole)) < 0.1 * size


def test_a_large_file_is_written_in_pieces_of_the_same_bytes(monkeypatch, tmp_path):
    for suffix in (".laz", ".las"):
        clouds.write(tmp_path / f"whole{suffix}", CLOUD)
        monkeypatch.setattr(cloud_las, "CHUNK", 7_777)
        clouds.write(tmp_path / f"pieces{suffix}", CLOUD)
        monkeypatch.undo()
        whole, pieces = (tmp_path / f"{name}{suffix}" for name in ("whole", "pieces"))
        assert pieces.read_bytes() == whole.read_bytes()
        assert np.array_equal(clouds.read(pieces).xyz_m, clouds.read(whole).xyz_m)


def test_no_range_is_told_of_extra_bytes_rather_than_a_wrong_one(tmp_path):
    clouds.write(tmp_path / "a.laz", CLOUD)
    with laspy.open(tmp_path / "a.laz") as file:
        described = file.header.vlrs.get("ExtraBytesVlr")[0].extra_bytes_structs
    assert [(one.min, one.max) for one in described] == [(None, None)]


def test_areas_and_heights_are_looked_up_in_pieces_alike(monkeypatch):
    mesh = polygons.reconstruct(XYZ[:5_000], voxel_size_m=0.1, seed=1)
    node = np.linspace(-3, 3, 13)
    ground = GroundSurface(node, node, np.add.outer(0.1 * node, 0.3 * node))
    normals, heights = mesh.triangle_normal, ground.height_m(XYZ[:, :2])
    monkeypatch.setattr(meshes, "PIECE", 999)
    monkeypatch.setattr(ground_surface, "PIECE", 999)
    again = meshes.Mesh(mesh.vertices_m, mesh.faces, mesh.element)
    assert np.array_equal(again.triangle_normal, normals)
    assert np.array_equal(ground.height_m(XYZ[:, :2]), heights)


def test_points_at_one_place_are_that_place_s_first_point():
    xyz = np.array([[1.0, 2, 3], [0, 0, 0], [1, 2, 3], [-0.0, 0, 0], [3, 2, 1], [1, 2, 3]])
    assert selection.first_at_place(xyz).tolist() == [0, 1, 0, 1, 4, 0]
    assert selection.duplicates(xyz).tolist() == [False, False, True, True, False, True]
    assert selection.first_at_place(XYZ).tolist() == list(range(len(XYZ)))
