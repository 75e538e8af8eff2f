"""The scanner of LESS 3 sees walls, edges and gaps as geometry says it must."""

from importlib.util import find_spec

import numpy as np
import pytest
from tests.unit.test_scanner import HERE, STILL, rectangle

from dapple.formats.meshes import concatenate
from dapple.virtual.scanner import scan

pytestmark = pytest.mark.skipif(find_spec("less") is None, reason="less3d is not installed")
STEP_M = 0.015
"""In which LESS gives ranges here."""


def by_less(meshes, **options):
    return scan(meshes, HERE, seed=1, program="less", **STILL | {"angular_step_deg": 0.5} | options)


def test_a_wall_is_where_it_is_as_bright_as_it_is_and_every_shot_meets_it_once():
    wall = rectangle([0, 5, 0], [0.5, 0, 0], [0, 0, 0.5])
    shots = by_less({"wood": wall})
    assert len(shots) > 300
    inside = np.abs(5.0 * shots.direction[:, [0, 2]] / shots.direction[:, [1]]).max(axis=1) < 0.49
    assert (shots.n_returns[inside] == 1).all()
    # the pulse is spread by the beam's slant too
    assert shots.return_xyz_m[:, 1] == pytest.approx(5.0, abs=STEP_M)
    cosine = shots.direction[shots.shot_of_return, 1]
    seen_db = shots.reflectance_db - 10 * np.log10(cosine)
    whole = inside[shots.shot_of_return]
    assert np.median(seen_db[whole]) == pytest.approx(-3.0, abs=0.05)
    assert np.abs(seen_db[whole] + 3.0).max() < 0.3
    assert set(shots.truth) == {0}


def test_a_slanted_plate_is_darker_by_the_cosine_at_any_range():
    slanted = {
        far: rectangle([0, far, 0], [0.5, 0.5 * 3**0.5, 0], [0, 0, 0.3]) for far in (4.0, 12.0)
    }
    for far, plate in slanted.items():
        shots = by_less({"leaf": plate}, angular_step_deg=0.2)
        towards = np.abs(shots.direction @ np.array([3**0.5 / 2, -0.5, 0.0]))
        central = np.flatnonzero(np.abs(shots.direction[:, 0]) * far < 0.05)
        returns = np.isin(shots.shot_of_return, central)
        expected = -8.0 + 10 * np.log10(towards[shots.shot_of_return[returns]])
        assert np.median(shots.reflectance_db[returns] - expected) == pytest.approx(0, abs=0.2)
        assert set(shots.truth) == {4}


def test_a_shot_through_a_gap_is_a_miss_and_one_on_an_edge_has_two_returns():
    left = rectangle([-0.2, 5, 0], [0.1, 0, 0], [0, 0, 0.03])
    right = rectangle([0.2, 8, 0], [0.1, 0, 0], [0, 0, 0.03])
    behind = rectangle([-0.3, 7, 0], [0.2, 0, 0], [0, 0, 0.05])
    shots = by_less(
        {"leaf": concatenate([left, right]), "wood": behind},
        angular_step_deg=0.05,
        beam_divergence_mrad=4.0,
        sub_rays=64,
    )
    aside = shots.direction[:, 0] / shots.direction[:, 1]
    level = np.abs(shots.direction[:, 2]) < 1e-4
    gap = level & (np.abs(aside) < 0.008)
    assert gap.any()
    assert (shots.n_returns[gap] == 0).all()
    # the eastern edge of the left plate, 2 m in front of the wood
    edge = level & (np.abs(aside + 0.02) < 0.0005)
    assert edge.any()
    assert (shots.n_returns[edge] == 2).all()
    first = shots.first[:-1][edge]
    assert shots.range_m[first] == pytest.approx(5.0, abs=STEP_M)
    assert shots.range_m[first + 1] == pytest.approx(7.0, abs=STEP_M)
    assert set(shots.truth[first]) == {4}
    assert set(shots.truth[first + 1]) == {0}
    # what one return lacks, the other has
    share = 10 ** (0.1 * (shots.reflectance_db[first] + 8.0))
    other = 10 ** (0.1 * (shots.reflectance_db[first + 1] + 3.0))
    assert share + other == pytest.approx(1.0, abs=0.05)
    assert np.isnan(shots.deviation).all()


def test_the_ground_is_under_the_plant():
    plant = rectangle([0, 3, 0], [1, 0, 0], [0, 0, 1])
    shots = by_less({"wood": plant}, ground_z_m=-0.8, window_margin_m=0.5)
    ground = shots.truth == 2
    assert ground.any()
    assert shots.return_xyz_m[ground, 2] == pytest.approx(-0.8, abs=STEP_M)
