"""Records made worse: what must not change, and what must change by how much."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.stability import worse_records

MINUTES = 240
PERIOD_MIN = 60.0


def day(loggers=("1_1", "2_1"), step_min=1.0):
    """Records of light that goes up and down once an hour, simulated without an error."""
    minute = np.arange(0.0, MINUTES + 1e-9, step_min)
    wave = 500 + 100 * np.sin(2 * np.pi * minute / PERIOD_MIN)
    time = pd.Timestamp("2023-08-10 10:00", tz="UTC") + pd.to_timedelta(minute, unit="min")
    return pd.concat(
        [
            pd.DataFrame(
                {
                    "reconstruction": method,
                    "sensor": sensor,
                    "time": time,
                    "measured": wave,
                    "simulated": wave,
                    "baseline": 1000.0,
                }
            )
            for method in ("polygons", "voxels_1.0")
            for sensor in loggers
        ],
        ignore_index=True,
    )


def test_a_right_clock_changes_nothing():
    pd.testing.assert_frame_equal(worse_records.clocks_off(day(), day(), 0.0, 1), day())


@pytest.mark.parametrize("offset_min", [5.0, 10.0])
def test_a_wrong_clock_costs_a_wave_the_cosine_of_its_phase(offset_min):
    table = day(loggers=("1_1",))
    # Whole periods, so that the wave's mean is the same for both.
    known = worse_records.clocks_off(table, table, offset_min, 1)
    whole = known.groupby("reconstruction").head(3 * int(PERIOD_MIN))
    phase = 2 * np.pi * offset_min / PERIOD_MIN
    found = worse_records.compared(whole[whole["reconstruction"] == "polygons"])
    assert found["r"] == pytest.approx(np.cos(phase), abs=1e-9)
    # Two waves apart by a phase differ by a wave of 2 sin(phase / 2) of their height.
    assert found["rmse_rel"] == pytest.approx(0.1 * 2 * np.sin(phase / 2) / np.sqrt(2), abs=1e-9)


def test_clocks_are_wrong_by_logger_and_the_same_for_every_reconstruction():
    sensors = tuple(f"{logger}_{channel}" for logger in range(1, 9) for channel in (1, 3))
    known = worse_records.clocks_off(day(loggers=sensors), day(loggers=sensors), 10.0, 3)
    first = known.groupby(["reconstruction", "sensor"])["time"].min().unstack("reconstruction")
    assert (first["polygons"] == first["voxels_1.0"]).all()
    by_logger = first["polygons"].groupby(first.index.str.partition("_").get_level_values(0))
    assert (by_logger.nunique() == 1).all()
    assert first["polygons"].nunique() == 2


def test_a_gap_in_the_records_is_no_gap_in_the_light():
    table = day(loggers=("1_1",))
    gap = table["time"].between(table["time"].min() + pd.Timedelta("60min"), table["time"].max())
    short = worse_records.clocks_off(table[~gap], table, 10.0, 1)
    whole = worse_records.clocks_off(table, table, 10.0, 1)
    both = short.merge(whole, on=["reconstruction", "sensor", "time"])
    assert len(both) == len(short) > 0
    assert (both["simulated_x"] == both["simulated_y"]).all()


def test_light_far_apart_in_time_cannot_tell_what_a_wrong_clock_does():
    with pytest.raises(InputError, match="every 20 min"):
        worse_records.clocks_off(day(), day(step_min=20.0), 1.0, 1)


def test_fewer_records_are_among_more_of_them_and_all_are_all():
    table = day()
    some, few = (worse_records.fewer(table, ["sensor", "time"], share, 5) for share in (0.1, 0.01))
    assert set(few.index) < set(some.index)
    assert len(some) == pytest.approx(0.1 * len(table), abs=2)
    pd.testing.assert_frame_equal(worse_records.fewer(table, ["sensor"], 1.0, 5), table)


def test_undisturbed_levels_have_the_agreement_of_the_records_themselves():
    table = day(loggers=("1_1", "1_3", "2_1", "2_3"))
    found = worse_records.table(
        table, table, lambda error_m, seed: table, n_levels=3, n_seeds=2, seed=1
    )
    assert set(found["stressor"]) == {stressor.name for stressor in worse_records.STRESSORS}
    for stressor in worse_records.STRESSORS:
        mine = found[(found["stressor"] == stressor.name) & (found["level"] == stressor.harmless)]
        assert len(mine) == 4
        assert (mine["n"] == len(table) / 2).all()
        assert mine["r"].to_numpy() == pytest.approx(1.0)
        assert mine["rmse_rel"].to_numpy() == pytest.approx(0.0)
