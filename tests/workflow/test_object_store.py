"""Results in an object store, and the profile for clusters that share no disk."""

import subprocess
import sys

import boto3
import pytest
from moto.server import ThreadedMotoServer
from tests.workflow.project import ENVIRONMENT, ROOT, SMALL, copy_of_project, jobs

KEYS = {"aws_access_key_id": "nobody", "aws_secret_access_key": "nothing"}
BUCKET = "dapple"
CHEAP = "results/virtual-apple-small/structure/truth/summary.json"


@pytest.fixture
def store():
    """An object store on this machine with an empty bucket, and what tells its address."""
    server = ThreadedMotoServer("127.0.0.1", 0, verbose=False)
    server.start()
    url = "http://{}:{}".format(*server.get_host_and_port())
    client = boto3.client("s3", endpoint_url=url, region_name="us-east-1", **KEYS)
    client.create_bucket(Bucket=BUCKET)
    told = {
        "SNAKEMAKE_STORAGE_S3_ENDPOINT_URL": url,
        "SNAKEMAKE_STORAGE_S3_ACCESS_KEY": KEYS["aws_access_key_id"],
        "SNAKEMAKE_STORAGE_S3_SECRET_KEY": KEYS["aws_secret_access_key"],
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    yield client, told
    server.stop()


@pytest.mark.long
def test_results_lie_in_a_bucket_and_are_found_there_again(store, tmp_path):
    client, told = store
    project = copy_of_project(tmp_path / "dapple")
    arguments = ("--default-storage-provider", "s3", "--default-storage-prefix", f"s3://{BUCKET}")
    project.run(*arguments, CHEAP, cores=1, environment=told)
    found = {one["Key"] for one in client.list_objects_v2(Bucket=BUCKET)["Contents"]}
    assert CHEAP in found
    assert not project.result("structure/truth/summary.json").exists()
    again = project.run("--dry-run", *arguments, CHEAP, cores=1, environment=told)
    assert "Nothing to be done" in again


def test_the_profile_of_kubernetes_plans_the_whole_run(store, tmp_path):
    done = subprocess.run(
        [sys.executable, "-m", "snakemake", "--profile", "profiles/kubernetes", "--configfile",
         SMALL, "--dry-run", "--quiet", "rules"],
        cwd=ROOT,
        env=ENVIRONMENT | store[1],
        capture_output=True,
        text=True,
        timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-3000:]
    assert {"scan", "light", "page"} <= jobs(done.stdout + done.stderr)
