"""What each step cost, from Snakemake's benchmark files."""

import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.stats import runtime

HEADER = "s\th:m:s\tmax_rss\tmax_vms\tmax_uss\tmax_pss\tio_in\tio_out\tmean_load\tcpu_time\n"
NAMES = ["polygons", "voxels_0.2", "voxels_1.0", "truth"]


def write(path, wall_s, rss="120.5", cpu_s="7.0"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(f"{HEADER}{wall_s}\t0:00:05\t{rss}\t0\t0\t0\t0\t0\t0\t{cpu_s}\n")
    return path


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("scan", ("scan", "")),
        ("light/polygons", ("light", "polygons")),
        ("light/voxels_0.2", ("light", "voxels_0.2")),
        ("light/voxels_0.2/batch_3", ("light", "voxels_0.2")),
        ("light.truth", ("light", "truth")),
        ("figure_tree_voxels_1.0", ("figure_tree", "voxels_1.0")),
        ("polygons", ("polygons", "polygons")),
        ("voxels_0.2", ("voxels", "voxels_0.2")),
    ],
)
def test_a_benchmark_is_named_after_its_step_and_reconstruction(name, expected):
    assert runtime.name_parts(name, NAMES) == expected


def test_the_table_has_the_columns_that_others_rely_on(tmp_path):
    path = write(tmp_path / "light/polygons.tsv", 5.25)
    row = runtime.collect([path], tmp_path, NAMES)
    assert row.to_dict("records") == [
        {
            "step": "light",
            "reconstruction": "polygons",
            "wall_s": 5.25,
            "cpu_s": 7.0,
            "peak_rss_mb": 120.5,
        }
    ]


@pytest.mark.parametrize("unknown", ["NA", "-"])
def test_a_job_too_short_to_be_sampled_has_unknown_cost_and_not_zero(tmp_path, unknown):
    path = write(tmp_path / "scan.tsv", 0.1, rss=unknown, cpu_s=unknown)
    row = runtime.collect([path], tmp_path, NAMES).iloc[0]
    assert row["wall_s"] == 0.1
    assert pd.isna(row["cpu_s"])
    assert pd.isna(row["peak_rss_mb"])


def test_batches_of_one_step_add_their_time_and_share_their_memory(tmp_path):
    paths = [
        write(tmp_path / "light/truth/batch_0.tsv", 5.0, rss="100"),
        write(tmp_path / "light/truth/batch_1.tsv", 6.0, rss="300"),
    ]
    row = runtime.collect(paths, tmp_path, NAMES).iloc[0]
    assert (row["wall_s"], row["cpu_s"], row["peak_rss_mb"]) == (11.0, 14.0, 300.0)


def test_the_time_of_a_sum_with_an_unknown_part_is_unknown(tmp_path):
    paths = [
        write(tmp_path / "light/truth/batch_0.tsv", 5.0),
        write(tmp_path / "light/truth/batch_1.tsv", 0.1, cpu_s="NA"),
    ]
    assert pd.isna(runtime.collect(paths, tmp_path, NAMES)["cpu_s"].iloc[0])


def test_repeats_of_one_job_are_averaged(tmp_path):
    path = write(tmp_path / "scan.tsv", 4.0)
    path.write_text(path.read_text() + "6.0\t0:00:06\t130\t0\t0\t0\t0\t0\t0\t9.0\n")
    assert runtime.read(path)["wall_s"] == 5.0


@pytest.mark.parametrize("text", ["", "a\tb\n1\t2\n", HEADER, HEADER + "x\t" * 9 + "x\n"])
def test_a_file_that_is_no_benchmark_is_named(tmp_path, text):
    (tmp_path / "odd.tsv").write_text(text)
    with pytest.raises(InputError, match=r"odd\.tsv: found .*expected a benchmark"):
        runtime.read(tmp_path / "odd.tsv")


def test_no_benchmark_at_all_gives_an_empty_table(tmp_path):
    assert list(runtime.collect([], tmp_path, NAMES)) == runtime.COLUMNS
