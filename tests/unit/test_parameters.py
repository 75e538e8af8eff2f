import numpy as np
import pandas as pd
import pytest

from dapple.config.chlorophyll import Retrieval
from dapple.errors import InputError
from dapple.optics import soil
from dapple.optics.cameras import ZHAO
from dapple.retrieval import parameters
from dapple.retrieval.parameters import Range
from dapple.retrieval.spectra import spectra

CONFIGURED = Retrieval()
VARIED = (
    "n",
    "chlorophyll_ug_cm2",
    "dry_matter_g_cm2",
    "brown",
    "soil_brightness",
    "soil_moisture",
    "chlorophyll_per_carotenoid",
    "water_cm",
    "shoot_recollision",
    "aerosol_optical_depth",
)
TABLE = {name: Range(*getattr(CONFIGURED, name)) for name in VARIED}


def draw(n, *, seed, **changed):
    """As configured by default, but for what is changed."""
    names = ("jitter_steps", "anthocyanin_per_chlorophyll")
    settings = {name: getattr(CONFIGURED, name) for name in names} | {"table": TABLE}
    return parameters.draw(n, seed=seed, **settings | changed)


def test_every_parameter_stays_in_its_range_and_reaches_both_ends():
    drawn = draw(500, seed=1)
    for name, bounds in TABLE.items():
        assert drawn[name].between(bounds.low, bounds.high).all()
        assert drawn[name].min() < bounds.low + 0.5 * bounds.step
        assert drawn[name].max() > bounds.high - 0.5 * bounds.step


def test_without_jitter_every_level_comes_equally_often():
    drawn = draw(520, seed=2, jitter_steps=0.0)
    counts = drawn["chlorophyll_ug_cm2"].value_counts()
    assert sorted(counts.index) == pytest.approx(np.arange(10.0, 71.0, 5.0))
    assert (counts == 40).all()


def test_the_jitter_is_gaussian_with_half_a_step_and_cut_off_at_the_bounds():
    n = 40_000
    drawn = draw(n, seed=3, table=TABLE | {"n": Range(0.0, 1.0, 2)})["n"]
    # Levels 0 and 1, deviation 0.5: a half of those at 0 falls below it, and 2.28 % of those at 1.
    assert (drawn == 0.0).mean() == pytest.approx(0.5 * (0.5 + 0.02275), abs=0.008)
    assert (drawn == 1.0).mean() == pytest.approx(0.5 * (0.5 + 0.02275), abs=0.008)
    middle = draw(n, seed=3, table=TABLE | {"n": Range(0.0, 200.0, 3)})["n"] - 100.0
    near = middle[middle.abs() < 25]  # a half of a deviation around the middle level
    assert len(near) / n == pytest.approx((0.3829 + 2 * 0.0606) / 3, abs=0.01)


def test_parameters_do_not_depend_on_each_other_but_other_pigments_follow_chlorophyll():
    drawn = draw(4000, seed=4)
    correlation = drawn[list(TABLE)].corr().to_numpy() - np.eye(len(TABLE))
    assert np.abs(correlation).max() < 4.5 / 4000**0.5
    ratio = drawn["chlorophyll_ug_cm2"] / drawn["carotenoids_ug_cm2"]
    assert (ratio - drawn["chlorophyll_per_carotenoid"]).abs().max() < 1e-9
    assert (drawn["anthocyanin_ug_cm2"] / drawn["chlorophyll_ug_cm2"] - 0.043).abs().max() < 1e-9


def test_a_seed_gives_the_same_combinations_and_another_seed_others():
    first = draw(50, seed=5)
    pd.testing.assert_frame_equal(first, draw(50, seed=5))
    assert not first.equals(draw(50, seed=6))


def test_no_combinations_and_ranges_that_run_backwards_are_refused():
    with pytest.raises(InputError, match="combinations"):
        draw(0, seed=1)
    with pytest.raises(InputError, match="range of n"):
        draw(5, seed=1, table={"n": Range(2.0, 1.0, 3)})


def test_spectra_of_all_combinations_are_possible_ones():
    drawn = draw(40, seed=7)
    found = spectra(drawn, soil.two_soils(ZHAO), ZHAO)
    assert len(found) == 40
    for values in (found.leaf_reflectance, found.leaf_transmittance, found.soil_reflectance):
        assert values.shape == (40, 5)
        assert ((values >= 0) & (values <= 1)).all()
    assert (found.leaf_reflectance + found.leaf_transmittance < 1).all()
