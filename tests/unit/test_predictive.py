"""Ninety per cent of records lie within the predictive interval, and it is no wider than needed."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from dapple.formats import tables
from dapple.stats import predictive
from dapple.stats.predictive import SensorError

NO_NOISE = SensorError(0.0, 0.0, 0.0, 0.0)
OPEN_SKY = 1000.0
TABLED = tables.read(Path(predictive.__file__).with_name("reconstruction_errors.csv"))


def world(seed, name="polygons", n=20_000):
    """True light, and a simulation that errs by a tenth of the open sky in partial shade alone."""
    rng = np.random.default_rng(seed)
    share = rng.uniform(0.0, 1.0, n)
    error = rng.normal(0.0, 0.1, n) * ((share > 0.25) & (share < 0.8))
    return pd.DataFrame(
        {
            "reconstruction": name,
            "measured": OPEN_SKY * (share + error),
            "simulated": OPEN_SKY * share,
            "baseline": OPEN_SKY,
        }
    )


def held(records, bounds):
    """Share of the records within their bounds."""
    return records["measured"].between(bounds["low"], bounds["high"]).mean()


@pytest.mark.parametrize("noise", [0.0, 0.05, 0.2])
def test_nine_of_ten_records_of_another_world_lie_within_the_bounds(noise):
    """Errors of the reconstruction and of sensors together."""
    records, sensor = world(2), SensorError(noise, noise, 0.02, 2.0)
    rng = np.random.default_rng(3)
    records["measured"] += rng.normal(size=len(records)) * sensor.of(records["measured"])
    bounds = predictive.interval(records, predictive.error_table(world(1)), sensor)
    partial = records["simulated"].between(300, 750)
    assert held(records[partial], bounds[partial]) == pytest.approx(0.9, abs=0.02)
    assert 0.85 <= held(records, bounds) <= 0.95


def test_bounds_are_wide_in_partial_shade_alone():
    records = world(2)
    bounds = predictive.interval(records, predictive.error_table(world(1)), NO_NOISE)
    width = bounds["high"] - bounds["low"]
    deep, partial = records["simulated"] < 100, records["simulated"].between(350, 700)
    assert width[partial].mean() == pytest.approx(2 * 0.1 * 1.645 * OPEN_SKY, rel=0.1)
    assert width[deep].max() < 1


def test_the_true_tree_errs_by_the_sensor_alone_and_what_is_not_known_has_no_bounds():
    errors = predictive.error_table(world(1))
    truth = predictive.interval(world(2, "truth"), errors, SensorError(0.0, 0.0, 0.02, 0.0))
    simulated = world(2, "truth")["simulated"]
    np.testing.assert_allclose(truth["high"] - simulated, 1.6449 * 0.02 * simulated)
    assert predictive.interval(world(2, "surfels"), errors, NO_NOISE).isna().all(axis=None)


def test_voxels_err_as_those_of_the_nearest_size_and_leaves_by_chance_as_their_like():
    errors = pd.concat(
        [predictive.error_table(world(1, name)) for name in ("voxels_0.2", "voxels_1.0")]
    )
    errors["low"] = np.where(errors["reconstruction"] == "voxels_0.2", -0.1, -0.3)
    for name, distance in (("voxels_0.1", 0.1), ("voxels_0.4", 0.1), ("voxels_0.5", 0.3)):
        records = world(2, name).query("simulated > 400")
        found = predictive.interval(records, errors, NO_NOISE)
        np.testing.assert_allclose(records["simulated"] - found["low"], distance * OPEN_SKY)
    by_chance = predictive.interval(
        world(2), errors.assign(reconstruction="virtual_leaves"), NO_NOISE, leaves_by_chance=True
    )
    assert by_chance.notna().all(axis=None)


def test_light_has_no_negative_bound_and_night_is_dark():
    night = pd.DataFrame({"reconstruction": "polygons", "simulated": [0.0], "baseline": [0.0]})
    bounds = predictive.interval(night, TABLED, NO_NOISE)
    assert (bounds == 0).all(axis=None)
    assert (predictive.interval(world(2), TABLED, SensorError())["low"] >= 0).all()


def test_every_reconstruction_is_tabled_with_what_it_lets_through_in_ascending_order():
    assert set(TABLED["reconstruction"]) == {
        "polygons", "surfels", "voxels_0.2", "voxels_1.0", "virtual_leaves"
    }  # fmt: skip
    for _, rows in TABLED.groupby("reconstruction"):
        assert (rows["share"].diff().dropna() > 0).all()
        assert (rows["low"] <= rows["high"]).all()
        assert rows["n"].sum() > 1000
