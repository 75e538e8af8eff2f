"""Light at a sensor does not depend on the sensors beside it, and is not traced twice."""

import numpy as np
import pandas as pd
import pytest
from benchmarks import crown

from dapple import steps
from dapple.light import by_sensor, sun_files, transport_files
from dapple.light.light_model import Model, Tracing
from dapple.scene import traced
from dapple.scene.facing import facing_of
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

MODEL = Model(sky_patches=145, max_orders=20, bands=4)
TRACING = Tracing(
    paths=512, sky_rays=2320, max_shadow_rays=2048, tolerance=0.01, max_growth=16.0,
    sun_diameter_deg=SUN_DIAMETER_DEG, sun_kernel_deg=8.0, aperture_m=0.02,
)  # fmt: skip
NAMES = [f"s{number}" for number in range(6)]


@pytest.fixture(scope="module", params=["polygons", "voxels_0.5"])
def scene(request):
    return traced.load(crown.scene(request.param, 4000), "llvm_ad_mono")


def table(names=NAMES, tilted=()):
    places = pd.DataFrame(crown.sensors(25)[5:11], NAMES, by_sensor.POSITION)
    places["tilt_deg"], places["azimuth_deg"] = np.isin(NAMES, tilted) * 30.0, 180.0
    return places.loc[names].rename_axis("sensor").reset_index()


class Run:
    """Traces as the steps of the workflow do, and writes down for which sensors."""

    def __init__(self, scene):
        self.scene, self.traced = scene, []

    def trace(self, step, **settings):
        def some(sensors):
            self.traced += list(sensors["sensor"])
            where, keys = sensors[by_sensor.POSITION].to_numpy(), by_sensor.keys(sensors)
            return step(where, facing=facing_of(sensors), keys=keys, **settings)

        return some

    def __call__(self, sensors, paths=None, sun=None, seed=1, code=()):
        sky, optics = crown.sky(5, 4), crown.optics(4)
        wanted = by_sensor.identities(sensors, code, MODEL, TRACING, seed)
        counted = by_sensor.completed(
            wanted, paths, sensors,
            self.trace(lambda where, **of: steps.paths(
                self.scene, where, MODEL, TRACING, optics=optics, seed=seed, **of)),
        )  # fmt: skip
        suns = by_sensor.completed(
            wanted, sun, sensors,
            self.trace(lambda where, **of: sun_files.Suns.from_placements(
                [steps.sun(self.scene, where, sky, MODEL, TRACING, seed=seed, **of)])),
        )  # fmt: skip
        seen = suns.placements[0]
        light = steps.products(seen, counted, sky, optics, MODEL, TRACING, facing_of(sensors))
        return (wanted, counted), (wanted, suns), light


def rows(light, kept):
    return [getattr(light, name)[kept] for name in ("direct", "sky", "scattered", "standard_error")]


@pytest.mark.parametrize("tilted", [(), ("s3",)])
def test_a_sensor_added_changes_no_number_of_the_others(scene, tilted):
    few = [name for name in NAMES if name != "s3"]
    light = Run(scene)(table(tilted=tilted))[2]
    without = Run(scene)(table(few, tilted))[2]
    kept = [NAMES.index(name) for name in few]
    for value, other in zip(rows(light, kept), rows(without, slice(None)), strict=True):
        np.testing.assert_array_equal(value, other)


def test_a_sensor_added_is_the_only_one_that_is_traced(scene, tmp_path):
    few = [name for name in NAMES if name != "s3"]
    (identities, counted), (_, suns), _ = Run(scene)(table(few))
    transport_files.write(tmp_path / "paths.nc", counted, identities)
    sun_files.write(tmp_path / "sun.nc", suns, identities)
    later = Run(scene)
    paths = by_sensor.former(tmp_path / "paths.nc", transport_files.read)
    sun = by_sensor.former(tmp_path / "sun.nc", sun_files.read)
    (_, counted), (_, suns), light = later(table(), paths, sun)
    assert later.traced == ["s3", "s3"]
    (_, fresh), (_, seen), anew = Run(scene)(table())
    for name, value in [*vars(fresh).items(), *vars(seen).items()]:
        np.testing.assert_array_equal(getattr(counted, name, getattr(suns, name, None)), value)
    for value, other in zip(rows(light, slice(None)), rows(anew, slice(None)), strict=True):
        np.testing.assert_array_equal(value, other)


def test_whatever_light_depends_on_has_all_sensors_traced_anew(tmp_path):
    code = tmp_path / "leaves.ply"
    code.write_text("as it was")
    before = by_sensor.identities(table(), [code], MODEL, TRACING, 1)
    again = by_sensor.identities(table(), [code], MODEL, TRACING, 1)
    np.testing.assert_array_equal(before, again)
    moved, named = table(), table()
    moved["x_m"] += 1e-6
    named["sensor"] += "b"
    for sensors in (moved, named, table(tilted=NAMES)):
        assert not np.isin(by_sensor.identities(sensors, [code], MODEL, TRACING, 1), before).any()
    assert not np.isin(by_sensor.identities(table(), [code], MODEL, TRACING, 2), before).any()
    code.write_text("edited")
    assert not np.isin(by_sensor.identities(table(), [code], MODEL, TRACING, 1), before).any()


def test_a_former_file_that_cannot_be_read_is_no_matter(tmp_path):
    path = tmp_path / "paths.nc"
    assert by_sensor.former(path, transport_files.read) is None
    path.write_bytes(b"cut off")
    assert by_sensor.former(path, transport_files.read) is None
