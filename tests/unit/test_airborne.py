"""A rough canopy from above."""

import numpy as np
import pytest

from dapple.errors import InputError
from dapple.survey.airborne import canopy_density


def test_an_even_canopy_stops_pulses_by_beers_law():
    rng = np.random.default_rng(1)
    n, density, top_m = 200_000, 0.4, 6.0
    depth_m = rng.exponential(1 / (0.5 * density), n)
    height_m = np.maximum(top_m - depth_m, 0.0)
    found, corner_m = canopy_density(rng.uniform(3.0, 5.0, (n, 2)), height_m, np.ones(n))
    assert corner_m.tolist() == [3.0, 3.0]
    assert found.shape == (2, 2, 6)
    # the lowest layer's lower half is taken for ground
    assert found[:, :, 1:] == pytest.approx(density, rel=0.06)


def test_returns_of_one_pulse_share_its_energy():
    height_m, weight = np.array([3.5, 0.0]), np.array([0.5, 0.5])
    found, _ = canopy_density(np.full((2, 2), 0.5), height_m, weight)
    assert found[0, 0] == pytest.approx([0, 0, 0, 2 * np.log(2)])


def test_ground_alone_is_no_canopy():
    with pytest.raises(InputError, match=r"survey\.canopy"):
        canopy_density(np.zeros((3, 2)), np.zeros(3), np.ones(3))
