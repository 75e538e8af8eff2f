"""A run's crate names every file with its checksum."""

import hashlib
import json
import re
import tomllib
from pathlib import Path

import pytest
import yaml
from rocrate.rocrate import ROCrate

from dapple import provenance

ROOT = Path(__file__).parents[2]


@pytest.fixture
def run(tmp_path):
    folder = tmp_path / "results/mine"
    (folder / "light").mkdir(parents=True)
    (folder / "config.yaml").write_text("experiment: mine\n")
    (folder / "light/polygons.nc").write_bytes(b"light")
    (folder / "light/.partial-truth.nc").write_bytes(b"half")
    data = tmp_path / "tree.laz"
    data.write_bytes(b"points")
    return folder, data


def test_results_data_and_programs_can_be_read_back(run):
    folder, data = run
    described = provenance.describe(folder, experiment="mine", data=[data], packages=["numpy"])
    (folder / provenance.NAME).write_text(json.dumps(described))
    crate = ROCrate(folder)
    light = crate.get("light/polygons.nc")
    assert light["sha256"] == hashlib.sha256(b"light").hexdigest()
    assert light["contentSize"] == "5"
    assert crate.get(data.as_uri())["sha256"] == hashlib.sha256(b"points").hexdigest()
    action = crate.get("#run")
    assert {entity.id for entity in action["object"]} == {data.as_uri(), "config.yaml"}
    assert {entity.id for entity in action["result"]} == {"config.yaml", "light/polygons.nc"}
    assert crate.get("#numpy")["softwareVersion"][0].isdigit()


def test_the_same_run_is_described_alike_but_for_the_day(run):
    folder, data = run
    twice = [provenance.describe(folder, experiment="mine", data=[data]) for _ in range(2)]
    first, second = (re.sub(r'"datePublished": "[^"]*"', "", json.dumps(one)) for one in twice)
    assert first == second


def test_dapple_has_one_version():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    codemeta = json.loads((ROOT / "codemeta.json").read_text())
    versions = {project["version"], citation["version"], codemeta["version"], provenance.VERSION}
    assert len(versions) == 1
