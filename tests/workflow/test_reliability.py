"""A run that is stopped hard, finds no room, or loses a program goes on later as if it had not."""

import hashlib
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from tests.workflow.project import ENVIRONMENT, SMALL, copy_of_project

LITTLE = ("reconstructions=[polygons]", "light={check: false}")
# They tell when and how long, or draw what others hold.
TOLD_BY_THE_CLOCK = ("benchmarks", "logs", "figures", "runtime.csv", "report.html")


def digests(project):
    """Checksum of every result that does not tell the time."""
    folder = project.result("")
    files = [path for path in sorted(folder.rglob("*")) if path.is_file()]
    told = {path: path.relative_to(folder) for path in files}
    return {
        str(name): hashlib.sha256(path.read_bytes()).hexdigest()
        for path, name in told.items()
        if name.parts[0] not in TOLD_BY_THE_CLOCK
    }


def unlocked(project):
    """The project, free for another run after one that was killed."""
    project.snakemake("--unlock", "--quiet", "all")
    return project


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    project = copy_of_project(folder / "dapple", overrides=LITTLE)
    started = time.monotonic()
    project.run()
    return digests(project), time.monotonic() - started


@pytest.mark.long
def test_a_run_that_is_killed_again_and_again_ends_with_the_same_bytes(undisturbed, tmp_path):
    expected, whole_s = undisturbed
    project = copy_of_project(tmp_path / "dapple", overrides=LITTLE)
    command = [sys.executable, "-m", "snakemake", "--cores", "2", "--configfile", SMALL]
    command += ["--quiet", "all", "--config", *LITTLE]
    rng = np.random.default_rng(1)
    killed = 0
    for wait_s in rng.uniform(2.0, 0.4 * whole_s, 30):
        run = subprocess.Popen(
            command,
            cwd=project.folder,
            env=ENVIRONMENT,
            start_new_session=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            run.wait(wait_s)
        except subprocess.TimeoutExpired:
            os.killpg(run.pid, signal.SIGKILL)
            run.wait()
            killed += 1
        unlocked(project)
    assert killed >= 5
    project.run()
    assert digests(project) == expected
    assert not list(project.result("").rglob(".partial-*"))


@pytest.mark.long
def test_a_full_disk_leaves_no_half_written_file_and_a_later_run_finishes(undisturbed, tmp_path):
    expected, _ = undisturbed
    project = copy_of_project(tmp_path / "dapple", overrides=LITTLE)
    results = project.folder / "results"
    results.mkdir()
    mounted = subprocess.run(
        ["mount", "-t", "tmpfs", "-o", "size=2m", "tmpfs", results],
        capture_output=True,
        text=True,
        timeout=60,
    )
    if mounted.returncode:
        pytest.skip(f"no small disk can be made here: {mounted.stderr.strip()}")
    try:
        done = project.snakemake()
        assert done.returncode == 1
        assert "No space left on device" in done.stdout
        subprocess.run(["mount", "-o", "remount,size=200m", results], check=True, timeout=60)
        unlocked(project).run()
        assert digests(project) == expected
    finally:
        subprocess.run(["umount", results], check=True, timeout=60)


def test_a_broken_cloudcompare_is_named_leaves_no_target_and_a_later_run_finishes(
    small_run, tmp_path
):
    project = small_run.clone(tmp_path / "dapple")
    target = project.result("clean/cloud.laz")
    expected = target.read_bytes()
    target.unlink()
    broken = tmp_path / "bin/CloudCompare"
    broken.parent.mkdir()
    wanted = str(target.relative_to(project.folder))
    path = f"{broken.parent}{os.pathsep}{ENVIRONMENT['PATH']}"
    for behaviour in ("exit 0", "exit 3", "kill -9 $$"):
        broken.write_text(f"#!/bin/sh\n{behaviour}\n")
        broken.chmod(0o755)
        done = project.snakemake(wanted, environment={"PATH": path})
        assert done.returncode == 1, behaviour
        said = re.search(r"dapple: \S*CloudCompare\b.*: found .*; expected ", done.stdout)
        assert said, done.stdout
        assert not target.exists(), behaviour
    project.run(wanted)
    assert target.read_bytes() == expected


def test_a_second_run_in_the_same_folder_is_told_to_wait(tmp_path):
    project = copy_of_project(tmp_path / "dapple", overrides=LITTLE)
    command = [sys.executable, "-m", "snakemake", "--cores", "1", "--configfile", SMALL]
    first = subprocess.Popen(
        [*command, "--config", *LITTLE],
        cwd=project.folder,
        env=ENVIRONMENT,
        start_new_session=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    for line in first.stdout:
        if "Execute" in line:
            break
    second = project.snakemake()
    os.killpg(first.pid, signal.SIGKILL)
    first.communicate(timeout=60)
    assert second.returncode == 1
    assert "Directory cannot be locked" in second.stdout
