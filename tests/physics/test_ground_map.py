"""Light on the ground below a black roof: its shadow where it falls, open sky elsewhere."""

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from dapple.formats import ground_surface
from dapple.formats.meshes import Mesh
from dapple.formats.netcdf import time_coordinate
from dapple.light import par_on_ground
from dapple.scene.scene_optics import Optics
from dapple.scene.surfaces import Scene, of_kinds

BEAM, SKY, HEIGHT_M = 1500.0, 200.0, 4.0

BLACK = Optics.of_tree(
    wavelength_nm=np.array([550.0]),
    leaf_reflectance=np.zeros(1),
    leaf_transmittance=np.zeros(1),
    wood_reflectance=np.zeros(1),
    ground_reflectance=np.zeros(1),
)


def roof():
    """Two metres square, four metres above the ground."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]) + np.array(
        [0, 0, HEIGHT_M]
    )
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros(2, np.int32))


def sky(zenith_deg, azimuth_deg):
    n = len(zenith_deg)
    times = pd.date_range("2024-06-01 10:00", periods=n, freq="h", tz="UTC")
    return xr.Dataset(
        {
            "sun_zenith_deg": ("time", np.array(zenith_deg, float)),
            "sun_azimuth_deg": ("time", np.array(azimuth_deg, float)),
            "beam_normal_umol_m2_s": (("time", "band"), np.full((n, 1), BEAM)),
            "diffuse_horizontal_umol_m2_s": (("time", "band"), np.full((n, 1), SKY)),
        },
        {"time": time_coordinate(times)},
        {"sky_model": "isotropic"},
    )


def mapped(suns):
    return par_on_ground.par_on_ground(
        Scene(of_kinds(wood=roof())),
        ground_surface.flat(0.0),
        suns,
        BLACK,
        spacing_m=0.25,
        margin_m=1.0,
        sun_diameter_deg=0.5,
        sun_kernel_deg=8.0,
        variant="llvm_ad_mono",
        seed=1,
    )


def test_the_shadow_lies_within_the_map_where_geometry_puts_it_and_the_rest_is_open():
    found = mapped(sky([0.0, 45.0, 70.0], [0.0, 180.0, 90.0]))
    par = found["par_umol_m2_s"]
    tangent = np.tan(np.radians([0.0, 45.0, 70.0]))
    middles = [(0.0, 0.0), (0.0, HEIGHT_M * tangent[1]), (-HEIGHT_M * tangent[2], 0.0)]
    for k, (x, y) in enumerate(middles):
        level = BEAM * np.cos(np.radians(float(found["sun_zenith_deg"][k])))
        shade = par[k].where(par[k] < 0.5 * level)
        # Of the beam nothing, of the sky all but what the roof hides.
        assert float(par[k].sel(x=x, y=y, method="nearest")) < SKY
        assert float((shade.notnull() * found["x"]).sum() / shade.notnull().sum()) == pytest.approx(
            x, abs=0.15
        )
        assert float((shade.notnull() * found["y"]).sum() / shade.notnull().sum()) == pytest.approx(
            y, abs=0.15
        )
        assert int(shade.notnull().sum()) * 0.25**2 == pytest.approx(4.0, rel=0.2)
        assert float(par[k].max()) == pytest.approx(level + SKY, rel=0.03)


def test_a_low_sun_and_a_large_plot_make_the_map_no_larger_than_it_may_be():
    bounds = np.array([[-20.0, -20, 0], [20, 20, 20]])
    x, y = par_on_ground.grid(bounds, 0.0, sky([70.0, 88.0], [90.0, 270.0]), 0.1, 2.0)
    assert len(x) * len(y) < 1.1 * par_on_ground.MOST_CELLS
    assert x[0] < -20 - 20 * np.tan(np.radians(70))
    assert x[-1] < 25  # the shadow of the setting sun is left out
