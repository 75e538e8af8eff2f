"""Where a method has failed, and how far its light is from the truth."""

import numpy as np
import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.figures import stability_map
from dapple.stability import outcome, reconstructions, thresholds


def runs(values: dict, stressor="wind", reconstruction="polygons", harmless=0.0, seeds=3):
    """One row a level and seed, from level: (r, rmse)."""
    return pd.DataFrame(
        [
            {
                "stressor": stressor,
                "level": level,
                "label": f"{level:g}",
                "reconstruction": reconstruction,
                "seed": seed,
                "harmless": level == harmless,
                "r": r,
                "rmse_rel": rmse,
                "mean_par_rel": 0.5,
                "leaf_area_m2": 10.0,
                "f1_wood_threshold": 0.5,
                "f1_wood_geometry": 0.6,
            }
            for level, (r, rmse) in values.items()
            for seed in range(seeds)
        ]
    )


def test_light_that_is_the_truth_agrees_with_it():
    truth = np.random.default_rng(1).uniform(100, 900, (5, 4))
    found = outcome.agreement(truth, truth, np.full(4, 1000.0))
    assert found == pytest.approx(
        {"r": 1.0, "rmse_rel": 0.0, "bias_rel": 0.0, "mean_par_rel": truth.mean() / 1000}
    )


def test_a_constant_error_is_all_bias_and_costs_no_correlation():
    truth = np.random.default_rng(1).uniform(100, 900, (5, 4))
    found = outcome.agreement(truth + 50, truth, np.full(4, 1000.0))
    assert found["r"] == pytest.approx(1.0)
    assert found["bias_rel"] == pytest.approx(0.05)
    assert found["rmse_rel"] == pytest.approx(0.05)


def test_constant_light_has_no_correlation():
    truth = np.random.default_rng(1).uniform(100, 900, (5, 4))
    assert np.isnan(outcome.agreement(np.full((5, 4), 3.0), truth, np.full(4, 1000.0))["r"])


def test_a_reconstruction_that_there_is_not_is_named():
    with pytest.raises(InputError, match="voxels_9"):
        reconstructions.chosen(["voxels_9"], (0.2, 1.0))
    assert "truth" not in reconstructions.chosen([], (0.2, 1.0))


def test_voxels_are_rebuilt_in_the_sizes_that_are_configured():
    assert reconstructions.chosen([], (0.1,)) == [
        "polygons",
        "voxels_0.1",
        "surfels",
        "virtual_leaves",
        "polygons_corrected",
        "voxels_0.1_corrected",
    ]


def test_a_method_fails_at_the_first_level_that_costs_five_hundredths_of_r():
    table = thresholds.table(
        runs({0.0: (0.90, 0.1), 0.02: (0.88, 0.1), 0.05: (0.85, 0.1), 0.1: (0.5, 0.1)})
    )
    assert table[["level", "reason"]].to_numpy().tolist() == [[0.05, "r"]]
    assert table["r_worst"].item() == 0.5


def test_a_method_fails_where_its_error_has_doubled_or_there_is_no_result():
    doubled = thresholds.table(runs({0.0: (0.90, 0.1), 0.02: (0.89, 0.2)}))
    assert doubled["reason"].item() == "rmse"
    none = thresholds.table(runs({0.0: (0.90, 0.1), 0.02: (np.nan, np.nan)}))
    assert none["reason"].item() == "no result"


def test_a_method_that_holds_has_no_level():
    table = thresholds.table(runs({0.0: (0.90, 0.1), 0.02: (0.89, 0.11)}))
    assert np.isnan(table["level"].item())


def test_a_two_sided_stressor_is_judged_from_its_middle():
    table = thresholds.table(
        runs({-3.0: (0.2, 0.3), -1.5: (0.5, 0.3), 0.0: (0.9, 0.1), 1.5: (0.88, 0.1)})
    )
    assert table["level"].item() == -1.5


def test_one_bad_world_of_three_is_no_failure():
    points = runs({0.0: (0.90, 0.1), 0.02: (0.89, 0.1)})
    points.loc[points.index[-1], "r"] = 0.1
    assert np.isnan(thresholds.table(points)["level"].item())


def test_published_findings_are_counted_over_worlds():
    r = {"polygons": 0.9, "voxels_0.2": 0.8, "voxels_1.0": 0.7}
    area = {"polygons": 12.0, "voxels_0.2": 10.0, "voxels_1.0": 9.0}
    points = pd.concat(
        runs({0.0: (r[name], 0.1)}, reconstruction=name).assign(
            leaf_area_m2=area[name], mean_par_rel=0.6 if name == "polygons" else 0.5
        )
        for name in r
    )
    second = (points["seed"] == 1) & (points["reconstruction"] == "polygons")
    points.loc[second, "mean_par_rel"] = 0.4
    row = thresholds.published(points).iloc[0]
    assert row["order_of_r"] == 1.0
    assert row["polygons_brighter"] == pytest.approx(2 / 3)
    assert row["polygons_larger"] == 1.0


def test_a_level_of_the_map_is_written_within_its_cell():
    levels = {"6.5 cm": 0.9, "needles 3 mm": 0.8, "needles 1 mm": 0.7}
    rows = {float(k): (r, 0.1) for k, r in enumerate(levels.values())}
    points = runs(rows, reconstruction="polygons", stressor="leaf_size")
    named = dict(enumerate(levels))
    ax = stability_map.heat_map(points.assign(label=points["level"].map(named))).axes[0]
    ax.figure.draw_without_rendering()
    cell = ax.transData.transform([[0, 0], [1, 0]])[:, 0]
    written = [text.get_window_extent().width for text in ax.texts]
    assert "needles\n3 mm" in [text.get_text() for text in ax.texts]
    assert max(written) < cell[1] - cell[0]


def test_figures_show_a_map_with_gaps_and_failures():
    points = pd.concat(
        [
            runs({0.0: (0.9, 0.1), 0.1: (np.nan, np.nan), 0.2: (0.4, 0.3)}, reconstruction=name)
            for name in ("polygons", "voxels_0.2")
        ]
        + [runs({-3.0: (0.7, 0.2), 0.0: (0.9, 0.1)}, stressor="reflectance_drift")]
    )
    figure = stability_map.heat_map(points)
    texts = [text.get_text() for ax in figure.axes for text in ax.texts]
    assert "0.40 ✕" in texts
    assert "none ✕" in texts
    assert "0.90" in texts
    assert stability_map.curves(points).axes[0].get_legend()
