"""What tests of the whole workflow share."""

import pytest
from tests.workflow.project import copy_of_project


@pytest.fixture(scope="session")
def small_run(tmp_path_factory):
    """The whole chain in a small virtual world, run once for all tests; not to be edited."""
    project = copy_of_project(tmp_path_factory.mktemp("small") / "dapple")
    project.run()
    return project


@pytest.fixture
def project(tmp_path):
    """A copy of the project without results, to be edited and broken."""
    return copy_of_project(tmp_path / "dapple")
