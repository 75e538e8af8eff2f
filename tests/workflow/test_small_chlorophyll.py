"""The chlorophyll experiment in small: from a virtual forest to a map of leaf chlorophyll."""

import json
import shutil
from importlib.util import find_spec

import geopandas
import numpy as np
import pandas as pd
import pytest
import rasterio
import yaml
from rasterio.enums import ColorInterp
from rasterio.warp import calculate_default_transform, reproject
from tests.workflow.project import Project, copy_of_project

from dapple.formats import rasters, vectors

pytestmark = pytest.mark.whole
COLUMNS = {
    "accuracy.csv": "plot model mask test_set n r2 rmse rrmse",
    "speed.csv": "method combinations seconds peak_rss_mb rmse_vs_direct max_vs_direct",
}
MODELS = ["collision_orders", "prosail", "semi_less"]


@pytest.fixture(scope="module")
def chlorophyll(tmp_path_factory):
    project = copy_of_project(
        tmp_path_factory.mktemp("chlorophyll") / "dapple",
        configfile="config/chlorophyll-small.yaml",
        experiment="chlorophyll-small",
    )
    project.run()
    return project


@pytest.mark.parametrize("name", sorted(COLUMNS))
def test_tables_have_the_columns_that_others_rely_on(chlorophyll, name):
    table = pd.read_csv(chlorophyll.result(f"chlorophyll/{name}"))
    assert set(COLUMNS[name].split()) <= set(table.columns)
    assert len(table)


def test_every_model_and_mask_is_held_against_simulated_pixels_and_field_trees(chlorophyll):
    table = pd.read_csv(chlorophyll.result("chlorophyll/accuracy.csv"))
    assert sorted(table["model"].unique()) == MODELS
    assert sorted(table["mask"].unique()) == ["all", "sunlit"]
    assert {"entries", "field"} <= set(table["test_set"])
    assert table[["rmse", "rrmse"]].notna().all(axis=None)


def test_the_map_lies_where_the_images_do_and_follows_the_true_leaves(chlorophyll):
    """Cells of 3 m against the chlorophyll of the crowns in them, weighted by area.

    Cells are told apart; their mean is 7 µg cm⁻² too low, because the retrieval expects denser
    shoots than those of this world.
    """
    mapped = rasters.read(chlorophyll.result("chlorophyll/map.tif"))
    seen = rasters.read(chlorophyll.result("plots/larch/world/images.tif"))
    assert mapped.crs == seen.crs
    assert mapped.left_m == pytest.approx(seen.left_m)
    assert mapped.top_m == pytest.approx(seen.top_m)
    y, x = (axis.ravel() for axis in np.meshgrid(*mapped.centres_m(), indexing="ij"))
    cells = geopandas.GeoSeries(geopandas.points_from_xy(x, y)).buffer(1.5, cap_style="square")
    crowns = geopandas.read_file(chlorophyll.result("plots/larch/world/crowns.geojson"))
    area = np.array([crowns.intersection(cell).area for cell in cells])
    with np.errstate(invalid="ignore"):
        true = area @ crowns["lcc_ug_cm2"].to_numpy() / area.sum(axis=1)
    found = mapped.values[0].ravel()
    known = np.isfinite(found) & np.isfinite(true)
    assert known.sum() >= 10
    assert np.corrcoef(found[known], true[known])[0, 1] > 0.4
    assert abs(np.mean(found[known] - true[known])) < 11


def test_collision_orders_meet_direct_renders_within_the_noise_of_both(chlorophyll):
    speed = pd.read_csv(chlorophyll.result("chlorophyll/speed.csv")).set_index("method")
    assert speed.loc["collision_orders", "rmse_vs_direct"] < 0.005


def test_all_figures_are_drawn(chlorophyll):
    for name in ("map", "field", "simulated", "spectra", "losses"):
        assert chlorophyll.result(f"chlorophyll/larch_{name}.png").stat().st_size > 5_000


@pytest.mark.long
@pytest.mark.skipif(find_spec("less") is None, reason="less3d 3.0.0 is not installed")
def test_the_same_world_seen_by_less_gives_the_same_map(chlorophyll, tmp_path):
    other = chlorophyll.clone(tmp_path / "dapple")
    path = "chlorophyll/map.tif"
    target = other.result(path).relative_to(other.folder)
    other.run(target, config=["chlorophyll={world: {renderer: less}}"])
    one, two = (rasters.read(project.result(path)).values[0] for project in (chlorophyll, other))
    assert not np.array_equal(one, two, equal_nan=True)
    known = np.isfinite(one) & np.isfinite(two)
    assert known.sum() >= 10
    assert np.corrcoef(one[known], two[known])[0, 1] > 0.95
    assert np.abs(one[known] - two[known]).mean() < 2.0


# --- a plot of one's own --------------------------------------------------------------------------

FLIGHT = "2024-06-21 11:30"
OWN = {
    "experiment": "own",
    "study": "chlorophyll",
    "data_dir": "own_data",
    "chlorophyll": {
        "plots": ["user"],
        "user": {"lidar": "flight.laz", "images": "mosaic.tif", "scale": 10_000, "time": FLIGHT,
                 "timezone": "Europe/Berlin", "crowns": "trees.gpkg"},
        "images": {"least_paths": 100_000, "paths_per_pixel": 16},
        "retrieval": {"models": ["collision_orders"], "masks": ["all"], "networks": ["robust"],
                      "combinations": 40, "seeds": [1], "max_epochs": 5},
    },
}  # fmt: skip


def as_users_have_it(project, folder):
    """The virtual plot's cloud, and its images and crowns in other systems, scales and names."""
    folder.mkdir()
    (folder / "flight.laz").symlink_to(project.result("plots/larch/world/lidar.laz"))
    crowns = geopandas.read_file(project.result("plots/larch/world/crowns.geojson"))
    crowns = crowns.rename(columns={"lcc_ug_cm2": "chl"}).to_crs("EPSG:3857")
    crowns.loc[0, "chl"] = np.nan
    crowns.to_file(folder / "trees.gpkg")
    with rasterio.open(project.result("plots/larch/world/images.tif")) as seen:
        values, grid, crs, bounds = seen.read(), seen.transform, seen.crs, seen.bounds
    values = np.concatenate([1e4 * values, np.full((1, *values.shape[1:]), 65_535)])
    to, width, height = calculate_default_transform(
        crs, "EPSG:4326", values.shape[2], values.shape[1], *bounds
    )
    turned = np.zeros((6, height, width), np.uint16)
    reproject(values.clip(0, 65_535).astype(np.uint16), turned, src_transform=grid, src_crs=crs,
              dst_transform=to, dst_crs="EPSG:4326")  # fmt: skip
    order = [4, 2, 1, 3, 0, 5]
    shape = {"count": 6, "width": width, "height": height}
    with rasterio.open(
        folder / "mosaic.tif", "w", dtype="uint16", crs="EPSG:4326", transform=to, **shape
    ) as file:
        file.write(turned[order])
        file.descriptions = ["NIR", "Red", "Green", "Red edge", "Blue", ""]
        file.colorinterp = [ColorInterp.gray] * 5 + [ColorInterp.alpha]


@pytest.fixture(scope="module")
def own_plot(chlorophyll):
    """The chain on files of one's own, with measured chlorophyll of all trees but one."""
    as_users_have_it(chlorophyll, chlorophyll.folder / "own_data")
    (chlorophyll.folder / "own.yaml").write_text(yaml.safe_dump(OWN))
    project = Project(chlorophyll.folder, "own.yaml", experiment="own")
    project.run(*own_targets(project))
    return project


def own_targets(project):
    wanted = ("chlorophyll/user_report.html", "chlorophyll/accuracy.csv", "chlorophyll/map.tif")
    return [*(project.result(path).relative_to(project.folder) for path in wanted)]


def test_own_images_of_any_system_scale_and_order_are_those_that_the_camera_saw(
    chlorophyll, own_plot
):
    there = rasters.read(chlorophyll.result("plots/larch/world/images.tif"))
    read = rasters.read(own_plot.result("plots/user/input/images.tif"))
    assert (read.bands, read.crs) == (there.bands, there.crs)
    wanted, found = (np.nanmean(raster.values, axis=(1, 2)) for raster in (there, read))
    assert found == pytest.approx(wanted, rel=0.02)
    cells = [
        rasters.read(project.result(f"plots/{plot}/retrieval/observed_all.tif")).values[4]
        for project, plot in ((chlorophyll, "larch"), (own_plot, "user"))
    ]
    assert np.nanmean(cells[1]) == pytest.approx(np.nanmean(cells[0]), rel=0.05)


def test_the_sun_is_that_of_the_flight_over_the_images(own_plot):
    sun = json.loads(own_plot.result("plots/user/light/sun.json").read_text())
    # 48.06 N, 10.5 E, two hours before noon by the sun: 09:30 UTC on the longest day.
    assert sun["sun_zenith_deg"] == pytest.approx(33.0, abs=1.5)
    assert sun["sun_azimuth_deg"] == pytest.approx(132.0, abs=4.0)


def test_own_crowns_of_another_system_keep_their_place_and_what_was_measured(chlorophyll, own_plot):
    there = vectors.read(chlorophyll.result("plots/larch/world/crowns.geojson"))
    read = vectors.read(own_plot.result("plots/user/input/crowns.geojson"))
    for one, other in zip(there.outlines(), read.outlines(), strict=True):
        assert one == pytest.approx(other, abs=0.01)
    assert np.isnan(read.lcc_ug_cm2[0])
    assert read.lcc_ug_cm2[1:] == pytest.approx(there.lcc_ug_cm2[1:])


def test_the_map_has_intervals_lies_in_the_cloud_s_system_and_is_held_against_measured_trees(
    own_plot,
):
    mapped = rasters.read(own_plot.result("chlorophyll/map.tif"))
    assert mapped.crs == "EPSG:25832"
    lcc, low, high = mapped.values[:3]
    known = np.isfinite(lcc)
    assert known.sum() >= 10
    assert ((low <= lcc) & (lcc <= high))[known].all()
    scores = pd.read_csv(own_plot.result("chlorophyll/accuracy.csv"))
    measured = scores[(scores["test_set"] == "field") & (scores["seed"] == "ensemble")]
    trees = pd.read_csv(own_plot.result("plots/user/retrieval/trees_collision_orders.csv"))
    seen = trees["covered_share"] > 0
    assert measured["n"].item() == (seen & trees["truth_ug_cm2"].notna()).sum()
    assert trees["predicted_ug_cm2"][seen].notna().all()


def test_a_page_tells_what_was_read_and_how_far_to_trust_the_map(own_plot):
    page = own_plot.result("chlorophyll/user_report.html").read_text()
    for text in ("by colour", "EPSG:25832", "2024-06-21 09:30 UTC", "values are extrapolated",
                 "warped to EPSG:25832", "data:image/png"):  # fmt: skip
        assert text in page


def test_without_crowns_the_map_and_its_page_are_made_and_nothing_is_held_against_trees(own_plot):
    own = OWN | {"experiment": "bare"}
    own["chlorophyll"] = own["chlorophyll"] | {"user": own["chlorophyll"]["user"] | {"crowns": ""}}
    (own_plot.folder / "bare.yaml").write_text(yaml.safe_dump(own))
    shutil.copytree(own_plot.result(""), own_plot.folder / "results/bare")
    for done in (own_plot.folder / "results/bare").rglob("accuracy*.csv"):
        done.unlink()
    bare = Project(own_plot.folder, "bare.yaml", experiment="bare")
    bare.run(*own_targets(bare))
    assert "field" not in set(pd.read_csv(bare.result("chlorophyll/accuracy.csv"))["test_set"])
    assert "No measured tree" in bare.result("chlorophyll/user_report.html").read_text()
