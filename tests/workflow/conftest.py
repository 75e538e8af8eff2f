"""What tests of the whole workflow share."""

from pathlib import Path

import pytest
from tests.workflow.project import copy_of_project


@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(items):
    """Tests that share a run stay in one process, where tests are spread over several."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            shares = "small_run" if "small_run" in item.fixturenames else item.path.stem
            item.add_marker(pytest.mark.xdist_group(shares))


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
