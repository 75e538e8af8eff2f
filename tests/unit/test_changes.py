"""Changes cost the files that CONTRIBUTING says: registries are extended in a copy and asked."""

import json
import re
import shutil
import subprocess
import sys

import pytest

from dapple.code_use import SCRIPTS

ROOT = SCRIPTS.parent
ROW = re.compile(r"^\| ([^|]+) \| (\d+)[^|]* \| (.+) \|$", re.MULTILINE)
FILE = re.compile(r"`([\w./-]+\.\w+|Snakefile)`")
FOLDERS = ("scripts/", "rules/", "config/", "docs/", "Snakefile")
BY_NAME = """

def _mine():
    from dapple.{module} import mine

    return mine


{registry}["mine"] = {entry}
"""
EDITS = {
    "structure/densities.py": "\n\ndef mine(sums):\n    return fpl(sums)\n",
    "structure/pad_estimators.py": BY_NAME.format(
        module="structure.densities", registry="ESTIMATORS", entry='Estimator("mine", _mine)'
    ),
    "formats/cloud_mine.py": "from dapple.formats.cloud_text import read as read\n",
    "formats/clouds.py": "\nfrom dapple.formats import cloud_mine\n"
    'READERS[".mine"] = cloud_mine.read\n',
    "sky/models/mine.py": "from dapple.sky.models.isotropic import *\n",
    "cloud/by_height.py": "def mine(cloud, settings, seed):\n"
    "    return cloud.xyz_m[:, 2] > 1, {}\n",
    "cloud/classifiers.py": BY_NAME.format(
        module="cloud.by_height", registry="CLASSIFIERS", entry='Classifier("mine", (), _mine)'
    ),
}
ASK = """
import json, sys
from dapple.cloud.classify import classify
from dapple.config.settings import validate
from dapple.formats import clouds
from dapple.optics.cameras import camera
from dapple.sky import models
from dapple.structure.pad_estimators import ESTIMATORS

bands = [["red", 660, 10], ["near_infrared", 800, 10], ["mine", 730, 10]]
settings = validate(
    {
        "experiment": "mine",
        "radiation": {"sky": "mine"},
        "voxels": {"estimator": "mine"},
        "classify": {"method": "mine"},
        "chlorophyll": {"bands": bands},
    }
)
cloud = clouds.read(sys.argv[1])
classified, _ = classify(cloud, settings.classify.method, majority_voxel_m=0.0001)
print(json.dumps({
    "estimator": ESTIMATORS[settings.voxels.estimator].load().__name__,
    "format": len(cloud),
    "sky": models.find(settings.radiation.sky).__name__,
    "classifier": classified.attributes["Classification"].tolist(),
    "band": camera(settings.chlorophyll.bands).names[-1],
}))
"""


@pytest.fixture(scope="module")
def found(tmp_path_factory):
    """What dapple makes of the changes."""
    folder = tmp_path_factory.mktemp("changed")
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(SCRIPTS / "dapple", folder / "dapple", ignore=ignore)
    for name, text in EDITS.items():
        with (folder / "dapple" / name).open("a") as file:
            file.write(text)
    (folder / "tree.mine").write_text("X Y Z\n0 0 0.5\n0 0 1.5\n")
    done = subprocess.run(
        [sys.executable, "-c", ASK, "tree.mine"], cwd=folder, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr[-3000:]
    return json.loads(done.stdout)


@pytest.mark.parametrize(
    ("change", "answer"),
    [
        ("estimator", "mine"),
        ("format", 2),
        ("sky", "dapple.sky.models.mine"),
        ("classifier", [0, 4]),
        ("band", "mine"),
    ],
)
def test_a_change_needs_no_other_file(found, change, answer):
    assert found[change] == answer


def rows():
    """Change, number of files and files of every row of the table."""
    text = (ROOT / "CONTRIBUTING.md").read_text()
    table = text[text.index("| change | files |") : text.index("## Numbers")]
    return {change: (int(n), FILE.findall(files)) for change, n, files in ROW.findall(table)}


def test_every_file_that_is_named_exists_and_all_are_counted():
    assert len(rows()) >= 12
    for change, (number, files) in rows().items():
        named = [file for file in files if file.startswith(FOLDERS)]
        assert [file for file in named if not (ROOT / file).is_file()] == [], change
        assert len(named) == number, change
