"""What rules and scripts share: the code that a rule depends on, logs, errors that read well."""

import re
from types import SimpleNamespace

import pytest

from dapple.code_use import SCRIPTS
from dapple.errors import InputError
from dapple.workflow import code_of, options, run


def modules(script):
    """Names of the modules that a script is made of, below dapple."""
    folder = f"{SCRIPTS.name}/dapple/"
    return {path[path.index(folder) + len(folder) :] for path in code_of(SCRIPTS / f"{script}.py")}


def test_a_script_is_made_of_what_it_imports_itself_and_through_others():
    code = modules("polygons")
    assert "structure/polygons.py" in code  # by the script
    assert "structure/hulls.py" in code  # by structure/polygons.py
    assert "errors.py" in code


@pytest.mark.parametrize("script", ["plant", "scan", "clean", "classify", "sky", "optics"])
def test_the_code_of_polygons_is_no_part_of_what_comes_before_or_beside_them(script):
    assert "structure/polygons.py" not in modules(script)


@pytest.mark.parametrize("script", ["plant", "scan", "polygons", "voxels", "timesteps"])
def test_the_typed_configuration_is_no_part_of_any_step(script):
    assert "config.py" not in modules(script)


def test_an_engine_is_no_part_of_the_one_that_checks_it():
    assert not {"light/tensor.py", "light/paths.py", "light/series.py"} & modules("timesteps")
    assert not {"light/timestep.py", "light/timestep_series.py"} & modules("transport")


def test_a_correction_that_is_turned_off_does_not_count():
    assert "structure/occlusion.py" in modules("polygons")
    left = code_of(SCRIPTS / "polygons.py", unused=["structure.occlusion"])
    assert not any(path.endswith("structure/occlusion.py") for path in left)


def test_r_code_counts_as_well():
    assert "stats/correlation.R" in modules("record_statistics")


def test_every_script_is_made_of_something():
    scripts = [path.stem for path in SCRIPTS.glob("*.py")]
    assert len(scripts) > 20
    for script in scripts:
        assert "workflow.py" in modules(script), script


def test_code_is_named_relative_to_where_the_workflow_runs(monkeypatch):
    monkeypatch.chdir(SCRIPTS.parent)
    assert all(path.startswith("scripts/dapple/") for path in code_of(SCRIPTS / "scan.py"))


@pytest.fixture
def job(tmp_path):
    made = tmp_path / "tree.laz"
    made.write_bytes(bytes(1_500_000))
    log = tmp_path / "rule.log"
    return SimpleNamespace(log=[str(log)], written=log, output=[str(made)])


def test_what_a_script_prints_goes_to_its_log(job, capsys):
    run(lambda _: print("12 points"), job)
    assert job.written.read_text().startswith("12 points\n")
    assert capsys.readouterr().out == ""


def test_a_log_ends_with_what_was_made_how_long_it_took_and_how_much_memory(job):
    run(lambda _: None, job)
    (line,) = job.written.read_text().splitlines()
    assert re.fullmatch(
        r"Done in 1 s with \d+ MB of memory at most: wrote tree\.laz \(1\.5 MB\)\.", line
    )


def test_of_many_files_some_are_named(job):
    job.output *= 9
    run(lambda _: None, job)
    assert job.written.read_text().endswith("tree.laz (1.5 MB) and 3 more files.\n")


def test_a_mistake_of_the_user_s_ends_the_job_with_one_message(job):
    def main(_):
        raise InputError("tree.laz", "no points", "a scan", "Check the export.")

    with pytest.raises(SystemExit) as stop:
        run(main, job)
    message = "dapple: tree.laz: found no points; expected a scan. Check the export."
    assert stop.value.code == message  # text: printed as it is, and the exit status is 1
    assert job.written.read_text() == f"{message}\n"  # which the terminal shows: no traceback


def test_any_other_error_ends_the_job_with_a_traceback_in_the_log_too(job):
    with pytest.raises(ZeroDivisionError):
        run(lambda _: 1 / 0, job)
    assert "ZeroDivisionError" in job.written.read_text()


def test_named_parameters_become_keyword_arguments():
    assert options(SimpleNamespace(items=lambda: [("voxel_size_m", 0.05)])) == {
        "voxel_size_m": 0.05
    }
