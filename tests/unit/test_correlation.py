"""Agreement between measured and simulated series."""

import os
import subprocess
import sys
import threading
import time

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from scipy.stats import zscore

from dapple.errors import InputError
from dapple.stats import correlation, measures, r_bridge


def records(n_sensors=12, n_times=50, seed=0, sensor_sd=0.0, slope=1.0, intercept=0.0, noise=50.0):
    """Measured light that is a line of simulated light, an offset per sensor and white noise."""
    rng = np.random.default_rng(seed)
    simulated = rng.uniform(100, 1600, (n_sensors, n_times))
    offset = sensor_sd * zscore(rng.normal(size=(n_sensors, 1))) if sensor_sd else 0.0
    measured = intercept + slope * simulated + offset + rng.normal(0, noise, simulated.shape)
    return pd.DataFrame(
        {
            "reconstruction": "polygons",
            "sensor": np.repeat([f"1_{k}" for k in range(n_sensors)], n_times),
            "time": np.tile(
                pd.date_range("2023-08-10 10:00Z", periods=n_times, freq="min"), n_sensors
            ),
            "measured": measured.ravel(),
            "simulated": simulated.ravel(),
        }
    )


def one(table):
    assert len(table) == 1
    return table.iloc[0]


def test_overall_has_the_columns_that_others_rely_on():
    table = correlation.overall(records(), seed=1)
    assert ",".join(table) == "reconstruction,n,r,r_low,r_high,rmse,bias,mae,baseline_r"


def test_a_constant_excess_is_all_bias_and_no_loss_of_correlation():
    data = records(noise=0.0).assign(simulated=lambda d: d["measured"] + 30.0)
    row = one(correlation.overall(data, seed=1))
    assert row["r"] == pytest.approx(1.0, abs=1e-12)
    assert row["bias"] == pytest.approx(30.0)
    assert row["mae"] == pytest.approx(30.0)
    assert row["rmse"] == pytest.approx(30.0)


def test_r_is_that_of_numpy_and_lies_in_its_interval():
    data = records(noise=400.0)
    row = one(correlation.overall(data, seed=1))
    assert row["r"] == pytest.approx(np.corrcoef(data["measured"], data["simulated"])[0, 1])
    assert row["r_low"] < row["r"] < row["r_high"]


def test_the_baseline_is_the_correlation_with_the_sky_alone():
    data = records().assign(baseline=lambda d: -d["measured"])
    assert one(correlation.overall(data, seed=1))["baseline_r"] == pytest.approx(-1.0)


def test_a_baseline_that_does_not_vary_has_no_correlation():
    assert np.isnan(
        one(correlation.overall(records().assign(baseline=1500.0), seed=1))["baseline_r"]
    )


def test_records_without_a_measurement_do_not_count():
    data = records()
    data.loc[:9, "measured"] = np.nan
    assert one(correlation.overall(data, seed=1))["n"] == len(data) - 10


def test_the_same_seed_gives_the_same_interval_and_another_seed_another():
    first, again, other = (
        one(correlation.overall(records(noise=400.0), seed=seed, n_bootstrap=200))
        for seed in (5, 5, 6)
    )
    assert (first["r_low"], first["r_high"]) == (again["r_low"], again["r_high"])
    assert (first["r_low"], first["r_high"]) != (other["r_low"], other["r_high"])


def test_sums_give_the_same_interval_as_resampling_the_records_themselves():
    data = records(n_sensors=8, noise=800.0, sensor_sd=300.0)
    limits = correlation.bootstrap_interval(data, seed=2, n_bootstrap=4000)
    x, y = (data[name].to_numpy().reshape(8, -1) for name in ("measured", "simulated"))
    draws = np.random.default_rng(0).integers(8, size=(4000, 8))
    r = [np.corrcoef(x[rows].ravel(), y[rows].ravel())[0, 1] for rows in draws]
    expected = np.quantile(r, [0.025, 0.975])
    # Two bootstraps of 4000 draws differ by their own noise: a few percent of the width.
    assert [limits.low, limits.high] == pytest.approx(expected, abs=0.06 * np.ptp(expected))


def test_the_interval_holds_the_true_r_of_autocorrelated_series():
    """Where a formula for independent records would hold it in about one case of four."""
    rng = np.random.default_rng(3)
    hits = 0
    for trial in range(40):
        shade = lfilter([1], [1, -0.97], rng.normal(size=(2, 36, 80)), axis=2) * 0.24
        common, own = rng.normal(size=(1, 36, 1)), 0.5 * rng.normal(size=(2, 36, 1))
        x, y = common + own + shade
        data = pd.DataFrame({"sensor": np.repeat(np.arange(36), 80)})
        data = data.assign(simulated=x.ravel(), measured=y.ravel())
        limits = correlation.bootstrap_interval(data, seed=trial, n_bootstrap=300)
        # Starting from zero the series reach this share of their stationary variance.
        drift = 0.24**2 * np.mean((1 - 0.97 ** (2 * np.arange(1, 81))) / (1 - 0.97**2))
        hits += limits.low <= 1.0 / (1.25 + drift) <= limits.high
    assert hits >= 32


def test_one_sensor_has_no_interval_and_says_why(caplog):
    row = one(correlation.overall(records(n_sensors=1), seed=1))
    assert np.isfinite(row["r"])
    assert np.isnan([row["r_low"], row["r_high"]]).all()
    assert "one sensor" in caplog.text


def test_light_that_does_not_vary_has_neither_interval_nor_model_and_says_why():
    constant = records().assign(simulated=500.0)
    assert "constant" in correlation.bootstrap_interval(constant, seed=1).note
    assert "constant" in one(correlation.mixed_model(constant))["note"]
    nothing = correlation.bootstrap_interval(records().iloc[:0], seed=1)
    assert np.isnan(nothing.low)
    assert "no record" in nothing.note


def test_a_model_needs_more_records_than_it_has_parameters():
    assert "no more records" in one(correlation.mixed_model(records(3, 1)))["note"]


def test_the_interval_of_two_sensors_is_called_too_narrow(caplog):
    correlation.overall(records(n_sensors=2, noise=400.0), seed=1)
    assert "only 2 sensors: the limits are too narrow" in caplog.text


def test_a_minute_by_minute_afternoon_is_resampled_in_seconds():
    data = records(n_sensors=36, n_times=400)
    correlation.overall(records(), seed=1, n_bootstrap=10)  # starts R
    start = time.perf_counter()
    correlation.overall(data, seed=1, n_bootstrap=1000)
    assert time.perf_counter() - start < 10


def test_a_sensor_in_constant_light_has_no_r_but_an_error():
    data = records(n_sensors=2)
    data.loc[data["sensor"] == "1_0", "simulated"] = 0.1 + 0.2
    table = measures.per_sensor(data).set_index("sensor")
    assert ",".join(measures.per_sensor(data)) == "reconstruction,sensor,n,r,rmse,bias"
    assert np.isnan(table.loc["1_0", "r"])
    assert np.isfinite(table.loc["1_0", ["rmse", "bias"]].astype(float)).all()
    assert table.loc["1_1", "r"] > 0.9


def test_the_mixed_model_finds_line_and_spread_that_made_the_records():
    data = records(36, 200, sensor_sd=120.0, slope=0.8, intercept=50.0, noise=60.0)
    fit = one(correlation.mixed_model(data))
    assert fit["slope"] == pytest.approx(0.8, abs=4 * fit["slope_se"])
    assert fit["intercept"] == pytest.approx(50.0, abs=4 * fit["intercept_se"])
    assert fit["intercept_se"] == pytest.approx(120.0 / 6, rel=0.1)
    assert fit["sensor_sd"] == pytest.approx(120.0, rel=0.05)
    assert fit["residual_sd"] == pytest.approx(60.0, rel=0.05)
    explained = 0.8**2 * data["simulated"].var()
    total = explained + 120.0**2 + 60.0**2
    assert fit["r2_marginal"] == pytest.approx(explained / total, abs=0.02)
    assert fit["r2_conditional"] == pytest.approx((explained + 120.0**2) / total, abs=0.02)
    assert abs(fit["residual_autocorrelation"]) < 0.05


def test_one_sensor_has_no_mixed_model_and_says_why():
    fit = one(correlation.mixed_model(records(n_sensors=1)))
    assert np.isnan(fit["slope"])
    assert "two sensors" in fit["note"]


def test_a_table_without_a_column_is_an_error_that_names_it():
    with pytest.raises(InputError, match="Add simulated"):
        correlation.overall(records().drop(columns="simulated"), seed=1)


def test_an_error_in_r_names_the_function(tmp_path):
    (tmp_path / "broken.R").write_text("f <- function() stop('no such thing')")
    with pytest.raises(InputError, match=r"broken.R: f\(\).*no such thing"):
        r_bridge.call(tmp_path / "broken.R", "f")


def test_r_code_that_finds_no_end_is_stopped_and_the_next_call_has_all_its_time(tmp_path):
    source = tmp_path / "slow.R"
    source.write_text(
        "f <- function() repeat sqrt(2)\n"
        "g <- function() {Sys.sleep(0.6); for (k in 1:1e5) sqrt(k); data.frame(done = 1)}"
    )
    with pytest.raises(InputError, match=r"slow.R: f\(\).*elapsed time limit"):
        r_bridge.call(source, "f", limit_s=0.3)
    assert r_bridge.call(source, "g")["done"].item() == 1


def test_a_missing_r_package_is_named_with_the_remedy():
    with pytest.raises(InputError, match=r"R without notapackage.*apt-get install"):
        r_bridge.call(correlation.R_FILE, "mixed_model", packages=("notapackage",))


def test_a_machine_without_r_is_told_what_to_install(tmp_path):
    program = "from dapple.stats import r_bridge; r_bridge.call('x.R', 'f')"
    environment = {k: v for k, v in os.environ.items() if not k.startswith("R_")}
    path = os.pathsep.join(map(str, sys.path))
    result = subprocess.run(
        [sys.executable, "-c", program],
        env=environment | {"PATH": str(tmp_path), "PYTHONPATH": path},
        capture_output=True,
        text=True,
    )
    assert "no R that starts" in result.stderr
    assert "apt-get install r-base-core" in result.stderr


def test_r_outside_the_main_thread_is_refused():
    caught = []

    def work():
        try:
            r_bridge.call(correlation.R_FILE, "mixed_model", records())
        except RuntimeError as error:
            caught.append(str(error))

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert "main thread" in caught[0]


def test_r_leaves_the_library_path_of_later_programs_alone():
    code = "import os; from dapple.stats import r_bridge; r_bridge._start(); "
    code += "print(os.environ['LD_LIBRARY_PATH'])"
    mine = os.environ | {"LD_LIBRARY_PATH": "/somewhere/of/mine", "PYTHONPATH": "scripts"}
    done = subprocess.run([sys.executable, "-c", code], env=mine, capture_output=True, text=True)
    assert done.stdout.strip() == "/somewhere/of/mine"
