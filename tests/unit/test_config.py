"""The configuration: one typed source, and mistakes that are told with their remedy."""

import inspect
import json
from datetime import UTC, datetime

import jsonschema
import numpy as np
import pytest
import yaml

from dapple.config import checks, docs, inferred, study_checks
from dapple.config.settings import Settings, validate
from dapple.errors import InputError, MissingMissesError

FILES = sorted(docs.CONFIG.glob("*.yaml"))
REAL_CLOUD = {
    "source": "cloud",
    "cloud": {"path": "tree.laz"},
    "reconstructions": ["polygons"],
    "measured": {"kind": "none"},
}


def merged(below, above):
    """Two configurations as Snakemake merges them: sections key by key, all else as a whole."""
    both = dict(below)
    for key, value in above.items():
        inside = isinstance(value, dict) and isinstance(both.get(key), dict)
        both[key] = merged(both[key], value) if inside else value
    return both


@pytest.mark.parametrize("name", sorted(docs.pages()))
def test_what_is_made_from_the_typed_configuration_is_in_step_with_it(name):
    written = (docs.CONFIG / name).read_text()
    assert written == docs.pages()[name], f"config/{name} is stale: run `{docs.MEND}`"


def test_the_default_file_says_what_the_types_say():
    default = yaml.safe_load((docs.CONFIG / "config.yaml").read_text())
    assert validate(default) == validate({})


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_configuration_is_valid_on_top_of_the_default(path):
    default = yaml.safe_load((docs.CONFIG / "config.yaml").read_text())
    settings = validate(merged(default, yaml.safe_load(path.read_text())), path.name)
    expected = "virtual-apple" if path.stem == "config" else path.stem
    assert settings.experiment == expected


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_editors_find_the_schema_of_every_configuration_and_nothing_wrong_with_it(path):
    text = path.read_text()
    assert text.splitlines()[0] == docs.SCHEMA
    jsonschema.validate(yaml.safe_load(text), json.loads((docs.CONFIG / "schema.json").read_text()))


def test_every_key_has_a_meaning_and_the_schema_refuses_others():
    schema = json.loads(docs.schema())
    for section in (schema, *schema["$defs"].values()):
        assert section["additionalProperties"] is False
        for name, key in section["properties"].items():
            assert key.get("description") or "$ref" in key, name


@pytest.mark.parametrize(
    ("config", "unknown", "meant"),
    [
        ({"sed": 3}, "sed", "seed"),
        ({"polygon": {}}, "polygon", "polygons"),
        ({"polygons": {"voxel_size": 0.1}}, "polygons.voxel_size", "polygons.voxel_size_m"),
        ({"linke_turbidity": 4}, "linke_turbidity", "radiation.linke_turbidity"),
        (
            {"optics": {"leaf": {"chlorophyl_ug_cm2": 40}}},
            "optics.leaf.chlorophyl_ug_cm2",
            "optics.leaf.chlorophyll_ug_cm2",
        ),
    ],
)
def test_an_unknown_key_is_answered_with_the_nearest_valid_one(config, unknown, meant):
    with pytest.raises(InputError) as error:
        validate(config, "mine.yaml")
    assert "mine.yaml" in str(error.value)
    assert f"unknown key `{unknown}`" in str(error.value)
    assert error.value.remedy == f"Did you mean `{meant}`?"


def test_a_key_like_no_other_is_answered_with_those_that_exist():
    with pytest.raises(InputError, match="Known keys: n_bootstrap, confidence"):
        validate({"statistics": {"zzz": 1}})


def test_an_unknown_key_is_told_before_a_wrong_value():
    with pytest.raises(InputError, match=r"unknown key `plant\.hight_m`"):
        validate({"seed": -1, "plant": {"hight_m": 3.0}})


@pytest.mark.parametrize(
    ("config", "found", "expected"),
    [
        ({"polygons": {"voxel_size_m": 0}}, "`polygons.voxel_size_m: 0`", "greater than 0"),
        (
            {"scan": {"angular_step_deg": 5}},
            "`scan.angular_step_deg: 5`",
            "less than or equal to 2",
        ),
        ({"site": {"latitude_deg": 100}}, "`site.latitude_deg: 100`", "less than or equal to 90"),
        ({"study": "lidar"}, "`study: 'lidar'`", "'light', 'survey', 'chlorophyll' or 'stability'"),
        ({"seed": -1}, "`seed: -1`", "greater than or equal to 0"),
        ({"registration": {"fit_share": 1.2}}, "`registration.fit_share: 1.2`", "less than"),
        ({"light": {"variant": "gpu"}}, "`light.variant: 'gpu'`", "'llvm' or 'cuda'"),
        ({"voxels": {"min_shots": "many"}}, "`voxels.min_shots: 'many'`", "valid integer"),
        ({"sensors": {"rows": 2.5}}, "`sensors.rows: 2.5`", "integer"),
        ({"sensors": 3}, "`sensors: 3`", "dictionary"),
        ({"experiment": "My Tree"}, "`experiment: 'My Tree'`", "pattern"),
        ({"optics": {"bark": {"reflectance": [0.1, 1.5]}}}, "1.5", "less than or equal to 1"),
    ],
)
def test_a_value_of_another_type_or_range_is_named_with_what_was_expected(config, found, expected):
    with pytest.raises(InputError) as error:
        validate(config, "mine.yaml")
    assert found in error.value.found
    assert expected in error.value.expected
    assert error.value.remedy


def test_a_label_that_yaml_takes_for_a_number_asks_for_quotes():
    with pytest.raises(InputError, match="in quotes"):
        validate(yaml.safe_load("figures: {sensors: [3_7]}"))


REAL_WOOD = {"source": "wood", "measured": {"kind": "none"}, "reconstructions": ["polygons"]}
UNKNOWN_SHOTS = REAL_CLOUD | {"cloud": {"path": "tree.laz", "shots": "none"}}
CONTRADICTIONS = {
    "tree": [
        (REAL_CLOUD | {"tree": {"id": 1, "at": [0.0, 0.0]}}, "tree.id: 1"),
        ({"tree": {"id": 1}}, "source: virtual"),
    ],
    "reconstructions": [
        ({"reconstructions": ["voxels_0.3"]}, "voxels_0.3"),
        ({"reconstructions": ["polygons", "truth", "polygons"]}, "polygons"),
        (REAL_CLOUD | {"reconstructions": ["truth"]}, "truth"),
    ],
    "paths": [
        (REAL_CLOUD | {"cloud": {}}, "cloud.path"),
        (REAL_WOOD, "wood_path"),
        ({"radiation": {"kind": "table"}}, "radiation.path"),
        ({"sensors": {"kind": "table"}}, "sensors.path"),
        ({"measured": {"kind": "table"}}, "measured.path"),
    ],
    "misses": [
        (REAL_CLOUD | {"cloud": {"path": "tree.laz", "shots": "recorded"}}, "tree.laz"),
        (UNKNOWN_SHOTS | {"reconstructions": ["voxels_0.2"]}, "voxels_0.2"),
        (REAL_CLOUD | {"cloud": {"path": "tree.laz", "shots": "positions"}}, "scan_positions"),
    ],
    "corrections": [
        (UNKNOWN_SHOTS | {"corrections": {"clumping": True}}, "corrections.clumping"),
        (
            REAL_WOOD | {"wood_path": "bark.obj", "corrections": {"occlusion": True}},
            "corrections.occlusion",
        ),
    ],
    "measured": [(REAL_CLOUD | {"measured": {"kind": "virtual"}}, "measured.kind: virtual")],
    "registration": [
        ({"registration": {"fit": True}}, "sensors.kind: grid"),
        ({"registration": {"gain": "site"}}, "registration.fit: false"),
    ],
    "times": [
        ({"time": {"end": "2023-08-10 09:00"}}, "09:00"),
        (
            {"time": {"start": "2023-10-29 02:30", "timezone": "Europe/Berlin"}},
            "daylight saving",
        ),
        ({"site": {"timezone": "Europe/Berln"}}, "Europe/Berln"),
    ],
    "spectra": [
        ({"optics": {"bark": {"wavelength_nm": [400.0, 500.0, 700.0]}}}, "3 wavelengths"),
    ],
    "light": [
        ({"light": {"engine": "timestep", "model": "advised"}}, "light.model: advised"),
        ({"light": {"engine": "timestep", "tiles": {"size_m": 20}}}, "light.tiles.size_m: 20"),
    ],
    "sensors": [
        ({"sensors": {"tilt_deg": 30}}, "no `sensors.azimuth_deg`"),
        (
            {"study": "stability", "sensors": {"tilt_deg": 30, "azimuth_deg": 180}},
            "`sensors.tilt_deg: 30`",
        ),
    ],
    "voxels": [
        (
            {"voxels": {"estimator": "contact_frequency", "contact_voxel_m": 0}},
            "voxels.contact_voxel_m: 0",
        ),
    ],
    "plant": [
        ({"plant": {"crown_base_m": 6.5}}, "6.5 m in a tree of 6.6 m"),
        ({"plant": {"leaf_length_min_m": 0.09}}, "leaf_length_max_m 0.08"),
    ],
    "figures": [({"figures": {"sensors": ["3_7", "9_1"]}}, "9_1")],
    "survey": [
        ({"survey": {"leaf_area_index": [1.0]}}, "survey.leaf_area_index"),
        ({"survey": {"stands": ["fagus", "quercus"]}}, "quercus"),
        ({"survey": {"trees_m": [[16.0, 1.0]]}}, "[[16.0, 1.0]]"),
        ({"survey": {"volume_m": [15.0, 15.0, 20.0]}}, "a height of 20 m"),
        ({"survey": {"voxel_size_m": 0.35}}, "0.35 m in a box"),
        ({"survey": {"cell_size_m": 0.25}}, "0.25 m"),
        ({"survey": {"designs": ["diamond"]}}, "diamond"),
        ({"survey": {"candidates": 2, "plan_scans": 5}}, "survey.plan_scans: 5"),
    ],
    "survey_beams": [
        ({"survey": {"density_step_deg": 0.3}}, "survey.density_step_deg"),
        ({"survey": {"azimuth_steps_deg": [0.5, 0.3]}}, "[0.5, 0.3]"),
        ({"survey": {"designs": ["single", "star"]}}, "star"),
        ({"survey": {"designs": ["single", "list"]}}, "no position"),
        (
            {"survey": {"designs": ["single", "list"], "positions_m": [[16.0, 1.0]]}},
            "outside the volume",
        ),
    ],
    "chlorophyll": [
        ({"chlorophyll": {"images": {"pixel_m": 21.0}}}, "chlorophyll.images.pixel_m: 21"),
        ({"chlorophyll": {"larch": {"dbh_m": 4.0}}}, "chlorophyll.larch.dbh_m: 4"),
        ({"chlorophyll": {"retrieval": {"n": [2.5, 1.0, 4]}}}, "chlorophyll.retrieval.n"),
        (
            {"chlorophyll": {"world": {"lcc_range_ug_cm2": [70.0, 10.0]}}},
            "chlorophyll.world.lcc_range_ug_cm2",
        ),
    ],
    "own_plot": [
        ({"chlorophyll": {"plots": ["user"]}}, "no `chlorophyll.user.lidar`"),
        (
            {"chlorophyll": {"plots": ["user"], "user": {"lidar": "a.laz", "images": "a.tif"}}},
            "without the sun",
        ),
    ],
    "stability": [({"stability": {"stressors": ["wnd"]}}, "stability.stressors: wnd")],
}


@pytest.mark.parametrize(
    ("config", "found"), [case for cases in CONTRADICTIONS.values() for case in cases]
)
def test_values_that_contradict_each_other_are_named_together(config, found):
    with pytest.raises(InputError) as error:
        validate(config, "mine.yaml")
    assert found in error.value.found
    assert error.value.remedy


CHECKS = {one.__name__: one for one in checks.CHECKS}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_it_is_the_check_of_that_name_that_finds_them(name):
    for config, found in CONTRADICTIONS[name]:
        settings = inferred.resolved(Settings.model_validate(config))
        with pytest.raises(InputError) as error:
            CHECKS[name](settings, "mine.yaml")
        assert found in error.value.found


def test_every_check_is_called_and_has_a_case_that_it_finds():
    written = [
        name
        for module in (checks, study_checks)
        for name, one in inspect.getmembers(module, inspect.isfunction)
        if one.__module__ == module.__name__ and one is not checks.check
    ]
    assert sorted(CHECKS) == sorted(written)
    assert sorted(CONTRADICTIONS) == sorted(written)


@pytest.mark.parametrize(
    "key",
    [
        "reconstructions",
        "voxels.sizes_m",
        "survey.stands",
        "chlorophyll.plots",
        "chlorophyll.retrieval.models",
        "chlorophyll.retrieval.seeds",
        "tradeoff.paths",
        "advice.voxel_sizes_m",
    ],
)
def test_a_list_that_something_is_taken_from_must_not_be_empty(key):
    config = []
    for part in reversed(key.split(".")):
        config = {part: config}
    with pytest.raises(InputError, match=key) as error:
        validate(config)
    assert "at least 1 item" in error.value.expected


def test_a_reconstruction_of_the_stability_map_that_there_is_not_is_refused_at_once():
    with pytest.raises(InputError, match=r"stability\.reconstructions`: found `foo`"):
        validate({"stability": {"reconstructions": ["foo"]}})
    sizes = {"voxels": {"sizes_m": [0.1]}, "reconstructions": ["polygons"]}
    validate(sizes | {"stability": {"reconstructions": ["voxels_0.1"]}})


def test_a_time_that_is_none_is_refused_wherever_one_is_asked_for():
    for config in ({"time": {"start": "noon"}}, {"figures": {"map_times": ["10.8.2023"]}}):
        with pytest.raises(InputError, match="ISO 8601"):
            validate(config)


def test_density_from_a_cloud_that_keeps_no_misses_stops_before_anything_runs():
    config = UNKNOWN_SHOTS | {"reconstructions": ["polygons", "voxels_0.2"]}
    with pytest.raises(MissingMissesError) as error:
        validate(config)
    assert "voxels_0.2" in error.value.found
    assert "tree.laz" in error.value.expected
    assert "auto" in error.value.remedy
    allowed = {"cloud": {"path": "tree.laz", "shots": "auto"}}
    assert validate(config | allowed).has_shots


@pytest.mark.parametrize("section", ["site", "time", "radiation"])
def test_an_unknown_time_zone_is_named_with_its_key_and_the_nearest_zone(section):
    with pytest.raises(InputError, match="Did you mean 'Europe/Berlin'") as error:
        validate({section: {"timezone": "Europe/Berln"}})
    assert f"`{section}.timezone`" in str(error.value)


def test_a_time_with_seconds_means_what_it_says_though_yaml_reads_it_otherwise():
    text = "time: {start: 2023-08-10 10:10:00, end: 2023-08-10T16:50:00+00:00}"
    time = validate(yaml.safe_load(text)).time
    assert time.start == "2023-08-10 10:10:00"
    assert datetime.fromisoformat(time.end) == datetime(2023, 8, 10, 16, 50, tzinfo=UTC)


def test_leaves_that_sway_widen_the_entrance_of_a_sensor():
    """An even disc has a quarter of its diameter for a standard deviation along each axis."""
    rng = np.random.default_rng(1)
    radius, angle = np.sqrt(rng.random(100_000)), 2 * np.pi * rng.random(100_000)
    disc = validate({"light": {"sway_m": 0.1}}).light.entrance_m / 2
    assert np.std(disc * radius * np.cos(angle)) == pytest.approx(0.1, rel=0.01)
    assert validate({"light": {"sway_m": 0.3, "aperture_m": 0.5}}).light.entrance_m == 1.3


def test_a_switch_of_an_earlier_version_names_the_study():
    plots = {"enabled": True, "plots": ["larch"]}
    settings = validate({"study": "light", "chlorophyll": plots})
    assert settings.study == "chlorophyll"
    assert validate({"survey": {"enabled": False}}).study == "light"
    with pytest.raises(InputError, match="one study in a run"):
        validate({"survey": {"enabled": True}, "stability": {"enabled": True}})


@pytest.mark.parametrize("name", ["Tree_7", "plot-utc+1", "v1.2"])
def test_an_experiment_may_be_called_what_a_folder_may_be_called(name):
    assert validate({"experiment": name}).experiment == name


def test_a_scan_that_keeps_its_shots_needs_no_key_beyond_its_path():
    found = validate({"cloud": {"path": "scan.e57"}})
    assert (found.source, found.measured.kind) == ("cloud", "none")
    assert found.reconstructions == ("polygons", "surfels", "voxels_0.2", "voxels_1.0")


@pytest.mark.parametrize(
    ("config", "expected"),
    [
        ({}, ("virtual", "virtual", 5)),
        ({"cloud": {"path": "tree.laz"}}, ("cloud", "none", 2)),
        ({"cloud": {"path": "a.laz", "scan_positions": "p.csv"}}, ("cloud", "none", 4)),
        ({"wood_path": "bark.obj"}, ("wood", "none", 3)),
        ({"cloud": {"path": "a.laz"}, "measured": {"path": "p.csv"}}, ("cloud", "table", 2)),
    ],
)
def test_files_tell_the_source_the_records_and_what_can_be_made_of_them(config, expected):
    found = validate(config)
    assert (found.source, found.measured.kind, len(found.reconstructions)) == expected
