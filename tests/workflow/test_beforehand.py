"""What a run would take, and why it would, from Snakemake's own plan."""

import json
import os
import re

import pandas as pd
import pytest
import yaml
from tests.workflow import dry_runs
from tests.workflow.project import ROOT, SMALL, copy_of_project

from dapple.config.settings import validate
from dapple.estimate import speed

EDIT = "optics={leaf: {chlorophyll_ug_cm2: 60}}"
WHY = r"because optics\.leaf\.chlorophyll_ug_cm2 is 60\.0 \(was 45\.0\)\."


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A project that looks as after a run, on a machine as fast as that of the table."""
    project = copy_of_project(tmp_path_factory.mktemp("estimate") / "dapple")
    dry_runs.pretend_finished(project.folder, SMALL)
    path = project.result("config.yaml")
    when = path.stat()
    settings = validate(yaml.safe_load((ROOT / SMALL).read_text()))
    path.write_text(yaml.safe_dump(settings.model_dump(mode="json")))
    os.utime(path, (when.st_atime, when.st_mtime))
    table = pd.read_csv(speed.REFERENCE, index_col="work")["seconds"]
    project.result("machine.json").write_text(json.dumps(dict(table)))
    return project


def test_nothing_is_to_do_where_nothing_changed(finished):
    assert "Nothing to do" in finished.run("estimate")


def test_an_estimate_tells_what_an_edit_reruns_how_long_and_why(finished):
    said = finished.run("estimate", config=[EDIT])
    assert re.search(rf"\d+ of 5\d steps, about \d+ (s|min), {WHY}", said)
    rows = {line.split()[0] for line in said.splitlines() if line.rstrip().endswith(" GB")}
    assert {"optics", "light", "page"} <= rows
    assert not rows & {"scan", "polygons", "transport"}
    assert "In all about" in said


def test_a_run_begins_with_what_it_will_do_and_why(finished):
    target = finished.result("sky/optics.nc").relative_to(finished.folder)
    said = finished.run(target, config=[EDIT])
    assert re.search(rf"steps?, about \d+ s, {WHY}", said)
