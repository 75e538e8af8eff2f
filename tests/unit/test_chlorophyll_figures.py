"""Figures of chlorophyll: every model, mask and network has its panel, values their place."""

import numpy as np
import pandas as pd
import pytest

from dapple.figures import chlorophyll_maps

MODELS, MASKS, NETWORKS = ("collision_orders", "prosail"), ("sunlit", "all"), ("robust",)


def table(n_each, **columns):
    """Some rows for each model, mask and network."""
    rng = np.random.default_rng(1)
    rows = [
        {"model": model, "mask": mask, "network": network}
        | {key: rng.uniform(low, high) for key, (low, high) in columns.items()}
        for model in MODELS
        for mask in MASKS
        for network in NETWORKS
        for _ in range(n_each)
    ]
    return pd.DataFrame(rows)


SCORES = {"r2": (0.5, 0.9), "rmse": (4, 9), "n": (10, 20)}
PAIR = {"truth_ug_cm2": (10, 70), "predicted_ug_cm2": (10, 70)}


@pytest.mark.parametrize("draw", ["simulated", "field"])
def test_every_model_and_mask_has_a_panel_with_its_numbers(draw):
    own = table(30, **PAIR, low_ug_cm2=(0, 20), high_ug_cm2=(60, 80))
    figure = getattr(chlorophyll_maps, draw)(own, table(1, **SCORES))
    panels = [axes for axes in figure.axes if "pixels" in axes.get_title("left")]
    assert len(panels) == 4
    assert all("RMSE" in axes.texts[0].get_text() for axes in panels)
    assert all(axes.get_xlim() == axes.get_ylim() == (0, 80) for axes in panels)


def test_spectra_have_a_line_for_each_kind_of_pixel_and_model():
    pixels = pd.DataFrame(
        [(kind, nm, 0.2, 0.1) for kind in ("sunlit", "shaded", "all") for nm in (450, 840)],
        columns=["kind", "wavelength_nm", "mean", "deviation"],
    )
    entries = table(1, wavelength_nm=(450, 840), low=(0, 0.1), middle=(0.1, 0.2), high=(0.3, 0.4))
    left, right = chlorophyll_maps.spectra(pixels, entries).axes
    assert [text.get_text() for text in left.get_legend().texts] == ["sunlit", "shaded", "all"]
    assert len(right.get_legend().texts) == 3


def test_spectra_show_what_taught_where_all_pixels_did():
    pixels = pd.DataFrame(
        [
            (kind, nm, level, 0.1)
            for kind, level in (("sunlit", 0.3), ("all", 0.2))
            for nm in (4, 8)
        ],
        columns=["kind", "wavelength_nm", "mean", "deviation"],
    )
    entries = table(1, wavelength_nm=(4, 8), low=(0, 0.1), middle=(0.1, 0.2), high=(0.3, 0.4))
    _, right = chlorophyll_maps.spectra(pixels, entries[entries["mask"] == "all"]).axes
    assert "all pixels" in right.get_title("left")
    assert len(right.get_legend().texts) == 3
    assert right.lines[-1].get_ydata().tolist() == [0.2, 0.2]


def test_losses_are_drawn_for_every_seed():
    own = pd.concat([
        table(1, train_loss=(0.1, 0.2), validation_loss=(0.1, 0.2)).assign(seed=seed, epoch=epoch)
        for seed in (1, 2) for epoch in (1, 2, 3)
    ])  # fmt: skip
    panels = chlorophyll_maps.losses(own).axes
    assert [len(axes.lines) for axes in panels] == [4] * 4


def test_the_map_lies_where_its_cells_are_and_marks_strange_ones():
    values = np.full((5, 2, 3), 30.0)
    values[4] = [[0, 0, 1], [0, np.nan, 0]]
    ring = np.array([[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]])
    figure = chlorophyll_maps.chlorophyll_map(
        values, cell_m=3.0, size_m=(8.0, 5.0), rings=[ring], truth=[40.0]
    )
    left, right = figure.axes[:2]
    assert left.get_xlim() == (0, 8)
    assert left.get_ylim() == (0, 5)  # north is up
    assert left.images[0].get_extent() == [0, 9, -1, 5]
    assert left.patches[0].get_xy()[0] == pytest.approx([1.0, 1.0])
    assert right.lines[0].get_xydata().tolist() == [[7.5, 3.5]]
