"""LESS 3 on dapple's files against closed forms and against dapple's own engines."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from tests.physics.test_timestep import disc, leaves, level, optics, rays, voxels

from dapple import less3
from dapple.advice.geometries import Geometry
from dapple.advice.grid import Grid
from dapple.errors import InputError
from dapple.formats.netcdf import time_coordinate
from dapple.light import less_engine, less_files
from dapple.light.less_files import LessRays
from dapple.light.light_model import Tracing
from dapple.light.timestep_series import Reference
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.sky_radiance import in_directions

WITH_LESS = pytest.mark.skipif(find_spec("less") is None, reason="less3d 3.0.0 is not installed")
BEAM, DIFFUSE = np.array([500.0, 600.0, 700.0]), np.array([90.0, 80.0, 70.0])
DARK = np.zeros(3)
PEREZ = [-1.0, -0.3, 10.0, -3.0, 0.45]
"""Coefficients of a sky that is bright around the sun."""


def sky(*suns, beam=BEAM, diffuse=DIFFUSE, coefficients=None):
    """A sky with the sun at (zenith, azimuth), one after the other."""
    zenith, azimuth = np.array(suns, dtype=float).T
    times = pd.date_range("2023-08-10 10:00", periods=len(suns), freq="h", tz="UTC")
    found = xr.Dataset(
        {
            "sun_zenith_deg": ("time", zenith),
            "sun_azimuth_deg": ("time", azimuth),
            "beam_normal_umol_m2_s": (("time", "band"), np.tile(beam, (len(suns), 1))),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), np.tile(diffuse, (len(suns), 1))),
        },
        coords={"time": time_coordinate(times)},
        attrs={"sky_model": "isotropic" if coefficients is None else "perez"},
    )
    if coefficients is not None:
        found["sky_coefficients"] = (("time", "coefficient"), [coefficients] * len(suns))
    return found


def sensors(*places):
    table = pd.DataFrame(np.array(places, dtype=float), columns=["x_m", "y_m", "z_m"])
    table.insert(0, "sensor", [f"1_{k}" for k in range(len(places))])
    return table


def par(scene, above, table, kind="par", *, spectra=None, **more):
    """(sensors, times) light by LESS, one of its parts."""
    spectra = optics() if spectra is None else spectra
    return run(scene, above, table, spectra, **more)[f"{kind}_umol_m2_s"].to_numpy()


def run(scene, above, table, spectra, *, n_rays=12800, suns=32, diameter=0.533, aperture=0.0):
    found = LessRays(n_rays, suns, max_orders=12, sun_diameter_deg=diameter, seed=1)
    return less_engine.series(
        [scene], above, spectra, table, bands=3, rays=found, aperture_m=aperture
    )


@WITH_LESS
def test_the_open_sky_gives_beam_and_diffuse_light():
    suns = [(0.0, 0.0), (42.0, 200.0), (80.0, 310.0), (90.0, 320.0)]
    table = sensors((0.0, 0.0, 0.0), (9.0, -7.0, 2.0))
    found = run(Scene(), sky(*suns), table, optics(ground=0.3))
    cosine = np.cos(np.radians([zenith for zenith, _ in suns]))
    for values in found["par_direct_umol_m2_s"].to_numpy():
        assert values == pytest.approx(BEAM.sum() * cosine, rel=3e-3, abs=1e-9)
    assert found["par_sky_umol_m2_s"].to_numpy() == pytest.approx(DIFFUSE.sum(), rel=1e-4)
    assert (found["par_scattered_umol_m2_s"] == 0.0).all()


@WITH_LESS
def test_an_opaque_plate_takes_the_sky_that_it_covers_and_the_sun_behind_it():
    radius, height = 1.0, 1.0
    scene = Scene(of_kinds(wood=disc(radius, 1.0 + height)))
    above = sky((20.0, 70.0), (60.0, 70.0))
    found = run(scene, above, sensors((0.0, 0.0, 1.0)), optics(), n_rays=51200)
    direct = found["par_direct_umol_m2_s"].to_numpy()[0]
    assert direct == pytest.approx([0.0, BEAM.sum() * 0.5], rel=3e-3)
    seen = 1.0 - radius**2 / (radius**2 + height**2)
    for value in found["par_sky_umol_m2_s"].to_numpy()[0]:
        assert value == pytest.approx(DIFFUSE.sum() * seen, rel=0.01)


@WITH_LESS
def test_a_roof_in_the_north_east_shades_when_the_sun_is_there():
    scene = Scene(of_kinds(wood=level((0.4, 1.4), (1.0, 2.0), 2.0)), ground_z_m=0.5)
    compass = [(40.0, float(azimuth)) for azimuth in (31, 121, 211, 301)]
    direct = par(scene, sky(*compass), sensors((0.0, 0.0, 0.5)), "par_direct")
    unshaded = BEAM.sum() * np.cos(np.radians(40.0))
    assert direct[0] == pytest.approx(unshaded * np.array([0.0, 1.0, 1.0, 1.0]), rel=3e-3, abs=1e-9)


@WITH_LESS
def test_an_uneven_sky_is_as_bright_as_it_says_and_where_it_says():
    above = sky((50.0, 110.0), beam=DARK, coefficients=PEREZ)
    walls = [level((0.2, 8.0), (-4.0, 4.0), 1.0), level((-8.0, -0.2), (-4.0, 4.0), 1.0)]
    seen = [
        par(Scene(of_kinds(wood=wall)), above, sensors((0.0, 0.0, 0.1)), "par_sky", n_rays=51200)
        for wall in (level((9.0, 9.1), (0.0, 0.1), 1.0), *walls)
    ]
    assert seen[0] == pytest.approx(DIFFUSE.sum(), rel=0.01)
    # what the roofs leave, by the same sky's radiance over a fine grid of directions
    zenith, azimuth = np.meshgrid(np.arange(0.25, 90.0, 0.5), np.arange(0.5, 360.0), indexing="ij")
    weight = in_directions(above, zenith, azimuth)[0] * np.sin(np.radians(2.0 * zenith))
    x, y = (0.9 * np.tan(np.radians(zenith)) * f(np.radians(azimuth)) for f in (np.sin, np.cos))
    for value, side in zip(seen[1:], (1.0, -1.0), strict=True):
        hidden = (side * x > 0.2) & (side * x < 8.0) & (np.abs(y) < 4.0)
        share = weight[~hidden].sum() / weight.sum()
        assert value == pytest.approx(DIFFUSE.sum() * share, rel=0.03)


@WITH_LESS
def test_black_turbid_voxels_that_touch_let_exp_of_minus_two_through():
    # without the gap between the cubes LESS 3.0.0 lets nothing through
    scene = Scene(voxels=voxels(np.full((1, 1, 2), 2.0), 1.0, (-0.5, -0.5, 1.0)))
    above = sky((0.0, 0.0), diffuse=DARK)
    direct = par(scene, above, sensors((0.1, 0.2, 0.0)), "par_direct", n_rays=25600)
    assert direct[0, 0] == pytest.approx(BEAM.sum() * np.exp(-2.0), rel=0.04)


@WITH_LESS
def test_cubes_that_touch_are_opaque_in_less(monkeypatch):
    monkeypatch.setattr(less_files, "VOXEL_GAP", 1.0)
    scene = Scene(voxels=voxels(np.full((1, 1, 2), 2.0), 1.0, (-0.5, -0.5, 1.0)))
    above = sky((0.0, 0.0), diffuse=DARK)
    assert par(scene, above, sensors((0.1, 0.2, 0.0)), "par_direct")[0, 0] < 1.0


@WITH_LESS
def test_less_and_mitsuba_see_the_same_light_under_a_small_crown():
    crown = leaves(400, 0.12, (-0.8, -0.8, 0.8), (0.8, 0.8, 2.0), seed=3)
    scene = Scene(of_kinds(leaf=crown, wood=level((-0.1, 0.1), (-0.1, 0.1), 0.7)))
    above, spectra = sky((35.0, 140.0), (60.0, 250.0)), optics(0.3, 0.2, 0.4, 0.3)
    table = sensors((0.3, 0.0, 0.2), (-0.4, 0.5, 0.0), (2.0, 1.0, 0.4))
    more = {"bands": 3, "sun_diameter_deg": 0.533, "aperture_m": 0.0}
    numbers = rays(direct=512, sky=512, scattered=256)
    counted = {f"{name}_rays": getattr(numbers, name) for name in ("direct", "sky", "scattered")}
    mitsuba = Reference(
        [scene], above, spectra, **more, **counted, replicates=16, max_depth=13,
        variant="llvm_ad_rgb", seed=2,
    )  # fmt: skip
    found = run(scene, above, table, spectra, n_rays=51200)
    for index in range(2):
        one, other = found.isel(time=[index]), mitsuba.at(index, table)
        error = np.hypot(*(x["standard_error_umol_m2_s"] for x in (one, other)))
        difference = one["par_umol_m2_s"] - other["par_umol_m2_s"]
        assert float(np.abs(difference / error).max()) < 4.0
        for part in ("sky", "scattered"):
            two = (float(x[f"par_{part}_umol_m2_s"].sum()) for x in (one, other))
            assert next(two) == pytest.approx(next(two), rel=0.05)


@WITH_LESS
def test_an_exported_scene_run_without_dapple_gives_the_light_of_the_engine(tmp_path, monkeypatch):
    crown = leaves(50, 0.2, (-0.8, -0.8, 0.8), (0.8, 0.8, 2.0), seed=3)
    scene = Scene(of_kinds(leaf=crown, wood=level((-0.1, 0.1), (-0.1, 0.1), 0.7)))
    table, spectra = sensors((0.3, 0.0, 0.2), (-0.4, 0.5, 0.0)), optics(0.3, 0.2, 0.4, 0.3)
    above = sky((35.0, 140.0), coefficients=PEREZ)
    numbers = LessRays(640, 2, max_orders=12, sun_diameter_deg=0.0, seed=1)
    less_files.write(tmp_path, scene, spectra, above, table, numbers)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    monkeypatch.chdir(tmp_path)
    less3.run(Path("less_run.py"), Path())
    written = pd.read_csv(tmp_path / "light.csv")
    found = run(scene, above, table, spectra, n_rays=640, diameter=0.0)
    assert written["sensor"].tolist() == ["1_0", "1_1"]
    for name in ("par", "par_direct", "par_sky", "par_scattered", "standard_error"):
        engine = found[f"{name}_umol_m2_s"].to_numpy()[:, 0]
        assert written[name.removeprefix("par_")].to_numpy() == pytest.approx(engine, rel=1e-12)


def test_the_sky_on_the_grid_of_less_has_a_horizontal_irradiance_of_one():
    even = less_files.sky_radiance(sky((50.0, 110.0)))
    assert even == pytest.approx(1.0 / np.pi, rel=1e-4)
    uneven = less_files.sky_radiance(sky((50.0, 110.0), coefficients=PEREZ))[0]
    # brightest near the sun, which is at 8.3 and 9.8 steps of the grid
    assert np.unravel_index(uneven.argmax(), uneven.shape) in [(8, 10), (9, 10)]


def test_without_less_the_message_says_what_to_do(monkeypatch):
    monkeypatch.setattr(less3, "find_spec", lambda name: None)
    with pytest.raises(InputError, match=r"pip install less3d==3\.0\.0"):
        run(Scene(), sky((30.0, 0.0)), sensors((0.0, 0.0, 0.0)), optics())


def test_leaf_angles_that_less_does_not_know_are_an_error(tmp_path):
    grid = voxels(np.ones((1, 1, 1)), leaf_angle_distribution="beta")
    numbers = LessRays(64, 2, max_orders=1, sun_diameter_deg=0.0, seed=1)
    with pytest.raises(InputError, match="beta"):
        less_files.write(
            tmp_path, Scene(voxels=grid), optics(), sky((30.0, 0.0)), sensors((0, 0, 0)), numbers
        )


@WITH_LESS
def test_the_trade_off_holds_less_to_the_same_sensors_and_times():
    """More rays err less; under a plain tree both engines find the same light."""
    scene = Scene(of_kinds(leaf=leaves(400, 0.1, (-1, -1, 0.5), (1, 1, 2), seed=1)))
    table = sensors((0.0, 0.0, 0.1), (0.4, 0.2, 0.1))
    options = {"bands": 3, "aperture_m": 0.03, "rays": 1, "suns": 4, "max_orders": 3}
    grid = Grid(
        table,
        sky((30.0, 180.0), (50.0, 240.0)),
        optics(),
        paths=[256],
        sky_patches=[145],
        orders=[3],
        max_orders=3,
        timestep_rays=[],
        timestep={},
        tracing=Tracing(aperture_m=0.03, sun_diameter_deg=0.533, sun_kernel_deg=8.0),
        less_rays=[64, 12800],
        less=options | {"sun_diameter_deg": 0.533},
        repeats=1,
        variant="llvm_ad_mono",
        seed=1,
        truth=scene,
    )
    points = pd.DataFrame(grid.points([Geometry("polygons", 0.05, lambda: scene)], 0.05))
    few, many = points[points["engine"] == "less"].to_dict("records")
    assert (few["paths"], many["paths"]) == (64, 12800)
    assert (few["n_sensors"], few["n_times"]) == (2, 2)
    assert many["error_rel"] < few["error_rel"]
    assert many["error_rel"] < 0.03  # four suns for a disc
    # what the other process worked counts
    assert min(few["cpu_s"], many["cpu_s"]) > 0.2
