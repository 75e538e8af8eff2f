"""What moved between two runs is told, by how much, and where it began."""

import sys

import numpy as np
import pandas as pd
import pytest
import yaml

from dapple.formats import clouds, json, netcdf, tables
from dapple.formats.clouds import Cloud

sys.path.append("tools")
import reproduce

PAIRS = {("scan", "clean"), ("clean", "polygons"), ("clean", "voxels"), ("polygons", "light"),
         ("voxels", "light"), ("sky", "light")}  # fmt: skip


@pytest.mark.parametrize(
    ("rules", "first"),
    [
        (["light", "polygons"], ["polygons"]),
        (["light"], ["light"]),
        (["light", "sky", "voxels", "scan"], ["scan", "sky"]),
        ([], []),
    ],
)
def test_the_rule_that_moved_first_is_the_one_with_none_before_it(rules, first):
    assert reproduce.first_of(rules, PAIRS) == first


def run(folder, density=1.0, seconds=3.0):
    """A folder of results."""
    (folder / "light").mkdir(parents=True)
    (folder / "logs").mkdir()
    (folder / "logs/light.log").write_text(f"{seconds} s")
    tables.write(folder / "runtime.csv", pd.DataFrame({"s": [seconds]}))
    tables.write(folder / "light/overall.csv", pd.DataFrame({"name": ["a"], "r": [0.9 * density]}))
    json.write(folder / "summary.json", {"area_m2": density, "layers": [1, 2.5]})
    (folder / "config.yaml").write_text(yaml.safe_dump({"seed": 1}))
    clouds.write(folder / "cloud.laz", Cloud(np.eye(3)))
    rules = {"light/overall.csv": "statistics", "summary.json": "voxels"}
    return reproduce.described(folder, "small", rules)


def test_runs_that_differ_in_their_times_alone_are_the_same(tmp_path):
    one, two = run(tmp_path / "a"), run(tmp_path / "b", seconds=4.0)
    assert list(one["result"]) == ["cloud.laz", "config.yaml", "light/overall.csv", "summary.json"]
    assert reproduce.moved(one, two).empty


def test_a_result_that_moved_is_told_with_its_rule_and_by_how_much(tmp_path):
    one, two = run(tmp_path / "a"), run(tmp_path / "b", density=1.01)
    found = reproduce.moved(one.assign(tolerance=0.001), two).set_index("result")
    assert dict(found["rule"]) == {"light/overall.csv": "statistics", "summary.json": "voxels"}
    assert found.loc["light/overall.csv", "share"] == pytest.approx(0.01)
    assert (found["tolerance"] == 0.001).all()


def test_a_result_that_is_gone_or_new_has_moved_without_measure(tmp_path):
    one = run(tmp_path / "a")
    found = reproduce.moved(one, one.iloc[1:].replace("config.yaml", "other.yaml"))
    assert list(found["result"]) == ["cloud.laz", "config.yaml", "other.yaml"]
    assert np.isinf(found["share"]).all()


def test_numbers_of_every_format_count(tmp_path):
    run(tmp_path / "a")
    assert reproduce.numbers(tmp_path / "a/light/overall.csv").tolist() == [0.9]
    assert sorted(reproduce.numbers(tmp_path / "a/summary.json")) == [1, 1, 2.5]
    assert len(reproduce.numbers(tmp_path / "a/cloud.laz")) > 9
    table = pd.DataFrame({"x": [3.0, np.nan], "word": ["a", "b"]})
    table.to_parquet(tmp_path / "t.parquet")
    assert reproduce.numbers(tmp_path / "t.parquet").tolist() == [3.0]
    dataset = table[["x"]].rename_axis("row").to_xarray()
    dataset["x"].attrs = {"units": "m", "long_name": "place"}
    dataset["identity"] = "row", np.array([2**63, 1], np.uint64), {"units": "1", "long_name": "sum"}
    netcdf.write(tmp_path / "t.nc", dataset)
    found = reproduce.numbers(tmp_path / "t.nc")
    assert 3.0 in found
    assert 2.0**63 not in found  # a checksum
    assert reproduce.measures(tmp_path / "t.parquet") == {
        "numbers": 1, "geometric_mean": pytest.approx(3), "rms": pytest.approx(3)}  # fmt: skip
