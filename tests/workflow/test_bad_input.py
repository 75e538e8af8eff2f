"""Bad input ends a run with one message that helps, and leaves no target half-written."""

import importlib.util
from types import SimpleNamespace

import laspy
import numpy as np
import pandas as pd
import pytest
import xarray as xr
import yaml

from dapple.code_use import SCRIPTS
from dapple.errors import InputError
from dapple.formats import clouds, json, meshes
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh

CLOUD = {
    "experiment": "mine",
    "source": "cloud",
    "data_dir": ".",
    "reconstructions": ["polygons"],
    "sensors": {"kind": "none"},
    "measured": {"kind": "none"},
    "clean": {"outlier_backend": "none"},
}
FIRST_STEP = "results/mine/scan/points.laz"


def some_cloud(**attributes):
    rng = np.random.default_rng(5)
    return Cloud(rng.uniform(0.5, 2.0, (3000, 3)), np.zeros(3), attributes)


def reflectance():
    return {"Reflectance": np.full(3000, -8.0, np.float32)}


def stopped(project, config, target=FIRST_STEP):
    """What dapple says when a run with this configuration stops."""
    (project.folder / "mine.yaml").write_text(yaml.safe_dump(CLOUD | config))
    project.configfile, project.experiment = "mine.yaml", "mine"
    done = project.snakemake(target)
    assert done.returncode != 0
    assert not [path for path in project.result("").rglob("*.laz") if path.is_file()]
    assert not list(project.folder.rglob(".partial-*"))
    said = [line for line in done.stdout.splitlines() if line.strip().startswith("dapple: ")]
    assert said, done.stdout[-4000:]
    return said[0].strip(), done.stdout


# A whole run


def test_a_file_that_is_missing_is_named_before_anything_runs(project):
    said, output = stopped(project, {"cloud": {"path": "tree.laz"}})
    assert "tree.laz: found no such file" in said
    assert "data_dir" in said
    assert "Traceback" not in output


def test_an_unknown_key_is_named_with_the_nearest_and_the_file(project):
    said, output = stopped(project, {"poligons": {"voxel_size_m": 0.05}})
    assert "mine.yaml" in said
    assert "unknown key `poligons`" in said
    assert said.endswith("Did you mean `polygons`?")
    assert "Traceback" not in output


def test_density_without_misses_says_so_and_not_that_an_input_is_missing(project):
    clouds.write(project.folder / "tree.laz", some_cloud(**reflectance()))
    config = {"cloud": {"path": "tree.laz"}, "reconstructions": ["voxels_0.2"]}
    said, output = stopped(project, config, "results/mine/structure/voxels_0.2/voxels.nc")
    assert "no shot that met nothing" in said
    assert "no denominator" in said
    assert "MissingInputException" not in output


def test_a_truncated_scan_stops_the_run_at_its_first_step(project):
    path = project.folder / "tree.laz"
    clouds.write(path, some_cloud(**reflectance()))
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    said, output = stopped(project, {"cloud": {"path": "tree.laz"}})
    assert "tree.laz: found" in said
    # The log, which Snakemake shows, has the traceback; what the user reads last is the message.
    assert "Error in rule ingest" in output


# Single steps, with the script that a rule runs


def script(name):
    """A rule's script as a module; `import` would find the standard library's `statistics`."""
    spec = importlib.util.spec_from_file_location(f"script_{name}", SCRIPTS / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def rule(tmp_path, inputs, outputs, params, config=None):
    """What Snakemake would hand to a script."""
    return SimpleNamespace(
        input=SimpleNamespace(**{key: _text(value) for key, value in inputs.items()}),
        output=SimpleNamespace(**{key: str(tmp_path / name) for key, name in outputs.items()}),
        params=SimpleNamespace(**params),
        config=config,
    )


def _text(value):
    return [str(one) for one in value] if isinstance(value, list) else str(value)


def ingest(tmp_path, path, required=("Reflectance",)):
    params = {"shots": "none", "scan_frame": {}, "required": list(required)}
    params |= {"unit": "auto", "up": "z"}
    outputs = {"points": "points.laz", "frame": "frame.json"}
    method = "reflectance" if required else "geometry"
    config = {"source": "cloud", "cloud": {"path": str(path)}, "reconstructions": ["polygons"]}
    config |= {"classify": {"method": method}, "measured": {"kind": "none"}}
    job = rule(tmp_path, {"cloud": path, "positions": ""}, outputs, params, config)
    script("ingest").main(job)
    return clouds.read(job.output.points)


def refused(tmp_path, path):
    with pytest.raises(InputError) as error:
        ingest(tmp_path, path)
    assert str(path) in str(error.value)
    assert error.value.remedy
    assert not (tmp_path / "points.laz").exists()
    return str(error.value)


def test_a_cloud_without_reflectance_names_the_file_what_it_has_and_what_else_would_do(tmp_path):
    path = tmp_path / "tree.laz"
    clouds.write(path, some_cloud(Deviation=np.ones(3000, np.float32)))
    message = refused(tmp_path, path)
    assert "no attribute 'Reflectance' (there are: Deviation)" in message
    assert "classify:\n  method: geometry" in message
    assert len(ingest(tmp_path, path, required=())) == 3000


def test_an_empty_file_is_refused(tmp_path):
    (tmp_path / "tree.laz").touch()
    assert "0 bytes" in refused(tmp_path, tmp_path / "tree.laz")


def test_a_scan_without_points_is_refused(tmp_path):
    path = tmp_path / "tree.las"
    laspy.LasData(laspy.LasHeader(version="1.4", point_format=6)).write(path)
    assert "0 points" in refused(tmp_path, path)


def test_coordinates_that_are_no_numbers_are_refused(tmp_path):
    path = tmp_path / "tree.txt"
    rows = ["X Y Z Reflectance", "1 2 3 -8", "1 nan 3 -8", "1 2 4 -8"]
    path.write_text("\n".join(rows))
    assert "1 points with coordinates that are no numbers" in refused(tmp_path, path)


def test_world_coordinates_without_an_offset_keep_their_tenths_of_millimetres(tmp_path):
    path = tmp_path / "tree.txt"
    world_m = some_cloud().xyz_m + np.array([410_500.0, 5_317_080.0, 280.0])
    rows = [" ".join(f"{value:.4f}" for value in point) + " -8" for point in world_m]
    path.write_text("\n".join(["X Y Z Reflectance", *rows]))
    cloud = ingest(tmp_path, path, required=())
    assert np.abs(cloud.xyz_m[:, :2]).max() < 100
    assert cloud.world_xyz_m == pytest.approx(world_m, abs=1e-4)


LEAF = Mesh(
    np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 1.0], [1.0, 1.0, 1.0]]),
    np.array([[0, 1, 2]], np.int32),
    np.zeros(1, np.int32),
)
SENSORS = {
    "kind": "table",
    "table": {"heights": "world"},
    "grid": {},
    "ground_z_m": 0.0,
    "origin_m": [0.0, 0.0, 0.0],
}


@pytest.mark.parametrize(
    ("position", "found"),
    [
        ("500.0, 0.5, 0.1", r"3_7.* m outside the scene"),
        ("0.7, 0.5, 1.0005", r"3_7 0\.5 mm from leaf, in effect inside it"),
        ("0.5, 0.5, -1.0", r"3_7 1\.000 m below the ground"),
    ],
)
def test_a_sensor_where_none_can_be_is_named_with_its_table(tmp_path, position, found):
    table = tmp_path / "sensors.csv"
    table.write_text(f"label,X,Y,Z\n3_7,{position}\n")
    for name in ("leaves.ply", "wood.ply"):
        meshes.write_ply(tmp_path / name, LEAF)
    placed = rule(
        tmp_path,
        {"table": table, "frame": "", "wood": "", "ground": ""},
        {"sensors": "local.csv"},
        SENSORS,
    )
    traced = rule(
        tmp_path,
        {name: tmp_path / f"{name}.ply" for name in ("leaves", "wood")}
        | {"sensors": placed.output.sensors, "ground": "", "shade": ""},
        {"transport": "transport.nc"},
        {"ground_z_m": 0.0, "sensor_table": str(table)},
    )

    def place_and_trace():
        script("sensors").main(placed)
        script("transport").main(traced)

    with pytest.raises(InputError, match=found) as error:
        place_and_trace()
    assert str(table) in str(error.value)
    assert not (tmp_path / "transport.nc").exists()


SKY = {
    "site": {"latitude_deg": 48.0, "longitude_deg": 7.8, "altitude_m": 230.0},
    "radiation": {
        "kind": "table",
        "time_column": "time",
        "global_column": "global_W_m2",
        "diffuse_column": "diffuse_W_m2",
        "timezone": None,
        "max_gap_min": 60.0,
        "linke_turbidity": 3.0,
    },
    "time": {
        "start": "2023-08-10 11:00",
        "end": "2023-08-10 12:00",
        "step_min": 60,
        "timezone": "UTC",
    },
}


@pytest.mark.parametrize(
    ("timezone", "found"),
    [(None, "naive"), ("Europe/Freiburg", "unknown time zone 'Europe/Freiburg'")],
)
def test_radiation_at_naive_times_is_refused_and_the_zone_has_to_exist(tmp_path, timezone, found):
    table = tmp_path / "radiation.csv"
    rows = [f"2023-08-10 {hour}:00,700,100" for hour in (10, 11, 12, 13)]
    table.write_text("\n".join(["time,global_W_m2,diffuse_W_m2", *rows]))
    inputs = {"radiation": table, "registration": ""}
    radiation = SKY["radiation"] | {"timezone": timezone}
    params = SKY | {"radiation": radiation, "atmosphere": {"model": "isotropic"}}
    with pytest.raises(InputError, match=found) as error:
        script("sky").main(rule(tmp_path, inputs, {"sky": "sky.nc"}, params))
    assert str(table) in str(error.value)
    assert not (tmp_path / "sky.nc").exists()


# What looks like bad input and is none


@pytest.mark.whole
def test_at_night_there_is_no_light_and_no_error(small_run, tmp_path):
    project = small_run.clone(tmp_path / "night")
    night = "time={start: 2023-08-10 22:30, end: 2023-08-10 23:30}"
    project.run(config=[night, "reconstructions=[polygons, truth]"])
    with xr.open_dataset(project.result("light/polygons.nc")) as light:
        light.load()
    assert list(light["time"].dt.hour) == [22, 23]
    for part in ("par", "par_direct", "par_sky", "par_scattered", "standard_error"):
        assert (light[f"{part}_umol_m2_s"] == 0).all()
    overall = pd.read_csv(project.result("statistics/overall.csv"))
    assert overall["r"].isna().all()  # nothing varies: unknown, not 0


@pytest.mark.whole
def test_ones_own_cloud_in_utm_gives_the_polygons_of_the_same_scan(small_run, tmp_path):
    """The scan as text in world coordinates that float32 cannot hold, and ten lines of YAML."""
    project = small_run.clone(tmp_path / "own")
    scan = clouds.read(small_run.result("scan/points.laz"))
    moved_m = scan.world_xyz_m + np.array([410_500.0, 5_317_080.0, 0.0])
    columns = dict(zip("XYZ", moved_m.T, strict=True)) | {
        name: scan.attributes[name] for name in ("Reflectance", "Deviation")
    }
    pd.DataFrame(columns).to_csv(project.folder / "tree.csv", index=False, float_format="%.4f")
    own = CLOUD | {"experiment": "own", "cloud": {"path": "tree.csv"}, "clean": {}}
    (project.folder / "own.yaml").write_text(yaml.safe_dump(own))
    project.configfile, project.experiment = "own.yaml", "own"
    project.run("results/own/structure/polygons/summary.json")
    expected = json.read(small_run.result("structure/polygons/summary.json"))
    found = json.read(project.result("structure/polygons/summary.json"))
    # Coordinates are rounded on the way, so that a few points change their voxel.
    for name in ("n_elements", "leaf_area_m2", "n_wood_elements", "wood_area_m2"):
        assert found[name] == pytest.approx(expected[name], rel=0.03), name
