"""The whole chain in a small virtual world: what it leaves behind, and what an edit reruns."""

import json
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rasterio
import xarray as xr
import yaml
from plotly.offline import get_plotlyjs
from tests.workflow.project import copy_of_project, jobs

from dapple.config.settings import validate

RECONSTRUCTIONS = ["polygons", "surfels", "voxels_0.2", "voxels_1.0", "truth"]
N_SENSORS, N_TIMES = 6, 6
LEAF_AREA_M2 = {
    "polygons": 1.77,
    "surfels": 5.49,
    "voxels_0.2": 4.25,
    "voxels_1.0": 3.46,
    "truth": 5.0,
}
RMSE_UMOL_M2_S = {
    "polygons": 316,
    "surfels": 124,
    "voxels_0.2": 272,
    "voxels_1.0": 328,
    "truth": 28,
}
"""What the run makes today, of a tree of 5 m² in a coarse scan: a change of more than a tenth is to
be explained, and written down here."""
LIGHT = ("par", "par_direct", "par_sky", "par_scattered", "standard_error")
COLUMNS = {
    "statistics/overall.csv": "reconstruction n r r_low r_high rmse bias mae baseline_r",
    "statistics/per_sensor.csv": "reconstruction sensor n r rmse bias",
    "statistics/agreement.csv": "reconstruction n rmse_rel bias_rel max_abs_z",
    "runtime.csv": "step reconstruction wall_s cpu_s peak_rss_mb",
}
CHEAP = [
    "structure/truth/leaves_0.ply",
    "structure/truth/wood.ply",
    "scan/points.laz",
    "scan/shots.parquet",
    "clean/cloud.laz",
    "clean/clean.json",
    "classes/cloud.laz",
    "classes/scores.json",
    "structure/polygons/leaves_0.ply",
    "structure/polygons/wood.ply",
    "structure/polygons/summary.json",
    "structure/surfels/leaves_0.ply",
    "structure/surfels/summary.json",
    "structure/voxels_0.2/voxels.nc",
    "structure/voxels_0.2/voxels.vox",
    "structure/voxels_0.2/summary.json",
]


# What it leaves behind


@pytest.mark.parametrize("path", sorted(COLUMNS))
def test_tables_have_the_columns_that_others_rely_on(small_run, path):
    table = pd.read_csv(small_run.result(path))
    expected = COLUMNS[path].split()
    assert list(table.columns)[: len(expected)] == expected
    assert len(table)


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_light_of_every_reconstruction_covers_all_sensors_and_times(small_run, name):
    with xr.open_dataset(small_run.result(f"light/{name}.nc")) as light:
        light.load()
    assert dict(light.sizes) == {"sensor": N_SENSORS, "time": N_TIMES}
    for part in LIGHT:
        values = light[f"{part}_umol_m2_s"]
        assert values.dims == ("sensor", "time")
        assert values.attrs["units"]
        assert values.attrs["long_name"]
        assert np.isfinite(values).all()
        assert (values >= 0).all()
    parts = sum(light[f"par_{part}_umol_m2_s"] for part in ("direct", "sky", "scattered"))
    np.testing.assert_allclose(parts, light["par_umol_m2_s"], rtol=1e-5)


def test_netcdf_keeps_to_the_cf_conventions(small_run, tmp_path):
    files = [*small_run.result("light").glob("*.nc")]
    files += small_run.result("structure").glob("voxels_*/voxels.nc")
    files += small_run.result("light/reference").glob("*.nc")
    checker = Path(sys.executable).with_name("compliance-checker")
    found = tmp_path / "found.json"
    command = [checker, "--test=cf:1.11", "--criteria=strict", "--format=json_new", "-o", found]
    subprocess.run([*command, *files], capture_output=True)
    reports = json.loads(found.read_text())
    wrong = {
        Path(name).name: priority["msgs"]
        for name, report in reports.items()
        for level in ("high_priorities", "medium_priorities")
        for priority in report["cf:1.11"][level]
        if priority["msgs"]
    }
    assert len(reports) == len(files)
    assert not wrong


def test_maps_for_other_programs_are_the_maps_of_the_run(small_run):
    with xr.open_dataset(small_run.result("light/ground_map.nc")) as maps:
        maps.load()
    for path, name in (("ground_map.tif", "par_umol_m2_s"), ("ground_sum.tif", "par_sum_mol_m2_d")):
        with rasterio.open(small_run.result(f"light/{path}")) as file:
            values = file.read()
            assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
            assert file.bounds.left < 0 < file.bounds.right  # around the stem at the site
            assert file.crs.is_projected
        expected = np.atleast_3d(maps[name].to_numpy().T).T[:, ::-1]
        np.testing.assert_allclose(values, expected, rtol=1e-6)


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_the_timesteps_of_all_batches_are_joined_in_their_order(small_run, name):
    files = sorted(small_run.result(f"light/timesteps/{name}").glob("*.nc"))
    assert [file.name for file in files] == ["0.nc", "1.nc"]
    with xr.open_dataset(small_run.result(f"light/reference/{name}.nc")) as joined:
        assert joined.sizes["time"] == N_TIMES
        assert joined.indexes["time"].is_monotonic_increasing


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_summaries_tell_areas_beside_the_true_one(small_run, name):
    facts = json.loads(small_run.result(f"structure/{name}/summary.json").read_text())
    assert {"leaf_area_m2", "wood_area_m2", "n_elements", "volume_m3"} <= facts.keys()
    assert facts["true_leaf_area_m2"] == pytest.approx(5.0, rel=0.01)
    assert facts["leaf_area_m2"] == pytest.approx(LEAF_AREA_M2[name], rel=0.1)


def test_leaf_and_wood_are_scored_against_the_truth(small_run):
    scores = json.loads(small_run.result("classes/scores.json").read_text())["scores"]
    flat = json.dumps(scores).lower()
    assert all(word in flat for word in ("precision", "recall", "f1", "kappa"))


def test_the_truth_agrees_with_records_made_from_it_and_no_reconstruction_beats_it(small_run):
    overall = pd.read_csv(small_run.result("statistics/overall.csv"), index_col="reconstruction")
    assert list(overall.index) == RECONSTRUCTIONS
    assert overall["r"].idxmax() == "truth"
    assert overall["rmse"].to_dict() == pytest.approx(RMSE_UMOL_M2_S, rel=0.1)
    assert (overall["n"] == N_SENSORS * N_TIMES).all()
    # A tree that stands in the light explains more of it than a sky without one.
    assert (overall["r"] > overall["baseline_r"]).all()


def test_records_of_the_virtual_sensors_err_as_the_sensor_model_says(small_run):
    """By 2 % and 2 µmol m⁻² s⁻¹ around the light under the true tree, each on its own."""
    records = pd.read_csv(small_run.result("statistics/records.csv"))
    own = records[records["reconstruction"] == "truth"]
    z = (own["measured"] - own["simulated"]) / np.hypot(0.02 * own["simulated"], 2.0)
    assert z.mean() == pytest.approx(0, abs=4 / np.sqrt(len(z)))
    assert z.std() == pytest.approx(1, abs=4 / np.sqrt(2 * len(z)))


def test_nearly_all_records_lie_between_the_bounds_that_are_stated(small_run):
    records = pd.read_csv(small_run.result("statistics/records.csv"))
    inside = records["measured"].between(records["low"], records["high"])
    by_tree = inside.groupby(records["reconstruction"]).mean()
    assert by_tree["truth"] == pytest.approx(0.9, abs=4 * np.sqrt(0.09 / (N_SENSORS * N_TIMES)))
    assert (by_tree > 0.75).all()


@pytest.mark.parametrize("name", RECONSTRUCTIONS)
def test_two_independent_engines_agree_on_the_light(small_run, name):
    agreement = pd.read_csv(small_run.result("statistics/agreement.csv"), index_col=0)
    row = agreement.loc[name]
    assert row["n"] == N_SENSORS * N_TIMES
    assert abs(row["bias_rel"]) < 0.02
    assert row["max_abs_z"] < 6


def test_every_job_leaves_a_log_and_a_benchmark(small_run):
    logs, benchmarks = (
        {str(path.relative_to(folder).with_suffix("")) for path in folder.rglob(f"*{suffix}")}
        for folder, suffix in (
            (small_run.result("logs"), ".log"),
            (small_run.result("benchmarks"), ".tsv"),
        )
    )
    assert logs == benchmarks
    assert {"scan", "voxels_0.2", "light_truth", "page"} <= logs
    cost = pd.read_csv(small_run.result("runtime.csv")).fillna({"reconstruction": ""})
    steps = set(zip(cost["step"], cost["reconstruction"], strict=True))
    assert {("scan", ""), ("voxels", "voxels_0.2"), ("transport", "truth")} <= steps


def test_the_merged_configuration_stands_beside_the_results(small_run):
    written = yaml.safe_load(small_run.result("config.yaml").read_text())
    asked = yaml.safe_load((small_run.folder / small_run.configfile).read_text())
    assert written["plant"]["height_m"] == asked["plant"]["height_m"]
    settings = validate(written)
    assert settings.model_dump(mode="json") == written


def test_the_page_needs_no_other_file_and_no_network(small_run):
    page = small_run.result("report.html").read_text()
    assert len(page) < 15_000_000
    # The library of charts has addresses in it that it never asks for here.
    ours = page.replace(get_plotlyjs(), "")
    sources = re.findall(r"""(?:src|href)\s*=\s*["']?([^"'\s>]+)|url\(([^)]+)\)""", ours)
    files = [one for one, _ in sources if not one.startswith("#")]
    assert len(files) == 6  # the figures, and that there is no icon
    assert all(one.startswith("data:") for one in files)
    assert "http" not in re.sub(r"base64,[A-Za-z0-9+/=]+", "", ours)


def test_the_page_has_the_tree_the_ground_the_sensors_and_when_light_is_off(small_run):
    page = small_run.result("report.html").read_text()
    charts = re.findall(r'<figure class="chart" id="([\w-]+)"', page)
    assert charts == ["tree", "ground", "sensors", "residuals-hour", "residuals-height"]


def test_no_half_written_file_is_left(small_run):
    assert not list(small_run.result("").rglob(".partial-*"))


# What is run again


def test_a_second_run_has_nothing_to_do(small_run):
    assert small_run.planned() == set()


def test_a_run_in_a_folder_that_moved_has_nothing_to_do(small_run, tmp_path):
    assert small_run.clone(tmp_path / "moved").planned() == set()


def test_a_parameter_of_voxels_reruns_the_light_in_voxels_alone(small_run):
    output = small_run.run("--dry-run", config=["voxels={estimator: ppl}"])
    assert set(re.findall(r"light series, (\S+),", output)) == {"voxels_0.2", "voxels_1.0"}


def test_a_fault_of_the_per_timestep_engine_reaches_the_agreement(small_run, tmp_path):
    project = small_run.clone(tmp_path / "halved")
    engine = project.folder / "scripts/dapple/light/timestep.py"
    beam = "return (radiance * weight).mean(axis=2)"
    assert engine.read_text().count(beam) == 1
    engine.write_text(engine.read_text().replace(beam, f"{beam} / 2"))
    target = project.result("statistics/agreement.csv").relative_to(project.folder)
    project.run(target, config=["reconstructions=[polygons, voxels_1.0]"])
    agreement = pd.read_csv(project.result("statistics/agreement.csv"), index_col=0)
    assert list(agreement.index) == ["polygons", "voxels_1.0"]
    assert (agreement["bias_rel"] > 0.02).all()


def test_light_in_tiles_is_that_of_the_whole_scene_within_its_error(small_run, tmp_path):
    project = small_run.clone(tmp_path / "tiles")
    target = project.result("light/truth.nc").relative_to(project.folder)
    done = project.run(target, config=["light={tiles: {size_m: 1, lowest_sun_deg: 40}}"])
    assert jobs(done) >= {"transport", "light"}
    assert "tiles of 1 m" in project.result("logs/transport/truth/0.log").read_text()
    whole, tiled = (xr.load_dataset(run.result("light/truth.nc")) for run in (small_run, project))
    assert list(whole["sensor"].values) == list(tiled["sensor"].values)
    difference = np.abs(tiled["par_umol_m2_s"] - whole["par_umol_m2_s"])
    assert (difference <= 4 * whole["standard_error_umol_m2_s"] + 1e-6).all()


# The same bytes


def test_cores_locale_zone_umask_home_and_path_change_no_byte(small_run, tmp_path):
    project = copy_of_project(tmp_path / "a b/ü/dapple")
    (tmp_path / "at home").mkdir()
    other = {"LC_ALL": "C", "TZ": "Pacific/Auckland", "HOME": str(tmp_path / "at home")}
    project.run(
        *(f"results/{project.experiment}/{path}" for path in CHEAP),
        cores=1,
        environment=other | {"PYTHONHASHSEED": "7"},
        umask=0o077,
    )
    different = [
        path
        for path in CHEAP
        if project.result(path).read_bytes() != small_run.result(path).read_bytes()
    ]
    assert not different
