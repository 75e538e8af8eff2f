"""Data that lie on a server come by themselves, and only as their checksums say."""

import hashlib
import shutil
import threading
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
import yaml
from tests.workflow.project import ROOT, copy_of_project

FILES = ("tree.laz", "sensors.csv", "par.csv", "radiation.csv")


@pytest.fixture
def server(tmp_path):
    """A folder that is served on this machine, and its address."""
    folder = tmp_path / "served"
    shutil.copytree(ROOT / "config/example", folder)
    http = ThreadingHTTPServer(
        ("127.0.0.1", 0), partial(SimpleHTTPRequestHandler, directory=folder)
    )
    thread = threading.Thread(target=http.serve_forever, daemon=True)
    thread.start()
    yield folder, f"http://127.0.0.1:{http.server_address[1]}"
    http.shutdown()
    http.server_close()
    thread.join()


@pytest.fixture
def project(tmp_path, server):
    """The example, whose data lie on the server alone."""
    folder, url = server
    project = copy_of_project(tmp_path / "dapple", "config/example.yaml", experiment="example")
    shutil.rmtree(project.folder / "config/example")
    sums = [f"{hashlib.sha256((folder / name).read_bytes()).hexdigest()}  {name}" for name in FILES]
    path = project.folder / project.configfile
    settings = yaml.safe_load(path.read_text())
    settings |= {"data_dir": "data", "download": {"url": url, "files": sums}}
    path.write_text(yaml.safe_dump(settings, sort_keys=False))
    return project


def test_files_that_are_missing_are_fetched_and_those_that_are_there_stay(project, server):
    own = project.folder / "data/radiation.csv"
    own.parent.mkdir()
    own.write_text("mine\n")
    project.run("data/par.csv", "data/sensors.csv", cores=1)
    for name in ("par.csv", "sensors.csv"):
        assert (project.folder / "data" / name).read_bytes() == (server[0] / name).read_bytes()
    assert own.read_text() == "mine\n"
    # The cloud is still to come, and nothing else.
    assert {one for one in project.planned() if one.startswith("download")} == {"download_0"}


def test_a_file_that_is_not_what_its_checksum_says_is_not_taken(project, server):
    (server[0] / "par.csv").write_text("another file\n")
    done = project.snakemake("data/par.csv", cores=1)
    assert done.returncode != 0
    assert "checksum" in done.stdout.lower()
    assert not (project.folder / "data/par.csv").exists()


def test_a_configuration_that_names_no_server_asks_for_the_file(project):
    done = project.snakemake("--dry-run", config=["download={url: ''}"])
    assert done.returncode != 0
    assert "data/tree.laz: found no such file" in done.stdout
