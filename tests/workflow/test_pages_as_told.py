"""README and pages: the website builds, commands run, quoted messages exist."""

import json
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from tests.workflow.dry_runs import many
from tests.workflow.project import ROOT, copy_of_project, jobs

PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
SHELL = re.compile(r"^```(?:sh|bash)?\n(.*?)^```", re.MULTILINE | re.DOTALL)
NEEDS = re.compile(r"config/(apple|leafy-tree|single-scan|pine-plot)\.yaml")
ELSEWHERE = (
    "path/to/",
    "config/mine.yaml",
    "config/RUN.yaml",
    "--profile",
    "--default-storage-provider",
    "--sdm",
    "--report",
    "--touch",
    "--unlock",
)


def commands():
    """Commands of Snakemake that stand in blocks, tables and sentences of the pages."""
    found = set()
    for page in PAGES:
        text = page.read_text()
        blocks = "\n".join(SHELL.findall(text))
        spans = re.findall(r"`(snakemake --[^`]*)`", text)
        lines = [line.split(" #")[0].strip() for line in blocks.splitlines()]
        found.update(line for line in (*lines, *spans) if line.startswith("snakemake"))
    return sorted(found)


def test_the_website_builds_without_a_warning(tmp_path):
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-b", "html"]
    done = subprocess.run(
        [*build, "-d", tmp_path / "read", "docs", tmp_path / "html"],
        cwd=ROOT,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "html/index.html").is_file()


def test_commands_of_the_pages_can_be_run(tmp_path):
    folder = copy_of_project(tmp_path / "dapple").folder
    told = [one for one in commands() if not any(part in one for part in ELSEWHERE)]
    told = [one for one in told if not NEEDS.search(one) and "{" not in one]
    assert len(told) > 10
    runs = []
    for command in told:
        arguments = shlex.split(command)[1:]
        if "--cores" not in arguments:
            arguments = ["--cores", "2", *arguments]
        runs.append((folder, ["--dry-run", "--quiet", "all", *arguments]))
    many(runs)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_files_that_a_page_links_to_exist(page):
    links = re.findall(r"\]\((?!https?:|#)([^)#\s]+)[^)]*\)", page.read_text())
    missing = [link for link in links if not (page.parent / link).exists()]
    assert not missing


def test_headings_of_messages_quote_messages_that_exist():
    source = "".join(path.read_text() for path in Path(ROOT).glob("scripts/dapple/**/*.py"))
    source += "".join(path.read_text() for path in Path(ROOT).glob("rules/**/*.smk"))
    source = re.sub(r'"\s*\n\s*f?"', "", source)  # sentences that go over several lines
    quoted = re.findall(r"^## `(.*)`$", (ROOT / "docs/faq.md").read_text(), re.MULTILINE)
    of_snakemake = {"Directory cannot be locked"}
    assert len(quoted) > 5
    assert [one for one in quoted if one not in source and one not in of_snakemake] == []


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    folder = tmp_path_factory.mktemp("example") / "dapple"
    project = copy_of_project(folder, "config/example.yaml", experiment="example")
    project.overrides = ("reconstructions=[polygons]", "light={check: false}")
    checked = project.run("check")
    assert "nothing speaks against this input" in checked
    project.run()
    return project


@pytest.mark.whole
def test_the_example_of_an_own_scan_runs_and_finds_the_light(example):
    overall = pd.read_csv(example.result("statistics/overall.csv")).iloc[0]
    # The tree has flecks and clouds: a sky without it reaches 0.73.
    assert overall["r"] > overall["baseline_r"] + 0.15
    assert abs(overall["bias"]) < 30
    summary = json.loads(example.result("structure/polygons/summary.json").read_text())
    assert summary["leaf_area_m2"] == pytest.approx(8.0, rel=0.25)
    assert "report.html" in {path.name for path in example.result("").iterdir()}


@pytest.mark.whole
def test_a_sensor_more_in_the_table_is_traced_alone_and_changes_no_other(example):
    light = example.result("light/polygons.nc")
    before = xr.load_dataset(light)
    table = example.folder / "config/example/sensors.csv"
    lines = table.read_text().splitlines(keepends=True)
    table.write_text("".join([*lines[:5], "new,0.1,0.3,0.1\n", *lines[5:]]))
    done = example.run(light.relative_to(example.folder))
    assert {"transport", "light"} <= jobs(done)
    for step in ("transport/polygons/0", "light_polygons"):
        log = example.result(f"logs/{step}.log").read_text()
        assert f"1 of {len(lines)} sensors traced" in log
    after = xr.load_dataset(light)
    assert list(after["sensor"].to_numpy()[3:6]) == ["1_4", "new", "2_1"]
    xr.testing.assert_identical(after.drop_sel(sensor="new"), before)
