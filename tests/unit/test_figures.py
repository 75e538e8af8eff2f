"""Figures: what they show is where and when it is, and the same data give the same bytes."""

import matplotlib as mpl
import numpy as np
import pandas as pd
import pytest
import xarray as xr
from matplotlib.backends.backend_agg import FigureCanvasAgg
from tests import legibility

from dapple.errors import InputError
from dapple.figures import boxplot, daily_courses, ground_map, painter, scatter, style, tree
from dapple.formats.meshes import Mesh
from dapple.scene.surfaces import Scene, of_kinds

TIMES = pd.date_range("2023-08-10 10:00", periods=30, freq="min", tz="UTC")


def square(centre_m, normal_axis, half_m=1.0):
    """A square of two triangles across one axis."""
    a, b = np.delete(np.eye(3), normal_axis, axis=0) * half_m
    corners = np.asarray(centre_m, float) + np.array([-a - b, a - b, a + b, b - a])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def records(names=("polygons", "voxels_0.2")):
    rng = np.random.default_rng(0)
    rows = []
    for name in names:
        for sensor in ("1_1", "1_3", "2_1"):
            measured = 800 + 600 * np.sin(np.arange(30) / 4)
            simulated = measured + rng.normal(0, 80, 30)
            rows.append(
                pd.DataFrame(
                    {
                        "reconstruction": name,
                        "sensor": sensor,
                        "time": TIMES,
                        "measured": measured,
                        "simulated": simulated,
                        "direct": simulated - 100,
                    }
                )
            )
    return pd.concat(rows, ignore_index=True)


def per_sensor():
    r = {"polygons": [0.9, 0.8, 0.95], "voxels_0.2": [0.7, np.nan, 0.6]}
    rows = [
        (n, s, v) for n, v3 in r.items() for s, v in zip(("1_1", "1_3", "2_1"), v3, strict=True)
    ]
    return pd.DataFrame(rows, columns=["reconstruction", "sensor", "r"])


def overall():
    return pd.DataFrame(
        {
            "reconstruction": ["polygons", "voxels_0.2"],
            "n": [90, 90],
            "r": [0.92, 0.85],
            "r_low": [0.9, np.nan],
            "r_high": [0.94, np.nan],
            "rmse": [100.0, 150.0],
            "bias": [10.0, -20.0],
            "baseline_r": [0.3, 0.3],
        }
    )


def ground():
    """Four maps, dark in the north-east corner only."""
    par = np.full((4, 6, 8), 1000.0)
    par[:, 4:, 6:] = 50.0
    coords = {"time": pd.date_range("2023-08-10 11:00", periods=4, freq="h")}
    coords |= {"y": np.arange(6) + 0.5, "x": np.arange(8) + 0.5}
    return xr.DataArray(par, coords, ("time", "y", "x"))


def voxels():
    """1 m voxels: one column towards north holds 1 and 2 m² m⁻³, one voxel is unknown."""
    density = np.zeros((2, 3, 4))
    density[0, 0, 1], density[0, 2, 1], density[1, 0, 3] = 1.0, 2.0, np.nan
    coords = {axis: np.arange(n) + 0.5 for axis, n in zip("xyz", density.shape, strict=True)}
    name = {"plant_area_density_m2_m3": (("x", "y", "z"), density)}
    return xr.Dataset(name, coords, {"voxel_size_m": 1.0})


def sensors():
    return pd.DataFrame({"sensor": ["1_1"], "x_m": [0.5], "y_m": [-1.5], "z_m": [0.1]})


def pixels(figure):
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    return np.asarray(canvas.buffer_rgba())[:, :, :3] / 255


def colour_at(figure, axes, x, y):
    """What is painted at a place in data coordinates."""
    image = pixels(figure)
    column, row = axes.transData.transform((x, y)).round().astype(int)
    return image[image.shape[0] - 1 - row, column]


FIGURES = {
    "tree": lambda: tree.draw(Scene(of_kinds(leaf=square((0, 0, 3), 2))), sensors=sensors()),
    "voxels": lambda: tree.draw(Scene((), voxels()), scan_positions_m=np.array([[9.0, 0, 1.5]])),
    "series": lambda: daily_courses.draw(
        records(), ["1_1", "2_1"], timezone="Europe/Berlin", per_sensor=per_sensor()
    ),
    "boxplot": lambda: boxplot.draw(per_sensor(), overall()),
    "ground_map": lambda: ground_map.draw(ground(), stem_m=(3, 3)),
    "ground_map_in_one_row": lambda: ground_map.draw(
        ground()[:2],
        sun=pd.DataFrame({"sun_zenith_deg": [30.0, 40.0], "sun_azimuth_deg": [180.0, 200.0]}),
    ),
    "scatter": lambda: scatter.draw(records(), overall()),
    "scatter_of_four": lambda: scatter.draw(records("abcd"), overall()),
    "scatter_of_five": lambda: scatter.draw(records("abcde"), overall()),
}


@pytest.mark.parametrize("name", FIGURES)
def test_the_same_data_give_the_same_bytes_whatever_the_caller_has_set(name, tmp_path):
    style.save(FIGURES[name](), tmp_path / "first.png")
    with mpl.rc_context({"font.size": 30, "axes.grid": False, "savefig.dpi": 40}):
        style.save(FIGURES[name](), tmp_path / "second.png")
    first = (tmp_path / "first.png").read_bytes()
    assert first == (tmp_path / "second.png").read_bytes()
    assert b"tEXt" not in first
    for number in "12":
        style.save(FIGURES[name](), tmp_path / f"vector{number}.pdf")
    vector = (tmp_path / "vector1.pdf").read_bytes()
    assert vector == (tmp_path / "vector2.pdf").read_bytes()
    assert b"Date" not in vector
    assert list(tmp_path.glob(".partial*")) == []


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_names_a_unit_or_a_quantity_without_one(name):
    words = legibility.words_of_axes(FIGURES[name]())
    assert any(unit in words for unit in ("[m]", f"[{style.PAR_UNIT}]", "Pearson's r"))


@pytest.mark.parametrize("name", FIGURES)
def test_every_word_can_be_read_in_print(name):
    printed_pt = legibility.smallest_printed_pt(FIGURES[name]())
    assert printed_pt >= legibility.LEAST_PRINTED_PT


@pytest.mark.parametrize("name", FIGURES)
def test_no_title_or_label_is_cut_off(name):
    figure = FIGURES[name]()
    assert legibility.is_whole(figure)
    assert legibility.overwritten_titles(figure) == []


def test_a_figure_lies_as_png_and_pdf(tmp_path):
    style.save_both(FIGURES["boxplot"](), tmp_path / "boxplot.png")
    assert (tmp_path / "boxplot.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "boxplot.pdf").read_bytes().startswith(b"%PDF")


def test_a_failed_write_leaves_no_file(tmp_path):
    figure = style.new_figure(2, 2)
    figure.text(0, 0, "$\\nosuchcommand$")
    with pytest.raises(ValueError, match="nosuchcommand"):
        style.save(figure, tmp_path / "figure.png")
    assert list(tmp_path.iterdir()) == []


def test_each_reconstruction_keeps_its_colour_and_no_two_share_one():
    assert len(set(style.COLOURS.values())) == len(style.COLOURS)
    assert style.colour("polygons", ("truth", "polygons")) == style.colour("polygons")
    assert style.colour("a", ("a", "b")) != style.colour("b", ("a", "b"))


def test_names_are_written_as_a_person_would():
    labels = [
        style.label(name) for name in ("voxels_0.2", "voxels_0.2_corrected", "virtual_leaves")
    ]
    assert labels == ["voxels 0.2 m", "voxels 0.2 m corrected", "virtual leaves"]


def test_a_painted_triangle_covers_its_area():
    corners = np.array([[[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]])
    image = painter.render(corners, np.ones((1, 3)), np.zeros(2), np.ones(2), width_px=100)
    assert image[:, :, 3].mean() == pytest.approx(0.5, abs=0.01)
    assert image[5, 5].tolist() == [1, 1, 1, 1]
    assert image[95, 95].tolist() == [0, 0, 0, 0]


def test_triangles_that_cross_are_each_in_front_on_their_side():
    flat = [[-1.0, -1, 0], [3, -1, 0], [-1, 3, 0]]
    tilted = [[-1.0, -1, -1.5], [3, -1, 2.5], [-1, 3, -1.5]]  # nearer where across > 0.5
    rgb = np.array([[1.0, 0, 0], [0, 0, 1.0]])
    for order in ([0, 1], [1, 0]):
        corners = np.array([flat, tilted])[order]
        image = painter.render(corners, rgb[order], np.zeros(2), np.ones(2), width_px=20)
        assert image[5, 2, :3].tolist() == [1, 0, 0]
        assert image[5, 17, :3].tolist() == [0, 0, 1]


def test_the_upper_leaf_hides_the_lower_wood_from_above():
    scene = Scene(of_kinds(wood=square((0, 0, 1), 2), leaf=square((0, 0, 3), 2, half_m=0.5)))
    figure = tree.draw(scene)
    red, green, _ = colour_at(figure, figure.axes[1], 0, 0)
    assert green > red  # leaf
    red, green, _ = colour_at(figure, figure.axes[1], 0.8, 0.8)
    assert red > green  # wood beside the leaf


def test_what_stands_in_the_south_is_nearer_in_the_view_from_the_south():
    scene = Scene(of_kinds(leaf=square((0, 2, 2), 1), wood=square((0, -2, 2), 1, half_m=0.5)))
    figure = tree.draw(scene)
    red, green, _ = colour_at(figure, figure.axes[0], 0, 2)
    assert red > green
    red, green, _ = colour_at(figure, figure.axes[0], 0.8, 2.8)
    assert green > red


def test_a_tree_high_above_nought_has_a_figure_of_its_own_size():
    low, high = (
        tree.draw(Scene(of_kinds(leaf=square((0, 0, z_m), 2)), ground_z_m=ground_m))
        for z_m, ground_m in ((3.0, 0.0), (503.0, 0.0))
    )
    assert high.get_size_inches()[1] <= low.get_size_inches()[1]
    on_the_hill = tree.draw(Scene(of_kinds(leaf=square((0, 0, 503), 0)), ground_z_m=502.0))
    assert on_the_hill.axes[0].lines[0].get_ydata()[0] == 502.0


def test_both_views_of_a_tree_have_one_scale():
    figure = tree.draw(Scene(of_kinds(leaf=square((0, 0, 3), 2), wood=square((0, 0, 2), 1))))
    scales = [
        np.diff(axes.transData.transform([(0, 0), (1, 1)]), axis=0)[0] for axes in figure.axes
    ]
    assert np.concatenate(scales) == pytest.approx(scales[0][0])


def test_voxels_add_up_along_the_line_of_sight_and_the_unknown_is_told_apart():
    figure = tree.draw(Scene((), voxels()))
    unknown, squares = figure.axes[0].collections[-2:]
    area = squares.get_array().reshape(4, 2)
    assert area[1, 0] == pytest.approx(3.0)
    assert area.mask.sum() == 7
    assert np.ma.count(unknown.get_array()) == 1
    assert "unknown: too few shots" in [t.get_text() for t in figure.legends[0].get_texts()]


def test_a_scanner_beyond_the_frame_is_marked_from_above_only_and_within_it():
    scene = Scene(of_kinds(leaf=square((0, 0, 3), 2)))
    side, above = tree.draw(scene, scan_positions_m=np.array([[30.0, 0.0, 1.5]])).axes
    assert len(side.collections) == 0
    (x, y), limit = above.collections[0].get_offsets()[0], above.get_xlim()[1]
    assert 0.8 * limit < x < limit
    assert y == pytest.approx(0)


def test_series_are_drawn_at_their_hour_in_utc_and_tell_the_local_one():
    figure = daily_courses.draw(records(), ["1_1"], timezone="Europe/Berlin")
    start = mpl.dates.num2date(figure.axes[0].lines[0].get_xdata(orig=False)[0])
    assert (start.hour, start.minute) == (10, 0)
    assert "UTC on 10 August 2023 (local time: UTC +2 h" in figure.get_supxlabel()


def test_the_name_of_a_sensor_is_not_written_over_by_the_r_of_five_reconstructions():
    names = list("abcde")
    sensors_r = pd.DataFrame({"reconstruction": names, "sensor": "1_1", "r": 0.89})
    data = records("abcde")
    figure = daily_courses.draw(data, ["1_1"] * 3, timezone="UTC", per_sensor=sensors_r)
    FigureCanvasAgg(figure).draw()
    axes = figure.axes[0]
    title = next(one for one in (axes.title, axes._left_title) if one.get_text())
    boxes = [one.get_window_extent() for one in (title, *axes.texts)]
    assert not any(boxes[0].overlaps(other) for other in boxes[1:])


def test_no_line_crosses_missing_records():
    data = records()
    data = data[~data["time"].between(TIMES[10], TIMES[19])]
    line = daily_courses.draw(data, ["1_1"], timezone="UTC").axes[0].lines[0]
    assert np.isnan(line.get_ydata()).sum() == 1
    assert len(line.get_ydata()) == 21


def test_without_records_the_simulations_are_drawn_alone():
    figure = daily_courses.draw(records().drop(columns="measured"), ["1_1"], timezone="UTC")
    labels = [line.get_label() for line in figure.axes[0].lines]
    assert len(labels) == 2
    assert "measured" not in labels


def test_the_predictive_interval_is_that_of_the_first_reconstruction():
    data = records()
    data = data.assign(low=data["simulated"] - 50, high=data["simulated"] + 150)
    band = daily_courses.draw(data, ["1_1"], timezone="UTC").axes[0].collections[0]
    first = data[(data["reconstruction"] == data["reconstruction"][0]) & (data["sensor"] == "1_1")]
    low, high = band.get_paths()[0].vertices[:, 1].min(), band.get_paths()[0].vertices[:, 1].max()
    assert (low, high) == pytest.approx((first["low"].min(), first["high"].max()))


def test_an_unknown_sensor_is_named():
    with pytest.raises(InputError, match="found 9_9; expected labels such as 1_1"):
        daily_courses.draw(records(), ["1_1", "9_9"], timezone="UTC")


def test_components_are_the_light_that_is_not_direct():
    figure = daily_courses.draw(records(), ["1_1"], timezone="UTC", components_of="polygons")
    assert figure.axes[0].collections[0].get_paths()[0].vertices[:, 1].max() == pytest.approx(100)


def test_sensors_are_chosen_evenly_from_the_darkest_to_the_brightest():
    light = [50.0, 60, 70, 600, 800, 950, *[2000.0 + k for k in range(20)]]
    shown = pd.DataFrame({"sensor": [f"s{k}" for k in range(len(light))], "measured": light})
    shown["time"] = TIMES[0]
    chosen = daily_courses.choose_sensors(shown, count=4)
    assert chosen == ["s0", "s3", "s4", "s5"]
    assert daily_courses.choose_sensors(shown[:3]) == ["s0", "s1", "s2"]


def test_sensors_under_the_open_sky_are_chosen_last():
    light = [100.0, 900, 2000, 2001, 2002, 2003]
    shown = pd.DataFrame({"sensor": list("abcdef"), "measured": light, "time": TIMES[0]})
    assert daily_courses.choose_sensors(shown, count=2) == ["a", "b"]
    assert daily_courses.choose_sensors(shown, count=3) == ["a", "b", "c"]


def test_sensors_are_chosen_where_nothing_was_measured_or_seen():
    night = pd.DataFrame({"sensor": ["a", "b"] * 2, "simulated": 0.0, "time": TIMES[0]})
    assert daily_courses.choose_sensors(night) == ["a", "b"]


def test_a_box_has_a_point_for_every_sensor_that_has_an_r():
    axes = boxplot.draw(per_sensor()).axes[0]
    assert [len(c.get_offsets()) for c in axes.collections] == [3, 2]
    assert [t.get_text() for t in axes.get_xticklabels()] == [
        "polygons\n(n = 3)",
        "voxels 0.2 m\n(n = 2)",
    ]


def test_north_is_up_and_east_is_right_on_the_ground():
    figure = ground_map.draw(ground())
    axes = figure.axes[0]
    dark, bright = colour_at(figure, axes, 7, 5), colour_at(figure, axes, 1, 1)
    assert dark == pytest.approx(mpl.colormaps[style.LIGHT_MAP](0.05)[:3], abs=0.02)
    assert bright == pytest.approx(mpl.colormaps[style.LIGHT_MAP](1.0)[:3], abs=0.02)


def test_maps_of_all_times_share_one_colour_scale():
    par = ground() * xr.DataArray([1.0, 0.8, 0.5, 0.1], dims="time")
    figure = ground_map.draw(par)
    assert {axes.images[0].get_clim() for axes in figure.axes[:4]} == {(0.0, 1000.0)}


def test_the_sun_is_marked_on_its_side_of_the_map():
    sun = pd.DataFrame({"sun_zenith_deg": [40.0] * 4, "sun_azimuth_deg": [90, 180, 270, 225]})
    figure = ground_map.draw(ground(), sun=sun)
    east, south = (axes.collections[-1].get_offsets()[0] for axes in figure.axes[:2])
    assert tuple(east) == pytest.approx((7.8, 3.0), abs=0.1)
    assert tuple(south) == pytest.approx((4.0, 0.13), abs=0.1)


def test_panels_of_the_scatter_share_axes_and_colours():
    figure = scatter.draw(records(), overall())
    first, second = (axes.collections[0] for axes in figure.axes[:2])
    assert first.norm is second.norm
    assert first.get_array().sum() == 90
    # A single record shows on white.
    assert np.mean(first.cmap(0.0)[:3]) < 0.85
    assert "r = 0.92 (0.90 to 0.94)" in figure.axes[0].texts[0].get_text()
    assert [axes.get_title(loc="left") for axes in figure.axes[:2]] == ["polygons", "voxels 0.2 m"]
