"""What a run will take, and why it will do what it does, is told before it begins."""

import json
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

from dapple.config.settings import validate
from dapple.estimate import beginning, forecast, machine, planned, speed, telling
from dapple.estimate.beginning import Known
from dapple.estimate.forecast import COMPILING, SNAKEMAKE, Cost, Forecast
from dapple.estimate.planned import ASKED, INTERRUPTED, MISSING, Job
from dapple.estimate.sizes import points_of, sizes
from dapple.formats import clouds
from dapple.formats.clouds import Cloud

COSTS = {
    ("scan", ""): Cost(2.0, 1e-6, 300.0, 1e-4),
    ("light", ""): Cost(3.0, 0.0, 400.0, 0.0),
    ("light", "voxels"): Cost(5.0, 0.0, 500.0, 0.0),
    (SNAKEMAKE, ""): Cost(7.0, 0.0, 0.0, 0.0),
    (COMPILING, ""): Cost(30.0, 0.0, 0.0, 0.0),
}
SIZES = {"one": 1.0, "shots": 1e6, "sensor_times": 100.0}


def told(jobs, cores=1, slowness=1.0, **more):
    return forecast.forecast(jobs, SIZES, COSTS, cores=cores, slowness=slowness, **more)


def lasting(seconds):
    return Forecast((), seconds, 0.0, (), 0)


# How long


def test_a_run_takes_its_steps_and_snakemake():
    assert told([Job("scan"), Job("light"), Job("light", "voxels_0.2")]).seconds == 3 + 3 + 5 + 7


def test_a_slower_machine_takes_longer_and_no_more_memory():
    jobs = [Job("scan"), Job("light")]
    assert told(jobs, slowness=2.0).seconds == 2 * told(jobs).seconds
    assert told(jobs, slowness=2.0).peak_mb == told(jobs).peak_mb == 400


def test_two_cores_take_two_narrow_jobs_at_a_time_and_one_wide_one():
    narrow, wide = [Job("light")] * 2, [Job("light", threads=2)] * 2
    assert told(narrow, cores=2).seconds == 3 + 7
    assert told(narrow, cores=2).peak_mb == 800
    assert told(wide, cores=2).seconds == 6 + 7
    assert told(wide, cores=2).peak_mb == 400


def test_a_fresh_clone_compiles_once():
    assert told([Job("scan")], compiled=False).seconds == told([Job("scan")]).seconds + 30


def test_what_a_step_took_before_counts_more_than_the_table():
    job = Job("scan", before=(30.0, 700.0))
    assert told([job], earlier=SIZES).seconds == 30 + 7
    half = SIZES | {"shots": 0.0}  # 2 s of the table's 3 s
    assert told([job], earlier=half).seconds == 30 * 3 / 2 + 7


def test_steps_that_were_never_measured_are_named():
    found = told([Job("scan"), Job("survey_scan")])
    assert found.unknown == ("survey_scan",)
    assert "1 step (survey_scan)" in telling.table(found, 1)


def test_the_time_of_a_run_with_steps_that_were_never_measured_is_a_lower_bound():
    found = told([Job("scan"), *[Job("survey_scan")] * 19])
    said = telling.sentence([Job("scan")] * 20, 20, found, [], is_first=True)
    assert said.startswith("20 steps, at least 10 s, without 19 steps that were never measured: ")
    assert "In all at least 10 s" in telling.table(found, 1)


def test_nothing_planned_takes_no_time():
    assert told([]).seconds == 0


def test_the_table_knows_every_step_of_the_default_run():
    known = {rule for rule, _ in forecast.read()}
    assert set(forecast.DRIVERS) - known <= {"one_tree", "inspect_input", "less_timesteps"}


def test_the_machine_of_the_table_is_as_fast_as_itself():
    table = pd.read_csv(speed.REFERENCE, index_col="work")["seconds"]
    assert speed.slowness(dict(table)) == 1.0
    assert speed.slowness(dict(3 * table)) == pytest.approx(3.0)


# How large


def test_twice_the_sensors_and_times_are_four_times_the_light():
    once = sizes(validate({"sensors": {"columns": 3, "rows": 4}, "time": {"step_min": 20}}))
    twice = sizes(validate({"sensors": {"columns": 6, "rows": 4}, "time": {"step_min": 10}}))
    assert twice["sensor_times"] / once["sensor_times"] == pytest.approx(4, rel=0.05)


def test_half_the_step_is_four_times_the_shots():
    coarse, fine = (
        sizes(validate({"scan": {"angular_step_deg": step}}))["shots"] for step in (0.2, 0.1)
    )
    assert fine / coarse == pytest.approx(4)


def test_shots_of_the_default_scan_are_known_within_a_fifth():
    assert sizes(validate({}))["shots"] == pytest.approx(3.2e6, rel=0.2)


@pytest.mark.parametrize("suffix", ["laz", "las", "ply", "txt"])
def test_points_are_counted_without_reading_them(tmp_path, suffix):
    cloud = Cloud(np.random.default_rng(1).normal(size=(5000, 3)))
    clouds.write(tmp_path / f"cloud.{suffix}", cloud)
    assert points_of(tmp_path / f"cloud.{suffix}") == pytest.approx(5000, rel=0.05)


def test_a_cloud_that_is_not_there_has_no_points(tmp_path):
    assert points_of(tmp_path / "none.laz") == 0


@pytest.mark.parametrize(("suffix", "bytes_a_point"), [("e57", 16), ("laz", 8)])
def test_points_of_a_file_without_a_count_follow_from_its_length(tmp_path, suffix, bytes_a_point):
    (tmp_path / f"cloud.{suffix}").write_bytes(bytes(200_000))
    found = points_of(tmp_path / f"cloud.{suffix}")
    assert 200_000 / bytes_a_point / 3 < found < 200_000 / bytes_a_point * 3


def test_a_user_s_tree_has_the_points_of_its_file_and_the_sensors_of_its_table(tmp_path):
    cloud = Cloud(np.random.default_rng(1).normal(size=(5000, 3)))
    clouds.write(tmp_path / "tree.laz", cloud)
    (tmp_path / "sensors.csv").write_text("sensor,x_m,y_m,z_m\na,0,0,1\nb,1,0,1\n")
    given = {
        "source": "cloud",
        "data_dir": str(tmp_path),
        "cloud": {"path": "tree.laz"},
        "sensors": {"kind": "table", "path": "sensors.csv"},
        "measured": {"kind": "none"},
    }
    found = sizes(validate(given))
    assert found["points"] == found["kept"] == 5000
    assert found["sensors"] == 2
    assert found["sensor_times"] % 2 == 0
    without = sizes(validate(given | {"sensors": {"kind": "none"}}))
    assert (without["sensors"], without["sensor_times"]) == (0, 0)


# Why


def test_an_edit_is_told_with_its_old_and_new_value():
    before = {"seed": 1, "optics": {"leaf": {"n": 1.5}}, "time": {"step_min": 10}}
    now = {"seed": 1, "optics": {"leaf": {"n": 1.7}}, "time": {"step_min": 10}}
    assert planned.edited(before, now) == ["optics.leaf.n is 1.7 (was 1.5)"]


def test_lists_that_yaml_reads_are_the_tuples_that_were_written():
    assert planned.edited({"a": [1, 2]}, {"a": (1, 2)}) == []


def test_keys_that_came_or_went_are_edits():
    assert planned.edited({"a": 1}, {"b": 2}) == ["b is 2 (was not set)", "a is not set (was 1)"]


@pytest.mark.parametrize(
    ("jobs", "total", "found", "edits", "is_first", "said"),
    [
        ([], 5, None, [], False, "Nothing to do"),
        ([Job("a")] * 5, 5, lasting(130.0), [], True, "5 steps, about 2 min: nothing of this run"),
        (
            [Job("a")],
            5,
            lasting(40.0),
            ["n is 2 (was 1)"],
            False,
            "1 of 5 steps, about 40 s, because n is",
        ),
        ([Job("a", causes=("x.py",))], 5, None, [], False, "1 of 5 steps, because x.py changed."),
        ([Job("a", causes=(MISSING,))], 5, None, [], False, f"because {MISSING}."),
        ([Job("a", causes=(INTERRUPTED, MISSING))], 5, None, [], False, f"because {INTERRUPTED}."),
        ([Job("a", causes=(ASKED,))], 5, None, [], False, f"because {ASKED}."),
    ],
)
def test_one_sentence_says_what_will_run_and_why(jobs, total, found, edits, is_first, said):
    assert said in telling.sentence(jobs, total, found, edits, is_first)


def test_the_configuration_of_the_run_before_is_that_beside_its_results(tmp_path):
    assert beginning.configuration_before(tmp_path) is None
    (tmp_path / "config.yaml").write_text("seed: 7\n")
    assert beginning.configuration_before(tmp_path) == {"seed": 7}
    for broken in ("seed: [7\n", "just words\n"):
        (tmp_path / "config.yaml").write_text(broken)
        assert beginning.configuration_before(tmp_path) is None


def test_a_machine_is_as_slow_as_its_steps_were_in_the_run_before(tmp_path):
    """The table has the scan at 2 s and a microsecond a shot: 3 s for a million."""
    before = sizes(validate({}))
    known = Known(tmp_path, 1, before, earlier=before)
    own = forecast.cost_of(Job("scan"), forecast.read()).seconds(before[forecast.DRIVERS["scan"]])
    as_before = [Job("scan", before=(k * own, 300.0)) for k in (1.0, 5.0)]
    fast, slow = (beginning._slowness(tmp_path / "none", [job], before, forecast.read())
                  for job in as_before)  # fmt: skip
    assert (fast, slow) == pytest.approx((1.0, 5.0))
    assert (
        beginning.expected(as_before[1:], known).seconds
        > beginning.expected(as_before[:1], known).seconds
    )


def test_the_middle_of_several_tries_is_what_counts():
    """One try beside another program on the machine says nothing."""
    ticks = iter([0.0, 1.0, 10.0, 90.0, 100.0, 102.0])
    assert machine._median(lambda: None, 3, lambda: next(ticks)) == 2.0


def test_a_program_starts_and_neighbours_are_found_in_some_time(monkeypatch):
    monkeypatch.setattr(machine, "STARTS", 1)
    monkeypatch.setattr(machine, "SEARCHES", 1)
    monkeypatch.setattr(machine, "POINTS", 1000)
    assert all(taken > 0 for taken in machine.measure().values())


def test_many_causes_are_not_all_listed():
    edits = [f"key_{k} is 1 (was 0)" for k in range(9)]
    assert "and 6 more." in telling.sentence([Job("a")], 3, None, edits, is_first=False)


def test_jobs_carry_why_they_run_and_what_they_took(tmp_path):
    benchmark = tmp_path / "scan.tsv"
    benchmark.write_text("s\tmax_rss\n12.5\t640\n")
    reason = SimpleNamespace(
        forced=False,
        incomplete_output=set(),
        missing_output={"b"},
        updated_input={"made.laz", "own.laz"},
        updated_input_run={"made.laz"},
    )
    job = SimpleNamespace(
        rule=SimpleNamespace(name="scan"),
        wildcards_dict={},
        threads=2,
        benchmark=benchmark,
        output=["points.laz"],
        log=["scan.log"],
    )
    dag = SimpleNamespace(needrun_jobs=lambda **_: [job], reason=lambda job: reason)
    found = Job("scan", "", 2, (MISSING, "own.laz"), (12.5, 640.0))
    assert planned.planned(dag) == [found]


# All of it


def test_a_machine_that_was_measured_tells_a_first_run(tmp_path):
    table = pd.read_csv(speed.REFERENCE, index_col="work")["seconds"]
    (tmp_path / "machine.json").write_text(json.dumps(dict(table)))
    said = beginning.tell([Job("scan")], 1, Known(tmp_path, 1, sizes(validate({}))))
    assert said.startswith("1 step, about ")


def test_nothing_is_said_of_time_where_nothing_is_known(tmp_path):
    said = beginning.tell([Job("scan")], 1, Known(tmp_path, 1, sizes(validate({}))))
    assert said == "1 step: nothing of this run has been made yet."
