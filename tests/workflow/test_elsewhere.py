"""dapple runs wherever its results are to lie, inside another workflow, and beside other clones."""

import os
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from tests.workflow.project import ENVIRONMENT, ROOT, SMALL, copy_of_project, jobs

STEPS = {"plant", "scan", "clean", "classify", "polygons", "voxels", "light", "verdict", "page"}
CHEAP = "results/virtual-apple-small/structure/truth/summary.json"
WITHIN = """
configfile: "{small}"


module dapple:
    snakefile:
        "{snakefile}"
    config:
        config
    {prefix}


use rule * from dapple as dapple_*


rule all:
    default_target: True
    input:
        rules.dapple_all.input,
"""


def snakemake(folder, *arguments, **variables):
    """Run Snakemake in a folder; it has to succeed."""
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--cores", "1", *map(str, arguments)],
        cwd=folder,
        env=ENVIRONMENT | variables,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    assert done.returncode == 0, done.stdout[-6000:]
    return done.stdout


def test_results_lie_in_the_folder_from_which_the_snakefile_is_named(tmp_path):
    snakemake(tmp_path, "-s", ROOT / "Snakefile", "--configfile", ROOT / SMALL, "--", CHEAP)
    assert (tmp_path / CHEAP).is_file()
    planned = snakemake(
        tmp_path, "-n", "-q", "rules", "-s", ROOT / "Snakefile", "--configfile", ROOT / SMALL
    )
    assert jobs(planned) >= STEPS - {"plant"}
    assert "plant" not in jobs(planned)


def test_results_lie_in_the_directory_that_is_asked_for_and_the_defaults_are_found(tmp_path):
    elsewhere = tmp_path / "elsewhere"
    output = snakemake(
        tmp_path, "-n", "-q", "rules", "-s", ROOT / "Snakefile", "--directory", elsewhere
    )
    assert jobs(output) >= STEPS


@pytest.mark.parametrize("prefix", ["", 'prefix:\n        "under"'])
def test_another_workflow_can_take_dapple_as_a_module(tmp_path, prefix):
    text = WITHIN.format(small=ROOT / SMALL, snakefile=ROOT / "Snakefile", prefix=prefix)
    (tmp_path / "Snakefile").write_text(text)
    output = snakemake(tmp_path, "-n", "-q", "rules")
    assert {f"dapple_{step}" for step in STEPS} <= jobs(output)
    if prefix:
        snakemake(tmp_path, "--", f"under/{CHEAP}")
        assert (tmp_path / "under" / CHEAP).is_file()


def git(folder, *arguments):
    subprocess.run(["git", *arguments], cwd=folder, check=True, capture_output=True, timeout=60)


@pytest.fixture
def hub(tmp_path):
    """A folder that git takes for github.com, with dapple as it stands here as owner/dapple."""
    folder = copy_of_project(tmp_path / "hub/owner/dapple").folder
    (folder / ".tools").unlink(missing_ok=True)
    person = ("-c", "user.name=nobody", "-c", "user.email=nobody@example.org")
    for arguments in (
        ("init", "-q"),
        ("add", "-A"),
        (*person, "commit", "-qm", "all"),
        ("tag", "v1"),
    ):
        git(folder, *arguments)
    return {
        "GIT_CONFIG_COUNT": "1",
        "GIT_CONFIG_KEY_0": f"url.file://{tmp_path}/hub/.insteadOf",
        "GIT_CONFIG_VALUE_0": "https://github.com/",
        "XDG_CACHE_HOME": str(tmp_path / "cache"),
    }


def test_snakedeploy_writes_a_workflow_that_runs_without_a_clone(tmp_path, hub):
    deploy = [Path(sys.executable).with_name("snakedeploy"), "deploy-workflow"]
    mine = tmp_path / "mine"
    subprocess.run(
        [*deploy, "https://github.com/owner/dapple", mine, "--tag", "v1"],
        env=ENVIRONMENT | hub,
        check=True,
        capture_output=True,
        timeout=120,
    )
    assert "github(" in (mine / "workflow/Snakefile").read_text()
    snakemake(mine, "--configfile", SMALL, "--", CHEAP, **hub)
    assert (mine / CHEAP).is_file()


# What Snakemake's own process needs


def closure(name):
    """A distribution and all that it requires without extras."""
    found, waiting = set(), [name]
    while waiting:
        one = waiting.pop().lower().replace("_", "-").replace(".", "-")
        if one in found:
            continue
        try:
            requirements = metadata.requires(one) or []
        except metadata.PackageNotFoundError:  # for another platform or Python
            continue
        found.add(one)
        parsed = [Requirement(text) for text in requirements]
        waiting += [r.name for r in parsed if not r.marker or r.marker.evaluate({"extra": ""})]
    return found


def test_the_snakefile_needs_nothing_that_snakemake_itself_does_not_bring(tmp_path):
    """A conda user's Snakemake has no numpy: environments of rules come later."""
    own = closure("snakemake")
    assert {"pydantic", "pyyaml"} <= own
    foreign = [
        module
        for module, distributions in metadata.packages_distributions().items()
        if not own & {one.lower().replace("_", "-").replace(".", "-") for one in distributions}
    ]
    assert {"numpy", "pandas", "xarray", "mitsuba", "scipy"} <= set(foreign)
    (tmp_path / "sitecustomize.py").write_text(
        f"""
import pkgutil
import sys

FOREIGN = {foreign!r}
listed = pkgutil.iter_modules  # where Snakemake looks for plugins
pkgutil.iter_modules = lambda *path: (one for one in listed(*path) if one.name not in FOREIGN)


class Refuse:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in FOREIGN:
            raise ModuleNotFoundError(f"No module named {{name!r}}", name=name)


sys.meta_path.insert(0, Refuse())
"""
    )
    for study in ("virtual-apple-small", "survey-small", "chlorophyll-small", "stability-small"):
        snakemake(
            tmp_path,
            "-n",
            "-q",
            "-s",
            ROOT / "Snakefile",
            "--configfile",
            ROOT / f"config/{study}.yaml",
            PYTHONPATH=str(tmp_path),
        )


# Two clones on one machine


@pytest.fixture
def clones(tmp_path):
    """Two clones whose Snakemake says which it is."""
    for name in ("one", "other"):
        program = tmp_path / name / ".venv/bin/snakemake"
        program.parent.mkdir(parents=True)
        program.write_text(f'#!/bin/sh\necho {name} "$@"\n')
        program.chmod(0o755)
        (tmp_path / name / "sub").mkdir()
    return tmp_path


def launch(folder, *arguments):
    return subprocess.run(
        [ROOT / "tools/snakemake", *map(str, arguments)], cwd=folder, capture_output=True, text=True
    )


def test_each_clone_runs_its_own_snakemake(clones):
    assert launch(clones / "one/sub", "-n").stdout == "one -n\n"
    assert launch(clones / "other", "-n").stdout == "other -n\n"
    by_name = launch(clones / "one", "-s", "../other/Snakefile", "--directory", os.sep)
    assert by_name.stdout.startswith("other -s")


def test_without_a_clone_the_launcher_says_what_to_do(tmp_path):
    done = launch(tmp_path, "-n")
    assert done.returncode == 127
    assert "make setup" in done.stderr
