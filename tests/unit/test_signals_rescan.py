"""Signals of the scan's own shots, fired once more at what was built from them."""

import math

import numpy as np
import pytest
from tests.unit.test_signals import a_run, rng

from dapple.formats import shots as shot_files
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh, empty
from dapple.verdict import (
    signals,
    signals_rescan,
)
from dapple.verdict.run_data import RunData
from dapple.virtual import rescan, scanner


def wall(share):
    """Squares of 5 cm, 1 m high and 2 m wide, of which some are missing."""
    rows, columns = (one.ravel() for one in np.meshgrid(np.arange(20), np.arange(40)))
    is_there = np.random.default_rng(2).random(len(rows)) < share
    corner = np.stack([0.05 * columns, np.full(len(rows), 1.0), 0.5 + 0.05 * rows], 1)[is_there]
    square = np.array([[0, 0, 0], [0.05, 0, 0], [0.05, 0, 0.05], [0, 0, 0.05]])
    n = len(corner)
    faces = 4 * np.arange(n)[:, None, None] + np.array([[0, 1, 2], [0, 2, 3]])
    return Mesh(
        (corner[:, None] + square).reshape(-1, 3),
        faces.reshape(-1, 3).astype(np.int32),
        np.repeat(np.arange(n, dtype=np.int32), 2),
    )


@pytest.fixture(scope="module")
def scanned_wall():
    """A wall half of which is open, seen from 6 m, and its points."""
    leaves = wall(0.5)
    fired = scanner.scan(
        {"leaf": leaves},
        np.array([[1.0, -5.0, 1.0]]),
        angular_step_deg=0.1,
        noise_points_per_shot=0.0,
        seed=1,
    )
    cloud = shot_files.to_cloud(fired)
    kinds = np.full(len(cloud), 4, np.uint8)
    return (
        leaves,
        fired,
        Cloud(cloud.xyz_m, attributes=cloud.attributes | {"Classification": kinds}),
    )


def test_what_was_scanned_lets_the_scans_own_shots_through_and_a_closed_wall_does_not(scanned_wall):
    leaves, fired, cloud = scanned_wall
    run = RunData(shots=fired, cloud=cloud, leaves=leaves, wood=empty(), surfels=wall(1.0))
    told = signals.measure(run)
    assert told["gap_error_polygons"] < 0.12
    assert told["gap_error_surfels"] == pytest.approx(0.5, abs=0.2)
    assert math.isnan(told["gap_error_fine"])


def test_whole_patches_of_shots_are_fired_again_and_only_those_that_meet_the_plant(scanned_wall):
    _, fired, cloud = scanned_wall
    crown = rescan.crown_of(cloud)
    some = signals_rescan.some_patches(fired, crown, rng())
    assert 0 < len(some) <= signals_rescan.MOST_SHOTS
    again = signals_rescan.some_patches(some, crown, rng())
    assert len(again) == len(some)


def test_shots_that_tell_nothing_of_discs_are_none(scanned_wall):
    leaves, fired, cloud = scanned_wall
    run = RunData(fired, cloud, empty(), empty(), surfels=leaves, surfel_facts={"hit_share": None})
    assert signals.measure(run)["shots_per_surfel"] == 0.0
    told = signals.measure(a_run(surfels=leaves, surfel_facts={"without_surface": 0.2}))
    assert math.isnan(told["shots_per_surfel"])
    assert told["surfels_without_surface"] == 0.2
