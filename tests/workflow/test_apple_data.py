"""A clone of the authors' repository becomes the data of the published tree."""

import re
import subprocess

import numpy as np
import pytest
from tests.workflow.project import ROOT, copy_of_project

from dapple.formats import clouds, meshes
from dapple.formats.clouds import LEAF, WOOD, Cloud

CLEAR = "radiation={kind: clear_sky, path: ''}"
SQUARE = "v {x} 0 0\nv {x} 1 0\nv {x} 1 1\nv {x} 0 1\n"


def polygons(path, n, backs):
    """Squares in the form of the authors' files."""
    lines = ["# File created with R write_obj\nmtllib Malus_domestica.mtl\no object1\n"]
    for k in range(n):
        corners = [4 * k + one for one in (1, 2, 3, 4)]
        lines.append(SQUARE.format(x=-0.1 * k))
        lines += [
            f"f {' '.join(map(str, order))}\n" for order in ([corners, corners[::-1]][: 1 + backs])
        ]
    path.write_text("".join(lines))


@pytest.fixture
def clone(tmp_path):
    """The files of the repository that the experiment needs, with few values."""
    data = tmp_path / "dotshadow/data"
    data.mkdir(parents=True)
    polygons(data / "bark.obj", 3, backs=False)
    (data / "sensor_coordinates.csv").write_text(
        '"","label","X","Y","Z"\n"1","1_1",410508.15725,5317096.0095,288.6835\n'
    )
    (data / "par_clean.csv").write_text(
        "sensor_temp_c,time_utc,channel,par_uV,logger,par_umolm2s,structure\n"
        "35.25,2023-08-10 10:10:00,1,30656,1,153.28,1\n"
    )
    return data.parent


def laid_out(clone, folder):
    done = subprocess.run(
        [ROOT / "tools/apple-data", clone, folder], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert f"data_dir={folder}" in done.stdout
    return folder / "apple"


def test_leaf_polygons_of_the_clone_are_taken_instead_of_virtual_leaves(clone, tmp_path):
    polygons(clone / "data/leaves.obj", 5, backs=True)
    apple = laid_out(clone, tmp_path / "real")
    project = copy_of_project(tmp_path / "dapple", "config/apple.yaml", experiment="apple")
    config = [f"data_dir={apple.parent}", CLEAR]
    planned = project.planned(config=config)
    assert "real_leaves" in planned
    assert "virtual_leaves" not in planned
    project.run(
        "results/apple/structure/polygons/leaves_0.ply", config=[f"data_dir={apple.parent}", CLEAR]
    )
    assert meshes.read_ply(project.result("structure/polygons/leaves_0.ply")).n_elements == 5


def test_without_leaves_in_the_clone_they_are_virtual(clone, tmp_path):
    apple = laid_out(clone, tmp_path / "bare")
    assert {path.name for path in apple.iterdir()} == {
        "bark.obj",
        "par.csv",
        "sensor_coordinates.csv",
    }
    project = copy_of_project(tmp_path / "dapple", "config/apple.yaml", experiment="apple")
    assert "virtual_leaves" in project.planned(config=[f"data_dir={apple.parent}", CLEAR])


def test_leaf_points_of_the_clone_become_polygons(clone, tmp_path):
    rng = np.random.default_rng(1)
    xyz = rng.uniform([0, 0, 2], [0.5, 0.5, 2.5], (4000, 3))
    classes = np.where(np.arange(4000) % 4 == 0, WOOD, LEAF).astype(np.uint8)
    clouds.write(clone / "data/tree.laz", Cloud(xyz, attributes={"Classification": classes}))
    apple = laid_out(clone, tmp_path / "points")
    leaves = meshes.read_obj(apple / "leaves.obj", axes="less")
    assert leaves.n_elements > 500
    assert leaves.vertices_m.min(axis=0) == pytest.approx([0, 0, 2], abs=0.1)


def test_another_folder_is_no_clone(tmp_path):
    done = subprocess.run([ROOT / "tools/apple-data", tmp_path], capture_output=True, text=True)
    assert done.returncode == 1
    assert "found no bark.obj" in done.stderr
    assert "git clone" in done.stderr


def test_without_data_the_message_names_the_command(tmp_path):
    project = copy_of_project(tmp_path / "dapple", "config/apple.yaml", experiment="apple")
    done = project.snakemake("--dry-run", config=["data_dir=/nonexistent"])
    assert done.returncode == 1
    assert re.search(r"/nonexistent/apple/\S+: found no such file", done.stdout)
    assert "tools/apple-data CLONE" in done.stdout
