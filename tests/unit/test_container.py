"""Containers are set up as machines are: by `make setup`, from the lock alone."""

import json
import subprocess
from pathlib import Path

from tests.workflow.project import PARTS

ROOT = Path(__file__).parents[2]
DOCKER = (ROOT / "envs/Dockerfile").read_text()
APPTAINER = (ROOT / "envs/apptainer.def").read_text()
BEFORE = {"ca-certificates", "make", "python3", "python3-venv"}
"""What a bare Debian lacks to begin the set-up."""


def instructions(name):
    """What follows an instruction of the Dockerfile, line by line."""
    return [
        line.removeprefix(name).strip() for line in DOCKER.splitlines() if line.startswith(name)
    ]


def section(name):
    """Lines of a section of the Apptainer definition."""
    lines = APPTAINER.split(f"%{name}\n")[1].split("\n%")[0].splitlines()
    return [line.strip() for line in lines if line.strip()]


def test_both_containers_begin_and_run_alike():
    assert instructions("FROM") == [APPTAINER.split("From: ")[1].split("\n")[0]]
    assert instructions("RUN") == section("post")
    (entry,) = instructions("ENTRYPOINT")
    assert section("runscript") == [f'exec {" ".join(json.loads(entry))} "$@"']


def test_the_set_up_installs_everything_but_what_begins_it():
    update, begin, setup, tidy = instructions("RUN")
    assert update == "apt-get -qq update"
    words = begin.split()
    assert words[:3] == ["apt-get", "-qq", "install"]
    assert {word for word in words[3:] if not word.startswith("-")} == BEFORE
    assert setup == "make -C /opt/dapple setup"
    assert tidy.startswith("rm -rf ")


def test_the_base_is_the_debian_that_the_set_up_asks_for():
    (base,) = instructions("FROM")
    assert base == "debian:12-slim"
    assert "Debian 12" in (ROOT / "tools/setup").read_text()


def test_containers_hold_all_parts_of_a_run():
    copied = {line.split()[0] for line in section("files")}
    assert copied == {*PARTS, "Makefile", "requirements.lock", "tools"}
    assert instructions("COPY") == [". /opt/dapple"]


def test_nothing_that_belongs_to_dapple_is_left_out():
    ignored = (ROOT / "envs/Dockerfile.dockerignore").read_text().split()
    tracked = subprocess.run(
        ["git", "ls-files", *(one for one in ignored if one != ".git")],
        cwd=ROOT,
        capture_output=True,
        text=True,
    ).stdout.split()
    assert set(tracked) <= {"results/README.md"}
