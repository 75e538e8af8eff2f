"""What is wrong with an input is said before anything is computed, all at once, with its remedy."""

import re

import numpy as np
import pytest
import yaml
from tests.unit.test_las_readers import las
from tests.unit.test_plot import plot, tree

from dapple import findings
from dapple.check import page
from dapple.check.inspection import inspect
from dapple.config.settings import Settings, validate
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import clouds, json
from dapple.formats.clouds import Cloud

NOTHING = {"sensors": {"kind": "none"}, "measured": {"kind": "none"}}
SHAPE = {"classify": {"method": "geometry"}, "polygons": {"voxel_size_m": 0.2}}


def settings(**sections):
    """A configuration of a run on a cloud as the check gets it."""
    given = {"source": "cloud", "reconstructions": ["polygons"], **NOTHING, **SHAPE, **sections}
    given["cloud"] = {"path": "tree.laz"} | given.get("cloud", {})
    return Settings.model_validate(given).model_dump()


def one_tree(step_m=None, **attributes):
    """A tree of points 7 cm apart, and what they carry."""
    xyz = tree(np.zeros(2), np.random.default_rng(8))
    if step_m:
        xyz = np.rint(xyz / step_m) * step_m
    found = {name: np.full(len(xyz), value, np.float32) for name, value in attributes.items()}
    return Cloud(xyz, attributes=found)


def look(tmp_path, points, /, name="tree.laz", crs=None, **sections):
    path = tmp_path / name
    clouds.write(path, points, **({"crs": crs} if crs else {}))
    return inspect(settings(**sections), cloud=path)


def said(check, level):
    return [one for one in check["findings"] if one["level"] == level]


def mended(check, **sections):
    """The findings that are left when the lines of YAML of all findings are pasted."""
    pasted = {
        k: v for row in check["findings"] for k, v in (yaml.safe_load(row["yaml"]) or {}).items()
    }
    return {**sections, **pasted}


def test_a_sound_tree_has_no_fault_and_is_described(tmp_path):
    check = look(tmp_path, one_tree())
    assert not said(check, "error")
    assert not said(check, "warning")
    cloud = check["cloud"]
    assert cloud["points"] == 9000
    assert cloud["height_m"] == pytest.approx(8.0, abs=0.1)
    assert len(cloud["stems"]) == 1
    assert cloud["ground"]["found_by"] == "foot of the stem"
    assert "stem 1" in page.text(check)
    assert {row["what"]: row["able"] for row in check["can"]}["voxels"] is False


def test_a_tree_on_ground_far_wider_than_it_is_high_stands_upright(tmp_path):
    rng = np.random.default_rng(9)
    far_m, turn = np.exp(rng.uniform(0.0, 5.0, 20_000)), rng.uniform(0, 2 * np.pi, 20_000)
    ground = np.column_stack([far_m * np.sin(turn), far_m * np.cos(turn), np.zeros(20_000)])
    wide = Cloud(np.concatenate([one_tree().xyz_m, ground]))
    assert not [one for one in look(tmp_path, wide)["findings"] if " up" in one["found"]]


@pytest.mark.parametrize(
    ("cloud", "sections", "level", "message"),
    [
        (
            one_tree(),
            {"classify": {"method": "reflectance"}},
            "error",
            "no attribute 'Reflectance'",
        ),
        (
            one_tree(Reflectance=3000),
            {"classify": {"method": "mixture"}},
            "error",
            "Reflectance from",
        ),
        (one_tree(step_m=0.5), {}, "error", "rounded to 0.5 m and polygons of 0.2 m"),
        (one_tree(), {"polygons": {"voxel_size_m": 0.05}}, "warning", r"points 6\.\d cm apart"),
        (Cloud(one_tree().xyz_m * 1000), {}, "error", "m above the ground"),
        (Cloud(one_tree().xyz_m * [1e-5, 1e-5, 1]), {}, "error", "from west to east"),
        (Cloud(one_tree().xyz_m[:, [0, 2, 1]] * [1, 1, -1]), {}, "warning", "with y up"),
        (Cloud(one_tree().xyz_m * [1, -1, -1]), {}, "warning", "with z down"),
        (one_tree(), {"ground_z_m": 3.2}, "error", r"ground at 0.0\d m .* and `ground_z_m: 3.2`"),
        (one_tree(), {"ground_z_m": -1.0}, "warning", "ground at"),
        (plot()[0], {}, "warning", "3 stems"),
        (plot()[0], {"tree": {"id": 7}}, "error", "tree.id: 7"),
        (one_tree(), {"reconstructions": ["voxels_0.2"]}, "error", "no shot that met nothing"),
        (Cloud(np.tile(one_tree().xyz_m, (2, 1))), {}, "warning", "exactly the place of another"),
    ],
    ids=range(14),
)
def test_every_fault_is_said_with_its_level(tmp_path, cloud, sections, level, message):
    found = said(look(tmp_path, cloud, **sections), level)
    assert any(re.search(message, one["found"]) for one in found)
    assert all(one["where"] and one["expected"] and one["remedy"] for one in found)


@pytest.mark.parametrize(
    ("cloud", "sections"),
    [
        (one_tree(), {"classify": {"method": "reflectance"}}),
        (one_tree(step_m=0.5), {}),
        (Cloud(one_tree().xyz_m * 1000), {}),
        (Cloud(one_tree().xyz_m[:, [0, 2, 1]] * [1, 1, -1]), {}),
        (one_tree(), {"polygons": {"voxel_size_m": 0.05}}),
        (one_tree(), {"ground_z_m": 3.2}),
        (plot()[0], {}),
        (one_tree(), {"reconstructions": ["voxels_0.2"]}),
    ],
    ids=["reflectance", "steps", "millimetres", "y up", "spacing", "ground", "stems", "voxels"],
)
def test_the_lines_to_paste_mend_what_they_are_said_for(tmp_path, cloud, sections):
    before = look(tmp_path, cloud, **sections)
    assert said(before, "error") or said(before, "warning")
    after = look(tmp_path, cloud, **mended(before, **sections))
    assert not said(after, "error")
    assert not said(after, "warning")


def test_all_faults_come_at_once_and_stop_a_run_in_one_message(tmp_path):
    check = look(
        tmp_path,
        one_tree(step_m=0.5),
        classify={"method": "reflectance"},
        reconstructions=["polygons", "voxels_0.2"],
    )
    assert len(said(check, "error")) == 3
    with pytest.raises(InputError) as error:
        findings.stop(Finding(**row) for row in check["findings"])
    for part in ("rounded to 0.5 m", "no attribute 'Reflectance'", "no shot that met nothing"):
        assert part in str(error.value)


def test_a_file_that_cannot_be_read_is_a_finding_too(tmp_path):
    path = las(tmp_path / "tree.las", n_records=2**31 - 1)
    check = inspect(settings(), cloud=path)
    assert "records announced" in said(check, "error")[0]["found"]
    assert "cloud" not in check
    assert "ERROR" in page.text(check)


def test_heights_above_the_ground_are_judged_as_such(tmp_path):
    cloud = Cloud(
        one_tree().xyz_m + np.array([0.0, 0.0, 3.0]), np.array([410_500.0, 5_317_080.0, 280.0])
    )
    clouds.write(tmp_path / "tree.laz", cloud)
    table = tmp_path / "sensors.csv"
    table.write_text("sensor,x,y,z,tilt_deg\na,410501,5317081,0.1,30\n")
    facing = {"kind": "table", "azimuth_deg": 180.0}
    world, above = (
        inspect(
            settings(sensors=facing | {"heights": heights}),
            cloud=tmp_path / "tree.laz",
            sensors=table,
        )
        for heights in ("world", "above_ground")
    )
    assert said(world, "error")
    assert not said(above, "error")
    assert above["sensors"]["least_height_m"] == pytest.approx(0.1, abs=1e-6)


def test_sensors_in_the_cloud_s_own_world_need_no_origin(tmp_path):
    cloud = Cloud(one_tree().xyz_m, np.array([410_500.0, 5_317_080.0, 0.0]))
    clouds.write(tmp_path / "tree.laz", cloud)
    table = tmp_path / "sensors.csv"
    table.write_text("label,X,Y,Z\na,410501,5317081,0.1\n")
    check = inspect(settings(), cloud=tmp_path / "tree.laz", sensors=table)
    assert check["sensors"]["farthest_outside_m"] < 1
    assert not said(check, "error")
    table.write_text("label,X,Y,Z\na,1,1,0.1\n")
    check = inspect(settings(), cloud=tmp_path / "tree.laz", sensors=table)
    assert "sensor a at (1.00, 1.00, 0.10)" in said(check, "error")[0]["found"]
    table.write_text("label,X,Y,Z\na,410501,5317081,-0.6\n")
    check = inspect(settings(), cloud=tmp_path / "tree.laz", sensors=table)
    assert "below the ground" in said(check, "error")[0]["found"]


def test_texts_of_the_input_are_escaped_on_the_page(tmp_path):
    path = tmp_path / "<b>tree.txt"
    path.write_text("X Y Z <i>\n" + "1 2 3 4\n" * 3)
    made = page.page(json.read(_written(tmp_path, inspect(settings(), cloud=path))))
    assert "<b>tree" not in made
    assert "&lt;b&gt;tree" in made


def _written(tmp_path, check):
    json.write(tmp_path / "check.json", check)
    return tmp_path / "check.json"


def test_a_finding_says_what_an_error_would():
    mistake = InputError("a.laz", "x", "y", "Do z.")
    with pytest.raises(InputError, match=r"a.laz: found x; expected y. Do z."):
        findings.stop([findings.of(mistake)])


def test_two_ways_to_name_a_tree_contradict_each_other():
    given = {"source": "cloud", "cloud": {"path": "a.laz"}, "reconstructions": ["polygons"]}
    with pytest.raises(InputError, match=r"tree.id: 1` and `tree.at"):
        validate({**given, **NOTHING, "tree": {"id": 1, "at": [0, 0]}})
