"""A whole run on a real Slurm of one node; jobs that are cancelled, fail or lack memory."""

import json
import os
import re
import subprocess
import sys
import threading
import time

import pytest
import yaml
from tests.workflow import slurm
from tests.workflow.project import ROOT, SMALL, copy_of_project

PROFILE = yaml.safe_load((ROOT / "profiles/slurm/config.v9+.yaml").read_text())
ARGUMENTS = ("--profile", "profiles/slurm", "--nocolor", "--configfile", SMALL)
ONE_NODE = ("--cores", "2", "--default-resources", "slurm_partition=debug", "mem_mb=1000")
LITTLE = ("--config", "reconstructions=[polygons]", "light={check: false}", "measured={kind: none}")


@pytest.fixture
def cluster(tmp_path):
    if lacking := slurm.lacking():
        pytest.skip(lacking)
    with slurm.cluster(tmp_path / "slurm") as environment:
        yield environment


def started(folder, environment, *targets):
    command = [sys.executable, "-m", "snakemake", *ARGUMENTS, *ONE_NODE, *LITTLE, "--", *targets]
    return subprocess.Popen(
        command,
        cwd=folder,
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )


SUBMISSIONS = """
import json
import sys
from pathlib import Path

import yaml
from snakemake.api import SnakemakeApi
from snakemake.settings.types import (
    ConfigSettings, GroupSettings, OutputSettings, Quietness, ResourceSettings,
)

profile = yaml.safe_load(Path("profiles/slurm/config.v9+.yaml").read_text())
groups = GroupSettings(profile["groups"], profile["group-components"])
resources = ResourceSettings(
    cores=profile["cores"], nodes=profile["jobs"], max_threads=profile["max-threads"],
    resources=profile["resources"], overwrite_resources=profile["set-resources"],
)
quiet = OutputSettings(dryrun=True, quiet={Quietness.ALL}, enable_file_logging=False)
with SnakemakeApi(quiet) as api:
    asked = api.workflow(
        resources,
        config_settings=ConfigSettings(
            configfiles=[Path(sys.argv[1])], config=json.loads(sys.argv[2])
        ),
        snakefile=Path("Snakefile"),
    )
    asked.dag().execute_workflow(executor="dryrun", group_settings=groups)
    dag = asked._workflow.dag
    found = [(job, dag.get_job_group(job) or job) for job in dag.needrun_jobs(False)]
    sent = {id(group) for job, group in found if job.output}
    print([len(found), len(sent)])
"""
"""Counts jobs and submissions to Slurm."""


def jobs(said):
    return re.findall(r"submitted with SLURM jobid (\d+)", said)


def test_every_step_of_a_run_belongs_to_a_group_of_jobs():
    listed = subprocess.run(
        [
            sys.executable,
            "-m",
            "snakemake",
            "--cores",
            "1",
            "--dry-run",
            "--quiet",
            "rules",
            "--forceall",
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    rules = set(re.findall(r"^(\w+) +\d+$", listed.stdout + listed.stderr, re.MULTILINE))
    assert rules - set(PROFILE["groups"]) - {"all", "total"} == set()


@pytest.mark.long
def test_a_run_is_at_most_eight_jobs(cluster, tmp_path):
    folder = copy_of_project(tmp_path / "dapple").folder
    said, _ = started(folder, cluster).communicate(timeout=1200)
    assert "(100%) done" in said, said[-4000:]
    assert (folder / "results/virtual-apple-small/report.html").is_file()
    assert len(jobs(said)) <= 8


@pytest.mark.long
def test_a_thousand_jobs_of_light_are_few_submissions():
    every_minute = {
        "time": {"step_min": 1},
        "light": {"timestep": {"step_min": 1, "times_per_job": 1}},
    }
    done = subprocess.run(
        [sys.executable, "-c", SUBMISSIONS, SMALL, json.dumps(every_minute)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=1200,
    )
    assert done.returncode == 0, done.stderr[-3000:]
    n_jobs, n_submissions = json.loads(done.stdout.splitlines()[-1])
    assert n_jobs > 1000
    assert n_submissions <= 50


@pytest.mark.long
def test_a_job_that_is_cancelled_is_reported_and_run_again(cluster, tmp_path):
    folder = copy_of_project(tmp_path / "dapple").folder
    run = started(folder, cluster, "results/virtual-apple-small/classes/cloud.laz")
    cancel = threading.Thread(target=_cancel_first, args=(cluster,))
    cancel.start()
    said, _ = run.communicate(timeout=1200)
    cancel.join()
    assert "CANCELLED" in said
    assert len(jobs(said)) == 2
    assert "(100%) done" in said, said[-4000:]


def _cancel_first(environment):
    for _ in range(300):
        running = subprocess.run(
            ["squeue", "-h", "-t", "R", "-o", "%A"], env=environment, capture_output=True, text=True
        ).stdout.split()
        if running:
            subprocess.run(["scancel", running[0]], env=environment, check=True)
            return
        time.sleep(0.5)


@pytest.mark.long
def test_a_job_without_enough_memory_is_killed_and_gets_more_at_the_next_attempt(tmp_path):
    if lacking := slurm.lacking():
        pytest.skip(lacking)
    folder = copy_of_project(tmp_path / "dapple").folder
    script, rules = folder / "scripts/plant.py", folder / "rules/scan.smk"
    # 900 MB, and a while for Slurm to see it.
    greedy = (
        "def main(snakemake):\n    held = b'x' * 900_000_000\n    time.sleep(8)\n    del held\n"
    )
    script.write_text(
        script.read_text()
        .replace("def main(snakemake):\n", greedy)
        .replace('"""\n', '"""\n\nimport time\n', 1)
    )
    text = rules.read_text()
    rules.write_text(re.sub(r"(rule plant:.*?memory\()\d+", r"\g<1>900", text, flags=re.DOTALL))
    with slurm.cluster(tmp_path / "slurm", is_limited=True) as environment:
        run = started(
            folder, environment, "results/virtual-apple-small/structure/truth/leaves_0.ply"
        )
        said, _ = run.communicate(timeout=600)
    assert len(jobs(said)) == 2, said[-6000:]
    assert re.search("OUT_OF_ME|CANCELLED|FAILED", said)
    assert "(100%) done" in said, said[-4000:]


@pytest.mark.long
def test_a_submission_that_fails_is_reported_and_made_again(cluster, tmp_path):
    folder = copy_of_project(tmp_path / "dapple").folder
    broken = tmp_path / "bin/sbatch"
    broken.parent.mkdir()
    real = subprocess.run(["which", "sbatch"], capture_output=True, text=True).stdout.strip()
    broken.write_text(
        f'#!/bin/sh\n[ -e {tmp_path}/once ] && exec {real} "$@"\n'
        f"touch {tmp_path}/once\necho 'sbatch: error: the controller does not answer' >&2\nexit 1\n"
    )
    broken.chmod(0o755)
    environment = cluster | {"PATH": f"{broken.parent}{os.pathsep}{cluster['PATH']}"}
    run = started(folder, environment, "results/virtual-apple-small/classes/cloud.laz")
    said, _ = run.communicate(timeout=1200)
    # What sbatch said, Snakemake leaves out where steps are grouped.
    assert "Error in group cloud" in said
    assert len(jobs(said)) == 1
    assert "(100%) done" in said, said[-4000:]
