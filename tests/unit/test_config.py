"""The configuration: one typed source, and mistakes that are told with their remedy."""

import json
from datetime import UTC, datetime

import pytest
import yaml

from dapple.config import docs
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
    assert validate(default) == validate({}) == Settings()


@pytest.mark.parametrize("path", FILES, ids=lambda path: path.name)
def test_every_configuration_is_valid_on_top_of_the_default(path):
    default = yaml.safe_load((docs.CONFIG / "config.yaml").read_text())
    settings = validate(merged(default, yaml.safe_load(path.read_text())), path.name)
    expected = "virtual-apple" if path.stem == "config" else path.stem
    assert settings.experiment == expected


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


@pytest.mark.parametrize(
    ("config", "found"),
    [
        ({"reconstructions": ["voxels_0.3"]}, "voxels_0.3"),
        (REAL_CLOUD | {"reconstructions": ["truth"]}, "truth"),
        (REAL_CLOUD | {"measured": {"kind": "virtual"}}, "measured.kind: virtual"),
        ({"source": "cloud", "measured": {"kind": "none"}, "reconstructions": []}, "cloud.path"),
        ({"source": "wood", "measured": {"kind": "none"}, "reconstructions": []}, "wood_path"),
        ({"radiation": {"kind": "table"}}, "radiation.path"),
        ({"sensors": {"kind": "table"}}, "sensors.path"),
        ({"measured": {"kind": "table"}}, "measured.path"),
        ({"registration": {"fit": True}}, "sensors.kind: grid"),
        ({"time": {"step_min": 4}}, "time.step_min: 4"),
        (REAL_CLOUD | {"cloud": {"path": "tree.laz", "shots": "recorded"}}, "tree.laz"),
        ({"optics": {"bark": {"wavelength_nm": [400.0, 500.0, 700.0]}}}, "3 wavelengths"),
    ],
)
def test_values_that_contradict_each_other_are_named_together(config, found):
    with pytest.raises(InputError) as error:
        validate(config)
    assert found in error.value.found


def test_density_from_a_cloud_that_keeps_no_misses_stops_before_anything_runs():
    config = REAL_CLOUD | {"reconstructions": ["polygons", "voxels_0.2"]}
    with pytest.raises(MissingMissesError) as error:
        validate(config)
    assert "voxels_0.2" in error.value.found
    assert "tree.laz" in error.value.expected
    assert "scan_frame" in error.value.remedy
    allowed = {"cloud": {"path": "tree.laz", "shots": "scan_frame"}}
    assert validate(config | allowed).cloud.shots == "scan_frame"


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
