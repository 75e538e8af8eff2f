"""Ground, heights and the coordinate system of airborne clouds."""

import laspy
import numpy as np
import pyproj
import pytest

from dapple.cloud import ground
from dapple.errors import EmptyCloudError, InputError
from dapple.formats import cloud_crs, clouds
from dapple.formats.clouds import Cloud

CLOTH = {"cloth_m": 0.5, "rigidness": 2, "threshold_m": 0.3}
MODEL = {"pixel_m": 0.5, "cell_m": 0.2, "crs": "EPSG:25832", "where": "points", **CLOTH}


def hill(xy):
    return 0.15 * xy[:, 0] + 0.8 * np.sin(xy[:, 1] / 4)


def forest(seed=1):
    """A slope with waves under four round crowns; world coordinates."""
    rng = np.random.default_rng(seed)
    xy = rng.uniform(0, 20, (60_000, 2))
    floor = np.column_stack([xy, hill(xy) + rng.normal(0, 0.02, len(xy))])
    under = np.zeros(len(xy), bool)
    crowns = []
    for place in np.array([[5, 5], [5, 15], [15, 5], [14, 14]]):
        shell = rng.normal(size=(4000, 3))
        shell *= 2.5 / np.linalg.norm(shell, axis=1, keepdims=True)
        crowns.append(shell + np.array([*place, hill(place[None])[0] + 7]))
        under |= np.hypot(*(xy - place).T) < 2.5
    seen = ~under | (rng.random(len(xy)) < 0.1)
    points = np.concatenate([floor[seen], *crowns])
    return points + np.array([500_000, 5_300_000, 600])


def test_the_ground_is_found_under_crowns_on_a_slope():
    world = forest()
    dem, _ = ground.model(world, **MODEL)
    y, x = dem.centres_m()
    xy = np.stack(np.meshgrid(x - 500_000, y - 5_300_000), axis=-1).reshape(-1, 2)
    error = dem.values[0].ravel() - 600 - hill(xy)
    assert np.sqrt((error**2).mean()) < 0.05
    assert np.isfinite(dem.values).all()


def test_heights_are_above_the_ground_and_not_above_the_sea():
    world = forest()
    dem, chosen = ground.model(world, **MODEL)
    height = ground.heights(world, dem)
    assert np.abs(height[chosen]).max() <= 0.35
    assert height.max() == pytest.approx(9.5, abs=0.15)


def test_a_canopy_without_ground_is_refused():
    rng = np.random.default_rng(2)
    cone = rng.uniform(-1, 1, (20_000, 3)) * [8, 8, 1]
    cone[:, 2] = 3 * np.hypot(cone[:, 0], cone[:, 1]) + rng.random(len(cone)) * 2
    with pytest.raises(InputError, match=r"ground under .* a cloud that reaches the ground"):
        ground.cloth(cone, **CLOTH)


def test_no_points_are_refused():
    with pytest.raises(EmptyCloudError):
        ground.cloth(np.zeros((0, 3)), **CLOTH)


def test_a_bird_and_an_echo_from_below_are_noise_and_leaves_are_not():
    world = np.concatenate([forest(), [[500_010, 5_300_010, 650], [500_010, 5_300_010, 580]]])
    noise = ground.isolated(world - [500_000, 5_300_000, 600], cell_m=2.0, most_points=5)
    assert noise[-2:].all()
    assert not noise[:-2].any()


def test_noise_classes_go_and_nothing_but_noise_is_an_error():
    xyz = forest()[:1000] - [500_000, 5_300_000, 600]
    classes = np.where(np.arange(1000) < 300, 7, 1)
    kept = ground.without_noise(
        Cloud(xyz, attributes={"Classification": classes}), "f", cell_m=50.0, most_points=5
    )
    assert len(kept) == 700
    with pytest.raises(EmptyCloudError, match="noise alone"):
        ground.without_noise(
            Cloud(xyz, attributes={"Classification": np.full(1000, 18)}), "f", cell_m=50.0,
            most_points=5,
        )  # fmt: skip


def test_the_lowest_point_of_each_column_is_kept():
    xyz = np.array([[0.1, 0.1, 3.0], [0.1, 0.15, 1.0], [0.9, 0.1, 2.0]])
    assert ground.lowest(xyz, cell_m=0.5).tolist() == [1, 2]


def test_the_canopy_model_has_the_tops_fills_small_gaps_and_leaves_large_ones():
    world = np.array([[0.25, 0.25, 1.0], [0.3, 0.3, 4.0], [1.25, 0.25, 2.0], [9.75, 0.25, 5.0]])
    dem = ground.elevation(world * [1, 1, 0], world[:, :2], pixel_m=0.5, crs="EPSG:25832")
    chm = ground.canopy_height(world[:, :2], world[:, 2], dem, pixel_m=0.5, reach_m=1.0)
    row = chm.values[0, 0]
    assert row[0] == 4.0
    assert row[1] in (4.0, 2.0)
    assert np.isnan(row[8])
    assert row[-1] == 5.0


def test_points_on_the_edge_of_a_pixel_lie_in_the_grid():
    world = np.array([[0.0, 0.0], [21.0, 21.0], [10.5, 3.0]])
    left, top, rows, columns = ground.grid_of(world, 0.25)
    row, column = np.floor((top - world[:, 1]) / 0.25), np.floor((world[:, 0] - left) / 0.25)
    assert row.min() >= 0
    assert row.max() == rows - 1
    assert column.max() == columns - 1


def las(path, crs=None):
    header = laspy.LasHeader(point_format=6, version="1.4")
    header.global_encoding.wkt = True
    if crs:
        header.add_crs(pyproj.CRS(crs))
    data = laspy.LasData(header)
    data.x, data.y, data.z = np.arange(3.0), np.arange(3.0), np.arange(3.0)
    data.write(str(path))
    return path


def test_the_horizontal_part_of_a_compound_system_counts(tmp_path):
    assert cloud_crs.horizontal(las(tmp_path / "a.laz", "EPSG:25832+7837")) == "EPSG:25832"


def test_a_cloud_without_a_system_takes_the_declared_one_or_says_so(tmp_path):
    path = las(tmp_path / "a.laz")
    assert cloud_crs.horizontal(path, "EPSG:25832") == "EPSG:25832"
    with pytest.raises(InputError, match=r"no coordinate system.*chlorophyll\.crowns\.crs"):
        cloud_crs.horizontal(path)


@pytest.mark.parametrize(
    ("crs", "message"),
    [
        ("EPSG:2992", "in foot.*expected coordinates in metres.*pdal translate"),
        ("EPSG:25832+6360", "height in US survey foot"),
        ("EPSG:4326", "a projected system in metres"),
    ],
)
def test_feet_and_degrees_are_refused(tmp_path, crs, message):
    with pytest.raises(InputError, match=f"(?s){message}"):
        cloud_crs.horizontal(las(tmp_path / "a.laz", crs))


def test_a_declared_system_that_differs_is_refused(tmp_path):
    path = las(tmp_path / "a.laz", "EPSG:25832")
    assert cloud_crs.horizontal(path, "EPSG:25832") == "EPSG:25832"
    with pytest.raises(InputError, match="EPSG:25833"):
        cloud_crs.horizontal(path, "EPSG:25833")


def test_a_text_file_called_laz_is_named_as_text(tmp_path):
    (tmp_path / "a.laz").write_text("x y z")
    with pytest.raises(InputError, match=r"text .*first bytes are not LASF"):
        cloud_crs.horizontal(tmp_path / "a.laz")


def test_an_empty_cloud_is_an_error(tmp_path):
    clouds.write(tmp_path / "a.laz", Cloud(np.zeros((0, 3))))
    with pytest.raises(EmptyCloudError):
        clouds.read(tmp_path / "a.laz")
