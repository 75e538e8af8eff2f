"""External programs that fail, hang, vanish or lie: named in one message, and nothing is taken."""

import time

import numpy as np
import pytest

from dapple import pdal, programs
from dapple.cloud import cloudcompare, outliers
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.light import less_engine, less_files

XYZ = np.random.default_rng(1).uniform(0, 1, (50, 3))
SQUARE = Mesh(
    np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0]]), np.array([[0, 1, 2]], np.int32), np.zeros(1)
)
PLY = (
    "ply\nformat binary_little_endian 1.0\nelement vertex {n}\nproperty float x\nproperty float y\n"
    "property float z\n{more}end_header\n"
)
ROWS = "property float scalar_RowHigh\nproperty float scalar_RowLow\n"


def writing(text):
    """A shell line that writes to what CloudCompare saves or PDAL's pipeline names."""
    quoted = text.replace("\n", "\\n")
    return (
        'for last in "$@"; do :; done\n'
        'case "$last" in *.json) last=$(sed "s/.*\\"filename\\": \\"\\([^\\"]*kept.las\\).*/\\1/" '
        '"$last");; esac\n'
        f"printf '{quoted}' > \"$last\"\n"
    )


BEHAVIOURS = {
    "exit 3": ("echo out of luck >&2; exit 3", r"exit code 3: out of luck"),
    "killed": ("kill -9 $$", r"exit code -9"),
    "hangs": ("exec sleep 60", r"no end after"),
    "no output": ("exit 0", r"no output file"),
    "empty output": (writing(""), r"no output file"),
    "not its format": (writing("no such thing\n"), r"cannot be read|header without end"),
}


def stand_in(folder, name, script):
    """A program of that name that does something else."""
    path = folder / name
    path.write_text(f"#!/bin/sh\n{script}\n")
    path.chmod(0o755)
    return str(path)


CALLS = {
    "outliers by CloudCompare": ("CloudCompare", lambda program: cloudcompare.CommandLine(
        program).inliers(XYZ, 8, 3.0)),
    "distances by CloudCompare": ("CloudCompare", lambda program: cloudcompare.CommandLine(
        program).distance_to_mesh(XYZ, SQUARE)),
    "outliers by PDAL": ("pdal", lambda program: outliers._by_pdal(XYZ, 8, 3.0, program)),
}  # fmt: skip


@pytest.fixture(autouse=True)
def short(monkeypatch):
    """Programs get half a second."""
    monkeypatch.setattr(programs, "limit_s", lambda n_points: 0.5)


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
@pytest.mark.parametrize("call", CALLS)
def test_a_program_that_does_not_do_its_work_is_named_with_what_it_did(tmp_path, call, behaviour):
    name, work = CALLS[call]
    script, found = BEHAVIOURS[behaviour]
    started = time.monotonic()
    with pytest.raises(InputError, match=found) as error:
        work(stand_in(tmp_path, name, script))
    assert error.value.remedy
    assert time.monotonic() - started < 20


@pytest.mark.parametrize(
    ("header", "found"),
    [
        (PLY.format(n=50, more=ROWS), "0 of 50 points"),
        (PLY.format(n=0, more=""), "no scalar_RowHigh and no scalar_RowLow"),
    ],
)
@pytest.mark.parametrize("call", [name for name in CALLS if "CloudCompare" in name])
def test_points_that_a_program_lost_are_missed(tmp_path, call, header, found):
    with pytest.raises(InputError, match=found):
        CALLS[call][1](stand_in(tmp_path, "CloudCompare", writing(header)))


def test_distances_that_a_program_left_out_are_missed(tmp_path):
    empty = PLY.format(n=0, more=ROWS + "property float scalar_C2M\n")
    program = stand_in(tmp_path, "CloudCompare", writing(empty))
    with pytest.raises(programs.ProgramError, match=r"0 distances.*50 points given"):
        cloudcompare.CommandLine(program).distance_to_mesh(XYZ, SQUARE)


def test_a_cloud_that_pdal_cannot_unpack_leaves_nothing(tmp_path):
    (tmp_path / "a.laz").write_bytes(b"LASF")
    with pytest.raises(programs.ProgramError, match=r"no output file a\.las"):
        pdal.uncompress(tmp_path / "a.laz", tmp_path / "a.las", stand_in(tmp_path, "pdal", ""))
    assert not (tmp_path / "a.las").exists()


def test_less_that_says_nothing_is_a_failure(tmp_path):
    (tmp_path / less_files.RUNNER.name).write_text("")
    with pytest.raises(programs.ProgramError, match=r"no output file light\.csv"):
        less_engine.simulate(tmp_path)
