"""What tests of the whole workflow share."""

import fcntl

import pytest
from tests.workflow.project import Project, copy_of_project


@pytest.fixture(scope="session")
def small_run(tmp_path_factory, worker_id):
    """The whole chain in a small virtual world, run once for all tests; not to be edited."""
    shared = tmp_path_factory.getbasetemp()
    if worker_id != "master":  # tests are spread over processes: one runs it, others wait
        shared = shared.parent
    with (shared / "small.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if (shared / "small.done").exists():
            return Project(shared / "small/dapple")
        project = copy_of_project(shared / "small/dapple")
        project.run()
        (shared / "small.done").touch()
    return project


@pytest.fixture
def project(tmp_path):
    """A copy of the project without results, to be edited and broken."""
    return copy_of_project(tmp_path / "dapple")
