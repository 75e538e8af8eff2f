"""Crowns of field trees keep their outlines and chlorophyll, and bad files say what is wrong."""

import json

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.formats import geojson

CORNER = np.array([612_000.0, 5_324_000.0])
SQUARE = CORNER + np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])


@pytest.fixture
def crowns():
    return geojson.of_rings([SQUARE, SQUARE + 5], [3, 8], [31.5, 52.25], "EPSG:25832")


def changed(path, crowns, change):
    geojson.write(path, crowns)
    content = json.loads(path.read_text())
    change(content)
    path.write_text(json.dumps(content))
    return path


def test_a_file_gives_back_what_was_written(crowns, tmp_path):
    geojson.write(tmp_path / "crowns.geojson", crowns)
    again = geojson.read(tmp_path / "crowns.geojson")
    assert again.geometries == crowns.geometries
    assert again.names == ("3", "8")
    assert again.lcc_ug_cm2.tolist() == [31.5, 52.25]
    assert again.crs == "EPSG:25832"
    np.testing.assert_array_equal(again.outlines()[1][:-1], SQUARE + 5)


def test_features_without_a_name_are_numbered(crowns, tmp_path):
    path = changed(
        tmp_path / "a.geojson", crowns, lambda c: [f["properties"].pop("tree") for f in
                                                   c["features"]],
    )  # fmt: skip
    assert geojson.read(path).names == ("1", "2")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda c: c.pop("crs"), "no crs member"),
        (lambda c: c["crs"]["properties"].update(name="EPSG:999999"), "one that PROJ knows"),
        (lambda c: c["features"].clear(), "no features"),
        (lambda c: c["features"][1]["properties"].pop("lcc_ug_cm2"), "None in feature 2"),
        (lambda c: c["features"][0]["properties"].update(lcc_ug_cm2=-3), "-3 in feature 1"),
        (lambda c: c["features"][0]["geometry"].update(type="Point"), "a Point as feature 1"),
    ],
)
def test_what_is_wrong_is_said(crowns, tmp_path, change, message):
    with pytest.raises(InputError, match=message):
        geojson.read(changed(tmp_path / "a.geojson", crowns, change))


def test_another_coordinate_system_is_refused(crowns):
    geojson.require_crs(crowns, "EPSG:25832", "crowns.geojson")
    with pytest.raises(InputError, match="crowns in EPSG:25832; expected EPSG:25833"):
        geojson.require_crs(crowns, "EPSG:25833", "crowns.geojson")
