"""Real trees and scans through the chain, at reduced cost; skipped where the data is absent."""

import json

import laspy
import numpy as np
import pytest
import rasterio
import xarray as xr
import yaml
from rasterio.enums import ColorInterp
from rasterio.transform import from_origin
from scipy import ndimage
from tests.workflow.project import ROOT, copy_of_project

pytestmark = pytest.mark.whole
DATA = (ROOT / "../shared/data").resolve()
THREE_TIMES = (
    "time={start: 2023-08-10 11:00, end: 2023-08-10 15:00, step_min: 120}",
    "sensors={columns: 4, rows: 3, spacing_m: 2.0}",
    "light={check: false, timestep: {replicates: 4, step_min: 120}, transport: {tolerance: 0.02}}",
    "figures={map_spacing_m: 1.0}",
)


def project_on_real_data(folder, experiment, needs, overrides=()):
    """A copy of the project that reads the real data where it lies."""
    if not (DATA / needs).is_file():
        pytest.skip(f"no real data: {DATA / needs} is absent")
    return copy_of_project(
        folder / "dapple",
        f"config/{experiment}.yaml",
        (f"data_dir={DATA}", *overrides),
        experiment,
    )


def summary(project, reconstruction):
    return json.loads(project.result(f"structure/{reconstruction}/summary.json").read_text())


@pytest.fixture(scope="session")
def leafy_tree(tmp_path_factory):
    """A real leaf-on tree without reflectance: polygons, and light at a few sensors."""
    folder = tmp_path_factory.mktemp("leafy-tree")
    project = project_on_real_data(folder, "leafy-tree", "leafy-tree/pc_tree.txt", THREE_TIMES)
    project.run()
    return project


@pytest.fixture(scope="session")
def single_scan(tmp_path_factory):
    """A real scan whose misses are rebuilt: plant area density."""
    folder = tmp_path_factory.mktemp("single-scan")
    project = project_on_real_data(folder, "single-scan", "single-scan/TLS_scan.laz")
    project.run()
    return project


def test_a_real_tree_gets_leaf_and_wood_of_a_tree_s_size(leafy_tree):
    facts = summary(leafy_tree, "polygons")
    assert facts["n_elements"] > 1000
    assert 10 < facts["leaf_area_m2"] < 1000
    assert 0 < facts["wood_area_m2"] < facts["leaf_area_m2"]


def test_under_a_real_tree_it_is_darker_than_in_the_open_and_nowhere_dark(leafy_tree):
    with xr.open_dataset(leafy_tree.result("light/polygons.nc")) as light:
        par = light["par_umol_m2_s"].load()
    with xr.open_dataset(leafy_tree.result("sky/sky.nc")) as sky:
        sky.load()
    cosine = np.cos(np.radians(sky["sun_zenith_deg"])).to_numpy()
    beam = sky["beam_normal_umol_m2_s"].sum("band").to_numpy() * cosine
    open_sky = beam + sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy()
    assert dict(par.sizes) == {"sensor": 12, "time": 3}
    share = par.mean("sensor").to_numpy() / open_sky
    assert (share < 0.9).all()
    assert (share > 0.05).all()
    assert float(par.min()) > 0
    # Leaves scatter, but no sensor gets much more than the open sky.
    assert (par.max("sensor").to_numpy() < 1.3 * open_sky).all()


def test_a_real_tree_is_told_in_pictures_without_a_comparison(leafy_tree):
    made = {path.name for path in leafy_tree.result("figures").glob("*.png")}
    assert {"tree.png", "series.png", "ground_map.png"} <= made
    assert not leafy_tree.result("statistics/overall.csv").exists()


def density(project, name):
    """Plant area density as a series over the lower corner of 1 m voxels, unknown ones left out."""
    with xr.open_dataset(project.result(f"structure/{name}/voxels.nc")) as voxels:
        known = voxels["plant_area_density_m2_m3"].to_series().dropna().rename("pad")
    metre = np.floor(np.array(known.index.to_list()) + 1e-9).astype(int)
    return known.groupby([metre[:, 0], metre[:, 1], metre[:, 2]])


@pytest.mark.parametrize("name", ["voxels_0.2", "voxels_1.0"])
def test_a_real_scan_gets_the_density_of_a_forest(single_scan, name):
    facts = summary(single_scan, name)
    assert 0.95 * 2082 * 580 < facts["total_shots"] <= 2082 * 580
    assert 0 < facts["total_misses"] < facts["total_shots"]
    assert 0.1 < facts["mean_pad_m2_m3"] < 5
    assert facts["n_unknown"] > 0  # behind others: unknown, not empty
    values = density(single_scan, name).mean()
    assert values.min() == 0  # seen through, and no leaf was hit
    assert values.max() <= 5


def test_small_and_large_voxels_agree_where_every_small_one_is_known(single_scan):
    fine = density(single_scan, "voxels_0.2").agg(["mean", "size"])
    fine = fine[fine["size"] == 5**3]["mean"].rename("fine")
    both = fine.to_frame().join(density(single_scan, "voxels_1.0").mean().rename("coarse")).dropna()
    assert len(both) > 100
    assert both["fine"].sum() == pytest.approx(both["coarse"].sum(), rel=0.3)
    assert both.corr().loc["fine", "coarse"] > 0.9


def test_the_published_tree_can_be_planned_from_its_own_records(tmp_path):
    project = project_on_real_data(tmp_path, "apple", "apple/bark.obj")
    planned = project.planned()
    assert {"real_wood", "virtual_leaves", "registration", "voxels", "light"} <= planned
    assert {"record_statistics", "page"} <= planned
    assert not {"plant", "ingest"} & planned


def images_over(lidar, path, pixel_m=0.25):
    """Five bands and alpha above a cloud: bright crowns, dark soil, shade to the north."""
    x, y, z = np.array(laspy.read(lidar).xyz).T
    left, upper = x.min(), y.max()
    column, row = ((x - left) / pixel_m).astype(int), ((upper - y) / pixel_m).astype(int)
    rows, columns = row.max() + 1, column.max() + 1
    top = np.full((rows, columns), z.min())
    np.maximum.at(top, (row, column), z)
    height = top - ndimage.minimum_filter(top, 41)
    shaded = height < np.roll(height, -6, axis=0) - 3.0  # the sun stands in the south
    noise = np.random.default_rng(1).lognormal(0.0, 0.1, height.shape)
    crown = {"Blue": 0.02, "Green": 0.06, "Red": 0.03, "Red edge": 0.16, "NIR": 0.32}
    soil = {"Blue": 0.06, "Green": 0.10, "Red": 0.14, "Red edge": 0.18, "NIR": 0.24}
    light = noise * np.where(shaded, 0.3, 1.0)
    bands = [np.where(height > 2.0, crown[name], soil[name]) * light for name in crown]
    values = np.stack([*(1e4 * band for band in bands), np.full(height.shape, 65_535)])
    with rasterio.open(
        path, "w", dtype="uint16", crs="EPSG:26912", count=6, width=columns, height=rows,
        transform=from_origin(left, upper, pixel_m, pixel_m),
    ) as file:  # fmt: skip
        file.write(values.clip(0, 65_535).astype(np.uint16))
        file.descriptions = [*crown, ""]
        file.colorinterp = [ColorInterp.gray] * 5 + [ColorInterp.alpha]


@pytest.fixture(scope="session")
def real_flight(tmp_path_factory):
    """A real UAV LiDAR cloud of ponderosa pines with images made for it; no crowns are known."""
    if not (lidar := DATA / "airborne/UAS_Clip.laz").is_file():
        pytest.skip(f"no real data: {lidar} is absent")
    folder = tmp_path_factory.mktemp("flight")
    images_over(lidar, folder / "mosaic.tif")
    (folder / "flight.laz").symlink_to(lidar)
    chosen = {
        "plots": ["user"],
        "user": {"lidar": "flight.laz", "images": "mosaic.tif", "scale": 10_000,
                 "time": "2023-06-21 12:00", "timezone": "America/Phoenix"},
        "images": {"least_paths": 100_000, "paths_per_pixel": 16},
        "retrieval": {"models": ["collision_orders"], "masks": ["all"], "networks": ["robust"],
                      "combinations": 40, "seeds": [1], "max_epochs": 5},
    }  # fmt: skip
    settings = {"experiment": "flight", "study": "chlorophyll", "data_dir": str(folder)}
    (folder / "flight.yaml").write_text(yaml.safe_dump(settings | {"chlorophyll": chosen}))
    project = copy_of_project(folder / "dapple", folder / "flight.yaml", experiment="flight")
    wanted = ("chlorophyll/user_report.html", "chlorophyll/map.tif")
    project.run(*(project.result(path).relative_to(project.folder) for path in wanted))
    return project


def test_a_real_flight_gets_a_map_with_intervals_in_its_own_system_and_a_page(real_flight):
    with rasterio.open(real_flight.result("chlorophyll/map.tif")) as found:
        names, values = list(found.descriptions), found.read(masked=True)
        assert found.crs.is_projected
        assert found.bounds.left == pytest.approx(470_627, abs=5)
        assert found.bounds.top == pytest.approx(3_810_248, abs=5)
    assert len(names) >= 3
    chlorophyll = values[0].compressed()
    assert len(chlorophyll) > 10
    assert 1.0 < chlorophyll.min() <= chlorophyll.max() < 150.0
    page = real_flight.result("chlorophyll/user_report.html").read_text()
    assert "No measured tree" in page
