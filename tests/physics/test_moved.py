"""Light beside the sensors: the beam is the one at the other place, the rest stays."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.formats.meshes import Mesh
from dapple.light import light_datasets
from dapple.light.moved_sensors import moved_light
from dapple.scene import traced
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

BEAM, SKY = 1500.0, 200.0
SENSOR = np.array([[0.0, 0.0, 0.5]])


def plate(half_m):
    """An opaque level square over the sensor."""
    corners = half_m * np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)], float)
    vertices = np.column_stack([corners, np.full(4, 1.0)])
    faces = np.array([[0, 1, 2], [0, 2, 3]], np.int32)
    return Scene(of_kinds(leaf=Mesh(vertices, faces, np.zeros(2, np.int32))))


def shaded():
    """Light of a sensor that the sun does not reach, and a sky with the sun overhead."""
    when = pd.DatetimeIndex(["2023-06-21 12:00"], tz="UTC")
    parts = {"direct": 0.0, "sky": SKY, "scattered": 0.0, "par": SKY, "standard_error": 0.0}
    light = light_datasets.dataset(
        ["1_1"], when, **{k: np.full((1, 1), v) for k, v in parts.items()}
    )
    sky = xr.Dataset(
        {
            "sun_zenith_deg": ("time", [0.0]),
            "sun_azimuth_deg": ("time", [180.0]),
            "beam_normal_umol_m2_s": (("time", "band"), [[BEAM]]),
        }
    )
    return light, sky


@pytest.mark.parametrize(("shift_m", "beam"), [(0.0, 0.0), (0.3, 0.0), (2.0, BEAM)])
def test_a_sensor_that_stands_beside_its_shade_gets_the_whole_beam(shift_m, beam):
    light, sky = shaded()
    scene = traced.load(plate(0.5))
    moved = moved_light(
        [scene, scene],
        SENSOR,
        light,
        sky,
        shift_m=shift_m,
        seed=3,
        sun_diameter_deg=SUN_DIAMETER_DEG,
    )
    assert moved["par_direct_umol_m2_s"].item() == pytest.approx(beam, abs=1e-6 * BEAM)
    assert moved["par_umol_m2_s"].item() == pytest.approx(SKY + beam)
