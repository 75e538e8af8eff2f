"""Virtual leaves along wood: targets are met, and leaves sit where wood carries them."""

import numpy as np
import pytest
from scipy.spatial import cKDTree

from dapple.errors import EmptyCloudError, InputError
from dapple.formats.meshes import Mesh
from dapple.virtual.leaf_shapes import draw_normals, fans
from dapple.virtual.leaves import along_wood

SMALL = {"leaf_area_m2": 2.0, "n_elements": 2000, "crown_base_m": 1.0, "height_m": 2.2}


def patches(centres_m, side_m) -> Mesh:
    """Upright square wood polygons of one size."""
    corners = np.array([[0, -0.5, -0.5], [0, 0.5, -0.5], [0, 0.5, 0.5], [0, -0.5, 0.5]]) * side_m
    vertices = (np.asarray(centres_m)[:, None] + corners).reshape(-1, 3)
    first = 4 * np.arange(len(centres_m))[:, None, None]
    faces = (first + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    return Mesh(vertices, faces.astype(np.int32), np.repeat(np.arange(len(centres_m)), 2))


@pytest.fixture(scope="module")
def wood():
    """A stem of 2 m and a level branch of thin wood at its top."""
    stem = np.column_stack([np.zeros((40, 2)), np.linspace(0.02, 2, 40)])
    branch = np.column_stack([np.linspace(0.1, 1.5, 40), np.zeros(40), np.full(40, 2.0)])
    stem, branch = patches(stem, 0.05), patches(branch, 0.02)
    return Mesh(
        np.concatenate([stem.vertices_m, branch.vertices_m]),
        np.concatenate([stem.faces, branch.faces + len(stem.vertices_m)]),
        np.concatenate([stem.element, branch.element + stem.n_elements]),
    )


@pytest.fixture(scope="module")
def leaves(wood):
    return along_wood(wood, **SMALL, seed=3)


def voxels_with_leaves(leaves, size_m):
    return len(np.unique(np.floor(leaves.element_centre_m / size_m), axis=0))


def test_area_and_number_of_polygons_are_as_asked(leaves):
    assert leaves.area_m2 == pytest.approx(2.0, rel=1e-9)
    assert leaves.n_elements == 2000
    assert leaves.element_area_m2.min() > 0


def test_every_polygon_has_a_voxel_of_its_own(leaves):
    assert voxels_with_leaves(leaves, 0.05) == 2000


def test_the_small_share_are_hexagons_a_third_of_the_voxel_wide(leaves):
    hexagon_m2 = 1.5 * np.sqrt(3) * (0.05 / 6) ** 2
    small = np.isclose(leaves.element_area_m2, hexagon_m2, rtol=1e-6)
    assert small.sum() == round(2000 * 40_190 / 147_098)
    assert (np.bincount(leaves.element)[small] == 4).all()


def test_polygons_are_flat_and_convex(leaves):
    normal = leaves.triangle_normal / np.linalg.norm(leaves.triangle_normal, axis=1)[:, None]
    alignment = (normal * leaves.element_normal[leaves.element]).sum(1)
    assert alignment.min() > 1 - 1e-6


def test_leaves_stay_between_crown_base_and_height_and_near_wood(wood, leaves):
    centre = leaves.element_centre_m
    assert centre[:, 2].min() > 1.0 + wood.vertices_m[:, 2].min() - 1e-9
    assert centre[:, 2].max() < 2.2 + wood.vertices_m[:, 2].min()
    distance, _ = cKDTree(wood.element_centre_m).query(centre)
    # a polygon moves towards the middle of its voxel, at most half a diagonal
    assert distance.max() < 0.3 + 0.05 * np.sqrt(3) / 2


def test_thick_wood_carries_fewer_leaves_than_thin_wood(wood):
    def share_on_stem(thin_wood_m2):
        # so few polygons that no place fills up
        sparse = SMALL | {"n_elements": 400, "leaves_per_shoot": 20}
        placements = [
            along_wood(wood, **sparse, thin_wood_m2=thin_wood_m2, seed=seed) for seed in range(8)
        ]
        # the branch is at 2 m, and shoots are at most 0.3 m long
        return np.mean([(p.element_centre_m[:, 2] < 1.65).mean() for p in placements])

    assert share_on_stem(0.001) < 0.5 * share_on_stem(1.0)


def test_a_seed_gives_the_same_bytes_and_another_seed_another_placement(wood, leaves):
    again, other = along_wood(wood, **SMALL, seed=3), along_wood(wood, **SMALL, seed=4)
    assert again.vertices_m.tobytes() == leaves.vertices_m.tobytes()
    assert again.faces.tobytes() == leaves.faces.tobytes()
    same = np.isin(*(np.round(m.element_centre_m[:, 0], 6) for m in (leaves, other)))
    assert same.mean() < 0.05


def test_more_leaves_on_a_shoot_leave_larger_gaps(wood):
    few, many = (
        np.mean(
            [
                voxels_with_leaves(along_wood(wood, **SMALL, leaves_per_shoot=n, seed=seed), 0.2)
                for seed in range(3)
            ]
        )
        for n in (30, 1000)
    )
    assert many < few


def test_spherical_polygons_show_half_their_area_from_any_side(leaves):
    assert np.abs(leaves.element_normal).mean(0) == pytest.approx([0.5] * 3, abs=0.03)


def test_no_wood_is_an_error_that_says_so():
    nothing = Mesh(np.empty((0, 3)), np.empty((0, 3), np.int32), np.empty(0, np.int32))
    with pytest.raises(EmptyCloudError, match="wood: found no polygon"):
        along_wood(nothing, seed=1)


def test_more_polygons_than_there_is_room_for_is_an_error(wood):
    with pytest.raises(InputError, match=r"leaves\.n_elements: found 147098 polygons"):
        along_wood(wood, crown_base_m=1.0, height_m=2.2, max_distance_m=0.1, seed=1)


def test_wood_below_the_crown_alone_is_an_error(wood):
    with pytest.raises(InputError, match="Lower the crown base"):
        along_wood(wood, **(SMALL | {"crown_base_m": 3.0, "height_m": 4.0}), seed=1)


def test_less_area_than_the_hexagons_alone_have_is_an_error(wood):
    with pytest.raises(InputError, match=r"leaves\.leaf_area_m2: found 0\.01 m²"):
        along_wood(wood, **(SMALL | {"leaf_area_m2": 0.01}), seed=1)


@pytest.mark.parametrize(
    ("distribution", "mean_cosine"),
    # integrals of cos(angle) times de Wit's densities
    [("spherical", 1 / 2), ("uniform", 2 / np.pi), ("planophile", 8 / (3 * np.pi)),
     ("erectophile", 4 / (3 * np.pi))],
)  # fmt: skip
def test_normals_follow_the_leaf_angle_distribution(distribution, mean_cosine):
    normals = draw_normals(100_000, distribution, np.random.default_rng(5))
    assert np.linalg.norm(normals, axis=1) == pytest.approx(1, abs=1e-9)
    assert normals[:, 2].mean() == pytest.approx(mean_cosine, abs=0.005)
    assert normals[:, :2].mean(0) == pytest.approx([0, 0], abs=0.01)


def test_a_fan_has_its_area_centre_and_normal():
    rng = np.random.default_rng(2)
    centre, normal = rng.normal(size=(50, 3)), draw_normals(50, "spherical", rng)
    area, corners = rng.uniform(1e-4, 2e-3, 50), rng.integers(3, 9, 50)
    mesh = fans(centre, normal, area, corners, rng.uniform(0.5, 0.9, 50), rng)
    assert mesh.element_area_m2 == pytest.approx(area, rel=1e-9)
    assert mesh.element_centre_m == pytest.approx(centre, abs=1e-9)
    assert mesh.element_normal == pytest.approx(normal, abs=1e-6)
    assert np.bincount(mesh.element).tolist() == (corners - 2).tolist()
