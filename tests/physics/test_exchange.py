"""Scenes that are exchanged with other light models: what is written is read, and lit alike."""

import json
import shutil

import numpy as np
import pandas as pd
import pytest
from tests.physics.test_less import BEAM, DIFFUSE, PEREZ, sensors, sky
from tests.physics.test_timestep import disc, leaves, level, voxels

from dapple.errors import InputError
from dapple.light import exchange_light
from dapple.light.timestep import Rays
from dapple.light.timestep_series import Reference
from dapple.scene import exchange, exchange_reading
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds

WAVELENGTH_NM = np.array([450.0, 550.0, 650.0])
OPTICS = Optics.of_tree(
    WAVELENGTH_NM,
    np.array([0.05, 0.12, 0.06]),
    np.array([0.02, 0.10, 0.03]),
    np.array([0.1, 0.15, 0.2]),
    np.array([0.04, 0.09, 0.05]),
)
ABOVE = sky((70.0, 100.0), (35.0, 160.0), coefficients=PEREZ)
RAYS = {"replicates": 4, "direct": 64, "sky": 1024, "scattered": 1024, "max_depth": 12}


def tree():
    """Leaves above a stem's disc, half a metre above the origin's height."""
    foliage = leaves(200, 0.1, (-0.5, -0.5, 1.0), (0.5, 0.5, 1.6), seed=3)
    return Scene(of_kinds(leaf=foliage, wood=disc(0.3, 0.9)), ground_z_m=0.1)


def table():
    found = sensors((0.0, 0.0, 0.4), (0.7, -0.4, 0.2), (5.0, 5.0, 0.2))
    return found.assign(tilt_deg=[0.0, 0.0, 30.0], azimuth_deg=[0.0, 0.0, 200.0])


@pytest.fixture(scope="module")
def lit():
    return exchange.at_highest_sun(tree(), OPTICS, ABOVE, table(), 0.02)


@pytest.fixture(scope="module")
def written(tmp_path_factory, lit):
    folder = tmp_path_factory.mktemp("exchanged")
    exchange.write(folder, lit, "a crown")
    return folder


@pytest.fixture
def folder(tmp_path, written):
    return shutil.copytree(written, tmp_path / "scene")


def areas(scene):
    return {one.optics: one.mesh.area_m2 for one in scene.filled}


def test_surfaces_spectra_and_sensors_come_back(written, lit):
    read = exchange_reading.read(written / "scene.json")
    assert areas(read.scene) == pytest.approx(areas(lit.scene), rel=1e-5)
    assert read.scene.ground_z_m == pytest.approx(0.1)
    for of in ("reflectance", "transmittance"):
        for name, values in getattr(OPTICS, of).items():
            assert getattr(read.optics, of)[name] == pytest.approx(values, rel=1e-5)
    assert list(read.sensors["sensor"]) == ["1_0", "1_1", "1_2"]
    for column in ("x_m", "y_m", "z_m", "tilt_deg", "azimuth_deg"):
        assert read.sensors[column].to_numpy() == pytest.approx(table()[column], abs=1e-3)
    assert read.aperture_m == pytest.approx(0.02, rel=1e-3)


def test_leaves_stand_where_they_were_and_light_comes_from_where_it_came(written, lit):
    read = exchange_reading.read(written / "scene.json")
    assert read.scene.bounds_m == pytest.approx(lit.scene.bounds_m, abs=1e-5)
    zenith, azimuth, beam = read.sky.beam()
    assert (zenith, azimuth) == pytest.approx((35.0, 160.0), abs=1e-3)
    assert beam == pytest.approx(BEAM, rel=2e-3)


def test_an_exchanged_sky_is_as_bright_on_the_level_as_sun_and_sky(written):
    open_sky = exchange_reading.read(written / "scene.json").sky.horizontal()
    assert open_sky == pytest.approx(BEAM * np.cos(np.radians(35.0)) + DIFFUSE, rel=2e-3)


def test_light_of_an_exchanged_scene_is_that_of_the_scene(written):
    read = exchange_reading.read(written / "scene.json")
    found = exchange_light.light(
        read, Rays(**RAYS), sun_diameter_deg=0.533, variant="llvm_ad_rgb", seed=1
    )
    named = {f"{kind}_rays": RAYS[kind] for kind in ("direct", "sky", "scattered")}
    engine = Reference(
        [tree()],
        ABOVE,
        OPTICS,
        bands=3,
        sun_diameter_deg=0.533,
        aperture_m=0.02,
        variant="llvm_ad_rgb",
        seed=2,
        replicates=RAYS["replicates"],
        max_depth=RAYS["max_depth"],
        **named,
    )
    own = engine.at(1, table())
    whole = found.groupby("sensor", sort=False)
    par = whole["irradiance"].sum().to_numpy()
    error = np.hypot(
        np.sqrt(whole["standard_error"].agg(lambda one: (one**2).sum())).to_numpy(),
        own["standard_error_umol_m2_s"].to_numpy()[:, 0],
    )
    expected = own["par_umol_m2_s"].to_numpy()[:, 0]
    assert (np.abs(par - expected) < 4.0 * error + 5e-3 * expected).all()
    assert par[0] < 0.7 * par[2]


def test_vectors_to_the_light_and_tables_with_blanks_are_read_alike(folder):
    before = exchange_reading.read(folder / "scene.json")
    for name in ("blue", "green", "red"):
        rows = pd.read_csv(folder / f"sky_{name}.csv")
        rows[["x", "y", "z"]] *= -1.0
        rows.to_csv(folder / f"sky_{name}.csv", sep=" ", header=False, index=False)
    after = exchange_reading.read(folder / "scene.json")
    assert after.sky.direction == pytest.approx(before.sky.direction)


def test_without_background_the_ground_is_black(folder):
    facts = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps(facts | {"Background": []}))
    read = exchange_reading.read(folder / "scene.json")
    assert not read.optics.reflectance_of(read.scene.ground_optics).any()


def test_a_box_of_background_stands_on_the_ground(written, lit):
    roof = level((2.0, 3.0), (2.0, 3.0), 1.0)
    scene = Scene(of_kinds(wood=lit.scene.surfaces[1].mesh, ground=roof), ground_z_m=0.1)
    folder = written.parent / "with_roof"
    exchange.write(folder, exchange.at_highest_sun(scene, OPTICS, ABOVE, table(), 0.02), "roof")
    read = exchange_reading.read(folder / "scene.json")
    assert areas(read.scene)["ground"] == pytest.approx(1.0, rel=1e-5)
    assert read.scene.ground_z_m == pytest.approx(0.1)


def test_voxels_cannot_be_exchanged():
    turbid = Scene(voxels=voxels(np.ones((1, 1, 1))))
    with pytest.raises(InputError, match="surfaces"):
        exchange.at_highest_sun(turbid, OPTICS, ABOVE, table(), 0.0)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda facts: facts | {"Sensor": []}, "no `Sensor`"),
        (lambda facts: facts | {"Sensor": ["none.gltf"]}, "no glTF"),
        (lambda facts: facts | {"Illumination": {"sky": {}}}, "sky of `blue`"),
        (
            lambda facts: (
                facts | {"Spectral_Properties": facts["Spectral_Properties"] | {"mapping": []}}
            ),
            "without a material",
        ),
        (
            lambda facts: (
                facts
                | {
                    "Spectral_Properties": facts["Spectral_Properties"]
                    | {"materials": {"blue": {"leaf": "Phong 0.2 0.3"}}}
                }
            ),
            "Lambertian",
        ),
        (
            lambda facts: (
                facts
                | {
                    "Spectral_Properties": facts["Spectral_Properties"]
                    | {"materials": {"blue": {"leaf": "Lambertian 0.2 0.3"}}}
                }
            ),
            "1 bands",
        ),
    ],
)
def test_what_is_missing_is_named(folder, change, told):
    facts = json.loads((folder / "scene.json").read_text())
    (folder / "scene.json").write_text(json.dumps(change(facts)))
    with pytest.raises(InputError, match=told):
        exchange_reading.read(folder / "scene.json")


def test_a_path_without_a_scene_is_named(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        exchange_reading.read(tmp_path / "scene.json")
