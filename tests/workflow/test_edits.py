"""Each edit reruns exactly what depends on it: keys, code and data against the jobs to rerun.

Jobs are counted, as in `transport*4`: of five reconstructions four are traced again.
"""

import os
from collections import Counter

import pytest
import yaml
from tests.workflow import dry_runs
from tests.workflow.project import SMALL, copy_of_project

pytestmark = pytest.mark.whole
OWN = "config/example.yaml"

# What follows from what.
PAGE = "runtime page"
CONFIGURED = f"configuration {PAGE}"
FIGURES = "boxplot_figure scatter_figure"
COMPARED = f"records record_statistics {FIGURES} series_figure verdict"


def checked(n):
    """The per-timestep engine in n reconstructions, each in two batches."""
    return f"timesteps*{2 * n} reference*{n} agreement"


def traced(n):
    """Both engines in n reconstructions, and what compares them."""
    return f"transport*{n} light*{n} {checked(n)} {COMPARED}"


MAP = "ground_map ground_map_figure"
SHAPED = f"{MAP} cloud_to_mesh voxels_summary*2 tree_figure"
POLYGONS = f"polygons surfels {SHAPED}"  # their wood is that of surfels too
CLASSES = f"classify {POLYGONS} voxels*2 {traced(4)}"
SCAN = f"scan clean {CLASSES}"
PLANT = f"plant scan clean classify {POLYGONS} voxels*2 sensors {traced(5)}"  # the truth as well
SKY = f"light*5 {checked(5)} {MAP} {COMPARED}"

KEYS = {
    "plant={leaf_area_m2: 6}": PLANT,
    "scan={positions: 4}": SCAN,
    "clean={thin_voxel_m: 0.02}": f"clean {CLASSES}",
    "clean={distance_points: 1000}": "cloud_to_mesh",
    "classify={threshold_db: -5}": CLASSES,
    "classify={method: learned}": CLASSES,
    "classify={training_trees: 5}": "",  # the model is taught on demand
    "rescan={layers: 3}": "",  # shots are predicted on demand
    "polygons={voxel_size_m: 0.06}": f"{POLYGONS} {traced(4)}",
    "surfels={overlap: 1.5}": f"surfels {traced(1)}",
    "voxels={estimator: ppl}": f"voxels*2 voxels_summary*2 {traced(2)}",
    "corrections={clumping: true}": f"voxels*2 voxels_summary*2 {traced(2)}",
    "radiation={linke_turbidity: 4}": f"sky {SKY}",
    "optics={leaf: {chlorophyll_ug_cm2: 30}}": f"optics {SKY}",
    "site={timezone: UTC}": "series_figure",
    "time={end: 2023-08-10 16:30}": f"sky {SKY}",
    "sensors={height_m: 0.2}": f"sensors tree_figure {traced(5)}",
    "sensors={tilt_deg: 30, azimuth_deg: 180}": f"sensors tree_figure {traced(5)}",
    # The map of the ground shows level light, whatever sensors read.
    "sensors={response: hemispherical}": traced(5),
    "measured={noise_relative: 0.03}": COMPARED,
    # A grid stands in the tree's own frame, but files of light tell world coordinates.
    "registration={origin_m: [1, 0, 0]}": f"light*5 reference*5 agreement {MAP} {COMPARED}",
    "light={transport: {max_orders: 8}}": f"transport*5 light*5 agreement {COMPARED}",
    "light={tiles: {size_m: 10}}": f"transport*5 light*5 agreement {COMPARED}",
    "light={transport: {max_shadow_rays: 99}}": f"light*5 agreement {COMPARED}",
    "light={timestep: {replicates: 5}}": checked(5),
    "light={timestep: {step_min: 120}}": "timesteps*5 reference*5 agreement",
    # LESS 3: meshes in two batches, voxels at a few times in one
    "light={check_with: [timestep, less]}": "less_timesteps*8 less*5 agreement",
    "light={sun_diameter_deg: 0.5}": SKY,
    "figures={map_times: [2023-08-10 12:30]}": MAP,
    "ground_z_m=-0.1": f"scan clean {CLASSES} sensors".replace(traced(4), traced(5)),
    "statistics={confidence: 0.9}": f"record_statistics {FIGURES}",
    "figures={map_spacing_m: 0.4}": MAP,
    "figures={sensors: [1_1]}": "series_figure",
    "survey={grown: 3}": "",
    "seed=2": PLANT,
}
CODE = {
    "virtual/plants.py": PLANT,
    "virtual/scanner.py": SCAN,
    "cloud/clean.py": f"clean {CLASSES}",
    "cloud/eigenvalues.py": CLASSES,
    "virtual/leaf_wood_training.py": "",
    "structure/polygons.py": f"{POLYGONS} {traced(4)}",
    "structure/surfels.py": f"surfels {traced(1)}",
    "structure/voxels.py": f"voxels*2 voxels_summary*2 {traced(2)}",
    "structure/occlusion.py": "voxels_summary*2 verdict",  # the correction is turned off
    "sky/sun.py": f"sky {SKY}",
    "sky/models/perez.py": f"sky {SKY}",
    "scene/sensors.py": f"sensors tree_figure {traced(5)}",
    "light/paths.py": f"transport*5 light*5 agreement {MAP} {COMPARED}",
    "light/series.py": f"light*5 agreement {MAP} {COMPARED}",
    "light/timestep.py": checked(5),
    "light/moved_sensors.py": "verdict",
    "registration/fit.py": "",  # nothing is fitted
    "stats/correlation.R": f"record_statistics {FIGURES}",
    "stats/agreement.py": "agreement",
    "stats/reconstruction_errors.csv": COMPARED,
    "verdict/verdict_model.json": "verdict",
    "figures/tree.py": "tree_figure",
    "figures/scatter.py": "scatter_figure",
    "config/polygons.py": "",  # what it configures counts, not how it is read
    "survey/plan.py": "",
}
DATA = {
    "sensors.csv": f"sensors tree_figure {traced(5)}",
    "par.csv": COMPARED,
    "radiation.csv": f"sky {SKY}",
    "bark.csv": f"optics {SKY}",
}
TABLES = {
    "experiment": "tables",
    "data_dir": ".",
    "sensors": {"kind": "table", "path": "sensors.csv"},
    "measured": {"kind": "table", "path": "par.csv"},
    "radiation": {"kind": "table", "path": "radiation.csv"},
    "optics": {"bark": {"path": "bark.csv"}},
}


def counted(text):
    """Jobs as they are written above."""
    words = (word.partition("*") for word in text.split())
    return Counter({rule: int(number or 1) for rule, _, number in words})


def planned(output):
    """Jobs of a dry run, from Snakemake's table."""
    lines = iter(output.splitlines())
    if not any(line.split() == ["job", "count"] for line in lines):
        return Counter()
    next(lines)
    rows = (line.split() for line in lines)
    jobs = {}
    for row in rows:
        if len(row) != 2 or row[0] == "total":
            break
        jobs[row[0]] = int(row[1])
    jobs.pop("all")
    return Counter(jobs)


def dry(configfile, *config):
    overrides = ["--config", *config] if config else []
    configured = ["--cores", "1", "--nocolor", "--configfile", configfile, *overrides]
    return ["--dry-run", "--quiet", "rules", *configured]


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A copy of the project that looks as after a run of the small tree."""
    project = copy_of_project(tmp_path_factory.mktemp("finished") / "dapple")
    dry_runs.pretend_finished(project.folder, SMALL)
    return project.folder


@pytest.fixture(scope="module")
def with_tables(tmp_path_factory):
    """The same with sensors, records, radiation and bark from files."""
    project = copy_of_project(tmp_path_factory.mktemp("tables") / "dapple")
    small = yaml.safe_load((project.folder / SMALL).read_text())
    (project.folder / "tables.yaml").write_text(yaml.safe_dump(small | TABLES))
    for name in DATA:
        (project.folder / name).write_text("as it was\n")
    dry_runs.pretend_finished(project.folder, "tables.yaml")
    return project.folder


def with_edits(folder, files, configfile):
    """Jobs after each file alone was edited: a line more at its end."""
    found = {}
    for name, path in files.items():
        before, stat = path.read_bytes(), path.stat()
        path.write_bytes(before + b"\n")
        (output,) = dry_runs.many([(folder, dry(configfile))])
        found[name] = planned(output)
        path.write_bytes(before)
        os.utime(path, ns=(stat.st_atime_ns, stat.st_mtime_ns))
    return found


def differences(found, expected, everywhere):
    """What reruns though it should not, and what should but does not, by edit."""
    wrong = {}
    for name, jobs in found.items():
        wanted = counted(f"{expected[name]} {everywhere if expected[name] else ''}")
        wanted |= counted(everywhere if everywhere == CONFIGURED else "")
        if jobs != wanted:
            wrong[name] = {"too much": dict(jobs - wanted), "too little": dict(wanted - jobs)}
    return wrong


def test_nothing_was_edited_and_nothing_is_to_be_done(finished, with_tables):
    runs = [(finished, dry(SMALL)), (with_tables, dry("tables.yaml"))]
    assert [planned(output) for output in dry_runs.many(runs)] == [Counter(), Counter()]


def test_an_edited_key_reruns_what_depends_on_it_and_nothing_else(finished):
    outputs = dry_runs.many((finished, dry(SMALL, edit)) for edit in KEYS)
    found = {edit: planned(output) for edit, output in zip(KEYS, outputs, strict=True)}
    assert differences(found, KEYS, CONFIGURED) == {}


def test_edited_code_reruns_what_depends_on_it_and_nothing_else(finished):
    files = {name: finished / "scripts/dapple" / name for name in CODE}
    assert differences(with_edits(finished, files, SMALL), CODE, PAGE) == {}


def test_an_edited_view_of_the_report_writes_its_page_anew_and_nothing_else(finished):
    name = "report/tree_view.py"
    found = with_edits(finished, {name: finished / "scripts/dapple" / name}, SMALL)
    assert found == {name: Counter(page=1)}


def test_edited_data_rerun_what_depends_on_them_and_nothing_else(with_tables):
    files = {name: with_tables / name for name in DATA}
    assert differences(with_edits(with_tables, files, "tables.yaml"), DATA, PAGE) == {}


@pytest.fixture(scope="module")
def own_scan(tmp_path_factory):
    """The same with a cloud, weather, sensors and records as a user brings them."""
    project = copy_of_project(tmp_path_factory.mktemp("own") / "dapple")
    dry_runs.pretend_finished(project.folder, OWN)
    return project.folder


def test_nothing_hides_an_edit_from_the_steps_of_an_own_scan(own_scan):
    edits = {
        "polygons={voxel_size_m: 0.06}": ({"polygons", "surfels", "light"}, {"ingest", "clean"}),
        "cloud={unit: cm}": ({"ingest", "clean", "polygons", "light"}, set()),
        "classify={threshold_db: -6}": ({"classify", "polygons"}, {"ingest", "clean"}),
    }
    outputs = dry_runs.many((own_scan, dry(OWN, edit)) for edit in edits)
    for (edit, (reruns, stays)), output in zip(edits.items(), outputs, strict=True):
        jobs = planned(output).keys()
        assert reruns <= jobs, edit
        assert not stays & jobs, edit
    files = {name: own_scan / "config/example" / name for name in ("tree.laz", "sensors.csv")}
    found = with_edits(own_scan, files, OWN)
    assert {"ingest", "clean", "polygons", "light"} <= found["tree.laz"].keys()
    assert "sensors" in found["sensors.csv"]
    assert not {"ingest", "polygons"} & found["sensors.csv"].keys()
