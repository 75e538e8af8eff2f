"""Advice: what each refinement changes is measured, and only what costs something is left out."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.advice import cheapest, costs, refinements
from dapple.advice.costs import Cost
from dapple.advice.pilot import Effect, Pilot
from dapple.formats.meshes import Mesh
from dapple.formats.netcdf import time_coordinate
from dapple.light import light_model
from dapple.light.light_model import Model, Tracing
from dapple.light.visibility import Sunlit
from dapple.scene import traced
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.open_sky import open_sky_par
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

WAVELENGTH = np.linspace(400, 700, 7)
OPTICS = Optics.of_tree(
    WAVELENGTH, *(np.linspace(low, low + 0.1, 7) for low in (0.05, 0.02, 0.15, 0.1))
)


def sky_at(minutes):
    """A sun that moves half a degree a minute, in seven bands."""
    n = len(minutes)
    units = {"units": "µmol m-2 s-1", "long_name": "light"}
    stamps = pd.Timestamp("2023-08-10 11:00", tz="UTC") + pd.to_timedelta(minutes, unit="min")
    return xr.Dataset(
        {
            "sun_zenith_deg": ("time", 30 + np.asarray(minutes) * 0.1),
            "sun_azimuth_deg": ("time", 150 + np.asarray(minutes) * 0.5),
            "beam_normal_umol_m2_s": (("time", "band"), np.full((n, 7), 200.0), units),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), np.full((n, 7), 40.0), units),
            "sky_coefficients": (
                ("time", "coefficient"),
                np.tile([-1.0, -0.3, 10.0, -3.0, 0.45], (n, 1)),
            ),
        },
        coords={"time": time_coordinate(pd.DatetimeIndex(stamps))},
        attrs={"latitude_deg": 48.0, "longitude_deg": 7.8, "altitude_m": 230.0}
        | {"sky_model": "perez"},
    )


def square(height_m, half_m, x_m=0.0, y_m=0.0):
    around = ((-1, -1), (1, -1), (1, 1), (-1, 1))
    corners = np.array([(x_m + a * half_m, y_m + b * half_m, height_m) for a, b in around])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def a_pilot(minutes=(0, 60, 120), finest=None):
    return Pilot(
        np.array([[0.0, 0.0, 0.1], [1.0, 0.0, 0.1]]),
        sky_at(list(minutes)),
        OPTICS,
        finest=finest or Model(bands=7, sky_patches=577),
        tracing=Tracing(
            paths=2048,
            sky_rays=9232,
            max_shadow_rays=1024,
            tolerance=0.005,
            sun_diameter_deg=SUN_DIAMETER_DEG,
            sun_kernel_deg=8.0,
        ),
        repeats=1,
        seed=3,
    )


# What a model leaves out


def test_times_are_at_least_a_step_apart_and_the_ends_are_among_them():
    minutes = np.arange(0, 61, 1.0)
    assert list(light_model.thinned(minutes, 30)) == [0, 30, 60]
    assert list(light_model.thinned(minutes, 25)) == [0, 25, 50, 60]
    assert len(light_model.thinned(minutes, 0)) == len(light_model.thinned(minutes, 1)) == 61


def test_between_known_times_the_share_of_the_sun_is_linear_and_at_them_it_is_kept():
    known, wanted = np.array([0.0, 10.0, 30.0]), np.arange(0, 31, 5.0)
    share = np.array([[[0.0, 1.0, 0.0]]])
    seen = Sunlit(share, np.zeros((1, 3)), np.array([[8, 16, 32]]))
    between = light_model.interpolated(seen, known, wanted)
    assert between.share[0, 0] == pytest.approx([0, 0.5, 1, 0.75, 0.5, 0.25, 0])
    assert between.n_rays.shape == (1, 7)


def test_groups_of_bands_carry_all_the_light():
    sky = sky_at([0, 30])
    for bands in (1, 3):
        fewer, optics = light_model.simplified(sky, OPTICS, Model(bands=bands))
        assert len(optics) == fewer.sizes["band"] == bands
        assert open_sky_par(fewer).to_numpy() == pytest.approx(open_sky_par(sky).to_numpy())


def test_a_full_model_keeps_sky_and_spectra_as_they_are():
    sky = sky_at([0, 30])
    kept, optics = light_model.simplified(sky, OPTICS, Model(bands=7))
    assert kept.identical(sky)
    assert optics is OPTICS
    plain, black = light_model.simplified(
        sky, OPTICS, Model(bands=7, sky="isotropic", ground="black")
    )
    assert plain.attrs["sky_model"] == "isotropic"
    assert "sky_coefficients" not in plain
    assert not black.reflectance["ground"].any()


# What refinements change


def test_under_an_open_sky_no_refinement_changes_the_light():
    one = a_pilot()
    # a leaf far below the horizon's reach: the scene needs something to be traced
    scene = traced.load(
        Scene(of_kinds(leaf=square(-0.5, 0.01, x_m=50.0)), None, 0.0), "llvm_ad_mono"
    )
    effects, finest = refinements.model_effects(one, scene)
    assert finest.par == pytest.approx(np.tile(one.open_sky, (2, 1)), rel=1e-4)
    assert {effect.refinement for effect in effects} == set(refinements.LEVELS)
    assert max(effect.rmse_rel for effect in effects) < 1e-4
    steps = refinements.step_effects(one, scene, one.sky, seed=1)
    assert [effect.level for effect in steps] == [30, 10, 5, 2, 1]
    assert max(effect.rmse_rel for effect in steps) == 0


def test_under_a_leaf_scattering_and_the_edge_of_its_shade_count():
    one = a_pilot(minutes=range(0, 181, 20))
    scene = traced.load(Scene(of_kinds(leaf=square(2.0, 0.5, y_m=-1.3)), None, 0.0), "llvm_ad_mono")
    effects = refinements.model_effects(one, scene)[0]
    by_level = {(effect.refinement, effect.level): effect for effect in effects}
    # light that is left out is missing
    assert by_level["max_orders", 0].bias_rel < 0
    assert by_level["max_orders", 0].rmse_rel > by_level["max_orders", 2].rmse_rel
    assert by_level["ground", "black"].bias_rel < 0
    assert by_level["bands", 3].rmse_rel < by_level["bands", 1].rmse_rel + 1e-6 < 0.01
    # each refinement ends with the finest itself
    assert all(
        by_level[name, getattr(one.finest, name)].rmse_rel == 0 for name in refinements.LEVELS
    )
    assert all(set(effect.parts) == set(costs.PARTS) for effect in effects)
    assert all(effect.cost.wall_s > 0 for effect in effects)
    # counted work is the same in every run
    again = refinements.model_effects(one, scene)[0]
    assert [e.cost.work_s for e in again] == [e.cost.work_s for e in effects]
    assert (
        by_level["sun", "point"].parts["direct"].work_s
        < by_level["sun", "disc"].parts["direct"].work_s
    )
    assert (
        by_level["max_orders", 0].parts["paths"].work_s
        < by_level["max_orders", 2].parts["paths"].work_s
    )
    # shade that moves over the sensor is missed by long steps
    steps = refinements.step_effects(one, scene, one.sky, seed=1)
    assert steps[0].rmse_rel > steps[-2].rmse_rel > steps[-1].rmse_rel == 0


# What is chosen


def parts(direct, paths, products):
    return {
        "direct": Cost(direct, direct, direct),
        "paths": Cost(paths, paths, paths),
        "products": Cost(products, products, products),
    }


FINEST = Model(max_orders=12, step_min=10.0)
FULL = parts(10.0, 20.0, 1.0)
EFFECTS = [
    Effect("sun", "point", 0.1, 0.0, 0.0, parts(1.0, 20.0, 1.0)),
    Effect("sun", "disc", 0.0, 0.0, 0.0, FULL),
    Effect("sky_patches", 145, 0.004, 0.0, 0.0, parts(10.0, 10.0, 1.0)),
    Effect("sky_patches", 2305, 0.0, 0.0, 0.0, FULL),
    Effect("sky", "isotropic", 0.001, 0.0, 0.0, parts(5.0, 10.0, 0.5)),
    Effect("sky", "as given", 0.0, 0.0, 0.0, FULL),
    Effect("max_orders", 1, 0.013, 0.0, 0.0, parts(10.0, 5.0, 1.0)),
    Effect("max_orders", 2, 0.003, 0.0, 0.0, parts(10.0, 10.0, 1.0)),
    Effect("max_orders", 12, 0.0, 0.0, 0.0, FULL),
    Effect("step_min", 30, 0.2, 0.0, 0.0, {"direct": Cost(0.1, 0.1, 0.1)}),
    Effect("step_min", 10, 0.15, 0.0, 0.0, {"direct": Cost(0.3, 0.3, 0.3)}),
    Effect("step_min", 1, 0.0, 0.0, 0.0, {"direct": Cost(3.0, 3.0, 3.0)}),
]
SAME_SIZE = cheapest.Scale(1.0, 1.0, 1.0)


def chosen(tolerance, measure=lambda model: 0.0):
    return cheapest.choose(EFFECTS, FINEST, tolerance=tolerance, scale=SAME_SIZE, measure=measure)


def test_the_cheapest_model_whose_effects_add_up_to_the_tolerance_is_chosen():
    found = chosen(0.02)
    assert found.model == replace(FINEST, sky_patches=145, max_orders=1)
    assert found.effects_rel == pytest.approx(0.017)
    # 13 and 4 thousandths are too much together; of equal cost, the finer model
    assert chosen(0.015).model == replace(FINEST, sky_patches=145, max_orders=2)
    assert chosen(0.001).model == FINEST


def test_the_choice_does_not_depend_on_the_clock():
    draw = np.random.default_rng(5)

    def elsewhere(effect):
        parts = {
            name: replace(cost, wall_s=draw.uniform(0.1, 9), cpu_s=draw.uniform(0.1, 9))
            for name, cost in effect.parts.items()
        }
        return replace(effect, parts=parts)

    other = [elsewhere(effect) for effect in EFFECTS]
    for tolerance in (0.001, 0.015, 0.02, 1.0):
        found = cheapest.choose(
            other, FINEST, tolerance=tolerance, scale=SAME_SIZE, measure=lambda model: 0.0
        )
        assert found.model == chosen(tolerance).model


def test_what_saves_nothing_is_never_left_out_whatever_the_clock_says():
    assert chosen(1.0).model.sky == "as given"


def test_the_series_own_times_are_no_approximation_and_no_finer_ones_are_traced():
    assert chosen(0.02).model.step_min == 10.0
    assert chosen(1.0).model.step_min == 30


def test_effects_that_add_up_worse_than_one_by_one_are_refused():
    found = chosen(0.02, lambda model: 0.03 if model.max_orders == 1 else 0.005)
    assert found.model == replace(FINEST, sky_patches=145, max_orders=2)
    assert found.measured_rel == pytest.approx(0.005)
    assert chosen(0.02, lambda model: 0.0 if model == FINEST else 1.0).model == FINEST


def test_the_run_costs_as_much_more_as_it_has_sensors_and_times():
    scale = cheapest.Scale.between((10, 5), (100, 50))
    cost = cheapest.predicted(EFFECTS, FINEST, FINEST, scale)
    # shadow rays and products grow with both, paths with sensors alone
    assert cost.wall_s == pytest.approx(100 * 10 + 10 * 20 + 100 * 1)
    cheaper = cheapest.predicted(EFFECTS, FINEST, replace(FINEST, sun="point", step_min=30), scale)
    assert cheaper.wall_s == pytest.approx(100 * 10 * 0.1 / 3 + 10 * 20 + 100 * 1)


def test_noise_is_not_taken_for_an_effect():
    assert Effect("wood", "absent", 0.005, 0.0, 0.004).effect_rel == pytest.approx(0.003)
    assert Effect("wood", "absent", 0.003, 0.0, 0.004).effect_rel == 0


def test_the_file_holds_plain_numbers_of_a_few_digits():
    rows = refinements.rounded(refinements.rows(EFFECTS[:1]))
    assert rows["sun"][0]["level"] == "point"
    assert rows["sun"][0]["wall_s"] == 22.0
    assert refinements.rounded({"a": [np.float64(0.123456)], "b": 12}) == {"a": [0.1235], "b": 12}
    assert type(refinements.rounded(np.float64(1.0))) is float
