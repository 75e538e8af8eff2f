"""Figures of surveys and of chlorophyll can be read in print and say their units."""

import numpy as np
import pandas as pd
import pytest
from tests import legibility

from dapple.figures import chlorophyll_maps, crown_map, effects_chart, survey_charts
from dapple.formats.rasters import Raster

STANDS = ("fagus", "platanus")
DESIGNS = ("single", "diamond", "corners")
MODELS = ("collision_orders", "semi_less", "prosail")
PAIRS = [(mask, network) for mask in ("sunlit", "all") for network in ("robust", "published")]
RNG = np.random.default_rng(1)


def rows(**choices):
    """A row for each choice of each column."""
    return pd.MultiIndex.from_product(choices.values(), names=choices.keys()).to_frame(index=False)


def shares(table, *names, high=1.0):
    return table.assign(**{name: RNG.uniform(0, high, len(table)) for name in names})


def survey_table(**more):
    return rows(stand=STANDS, design=DESIGNS, seed=(1, 2), **more)


def profile(*names):
    return shares(survey_table(height_m=np.arange(0.5, 12)), *names)


def retrieved(n_each, **bounds):
    """Numbers of every model, mask and network."""
    table = pd.concat([
        pd.DataFrame({"model": model, "mask": mask, "network": network}, index=range(n_each))
        for model in MODELS for mask, network in PAIRS
    ], ignore_index=True)  # fmt: skip
    return table.assign(**{key: RNG.uniform(*ends, len(table)) for key, ends in bounds.items()})


def scores():
    return retrieved(1, r2=(0.5, 0.9), rmse=(4, 9), n=(1000, 90000))


def pairs():
    ends = {"truth_ug_cm2": (10, 70), "predicted_ug_cm2": (10, 70)}
    return retrieved(30, **ends, low_ug_cm2=(0, 20), high_ug_cm2=(60, 80))


def spectra():
    bands = (450, 560, 650, 730, 840)
    pixels = shares(rows(kind=("sunlit", "shaded", "all"), wavelength_nm=bands), "mean")
    taught = shares(rows(model=MODELS, mask=["sunlit"], wavelength_nm=bands), "middle")
    around = {"low": taught["middle"] - 0.1, "high": taught["middle"] + 0.1}
    return chlorophyll_maps.spectra(pixels.assign(deviation=0.1), taught.assign(**around))


def losses():
    seeds = [
        retrieved(5, train_loss=(0.1, 0.2), validation_loss=(0.1, 0.2)).assign(
            seed=seed, epoch=np.tile(np.arange(5), len(MODELS) * len(PAIRS))
        )
        for seed in (1, 2)
    ]
    return chlorophyll_maps.losses(pd.concat(seeds))


def chlorophyll_map():
    values = RNG.uniform(0, 60, (5, 10, 10))
    return chlorophyll_maps.chlorophyll_map(values, cell_m=3.0, size_m=(30.0, 30.0))


FIGURES = {
    "shadowing": lambda: survey_charts.shadowing(
        shares(survey_table(n_beams=(2e5, 8e5, 3e6)), "rs")
    ),
    "filled_profiles": lambda: survey_charts.filled_profiles(
        profile("true", "hit", "reached").assign(n_beams=3e6)
    ),
    "shadow_maps": lambda: survey_charts.shadow_maps(
        {
            f"{stand}/{design}/{level}": RNG.uniform(size=(10, 10))
            for stand in STANDS
            for design in DESIGNS
            for level in range(3)
        },
        1.0,
    ),
    "regressions": lambda: survey_charts.regressions(
        shares(
            rows(stand=STANDS, design=DESIGNS, coverage_class=("0-20", "20-40", "80-100")),
            "slope",
            "r2",
        )
    ),
    "corrected_profiles": lambda: survey_charts.corrected_profiles(
        profile("true_share", "measured_share", "corrected_share")
    ),
    "plan": lambda: survey_charts.plan(
        shares(rows(stand=STANDS, planner=("planner", "random", "diamond"), n_scans=(1, 2)), "rs")
    ),
    "simulated": lambda: chlorophyll_maps.simulated(pairs(), scores()),
    "field": lambda: chlorophyll_maps.field(pairs(), scores()),
    "spectra": spectra,
    "losses": losses,
    "chlorophyll_map": chlorophyll_map,
}
SAID = (
    "[m]", "[%]", "[nm]", f"[{chlorophyll_maps.UNIT}]", "share of voxels", "mean squared error",
)  # fmt: skip
"""Units, and quantities that have none."""


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_of_a_study_names_a_unit_or_a_quantity_without_one(name):
    words = legibility.words_of_axes(FIGURES[name]())
    assert any(one in words for one in SAID), words


@pytest.mark.parametrize("name", FIGURES)
def test_every_word_of_a_study_can_be_read_in_print(name):
    printed_pt = legibility.smallest_printed_pt(FIGURES[name]())
    assert printed_pt >= legibility.LEAST_PRINTED_PT


@pytest.mark.parametrize("name", FIGURES)
def test_no_word_of_a_study_is_cut_off_or_written_over(name):
    figure = FIGURES[name]()
    assert legibility.is_whole(figure)
    assert legibility.overwritten_titles(figure) == []


def test_a_line_for_every_level_but_the_finest_has_its_effect_and_its_share_of_the_cost():
    def level(name, effect, cpu_s):
        return {"level": name, "rmse_rel": effect, "effect_rel": effect, "cpu_s": cpu_s}

    facts = {
        "tolerance": 0.01, "run_step_min": 10, "chosen": {"sky_patches": 145},
        "refinements": {
            "sky_patches": [level(577, 0.0, 20.0), level(145, 0.004, 10.0), level(1, 0.2, 5.0)],
            "step_min": [level(1, 0.0, 8.0), level(10, 0.03, 2.0)],
        },
        "geometry": {"wood": [level("kept", 0.0, 4.0), level("left out", 0.0000001, 3.0)]},
    }  # fmt: skip
    figure = effects_chart.draw(facts)
    effects, costs = figure.axes
    names = [label.get_text() for label in effects.get_yticklabels()]
    shares = [bar.get_width() for bar in costs.patches]
    assert dict(zip(names, shares, strict=True)) == {
        "sky patches: 145": 0.5, "sky patches: 1": 0.25, "sun every 10 min": 0.25,
        "wood left out": 0.75,
    }  # fmt: skip
    said = {text.get_text() for text in effects.texts}
    assert {"0.4 %", "20 %", "3 %", "0.001 %"} <= said
    colours = [line.get_color() for line in effects.lines if line.get_marker() == "o"][:4]
    assert colours[::-1] == [
        effects_chart.LEFT_OUT, effects_chart.KEPT, *[effects_chart.GEOMETRY] * 2,
    ]  # fmt: skip


def test_a_slice_through_crowns_holds_what_lies_in_it():
    height = Raster(np.full((1, 8, 8), 5.0, np.float32), 100.0, 208.0, 1.0, "", ("height_m",))
    labels = Raster(np.ones((1, 8, 8), np.float32), 100.0, 208.0, 1.0, "", ("crown",))
    places = np.array([[102.0, 203.5, 1.0], [103.0, 204.4, 3.0], [104.0, 206.0, 2.0]])
    figure = crown_map.crowns(height, labels, places, places[:2], slice_m=1.0)
    points, facets = (figure.axes[k].collections[0].get_offsets() for k in (1, 2))
    assert points.tolist() == facets.tolist() == [[2.0, 0.0], [3.0, 2.0]]
    assert "1 m deep" in figure.axes[1].get_title("left")
