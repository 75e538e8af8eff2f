"""Local frames know where they lie on the Earth, and maps lie there in other programs."""

import numpy as np
import pandas as pd
import pyproj
import pytest
import rasterio
import xarray as xr

from dapple.formats import georeference, json, netcdf, rasters
from dapple.formats.georeference import WorldFrame
from dapple.light import light_datasets, placed_light
from dapple.stats import ground_sums

ORIGIN = (410505.3, 5317088.3, 288.7)
UTM = WorldFrame(ORIGIN, "EPSG:25832")


def maps(par=1000.0, hours=11, step_m=0.5):
    """Even light from 8 to 18 o'clock on two by three cells."""
    times = pd.date_range("2023-08-10 08:00", periods=hours, freq="h", tz="Europe/Berlin")
    values = np.full((hours, 2, 3), par) * np.arange(1, 7).reshape(2, 3)
    about = {"units": "µmol m-2 s-1", "long_name": "PAR on the ground"}
    return xr.Dataset(
        {ground_sums.PAR: (("time", "y", "x"), values, about)},
        {
            "time": netcdf.time_coordinate(times),
            "y": step_m * np.arange(2) - 1.0,
            "x": step_m * np.arange(3) + 4.0,
        },
    )


@pytest.mark.parametrize("crs", ["EPSG:25832", "EPSG:2056", "EPSG:31467", "EPSG:27700"])
def test_local_coordinates_are_map_coordinates_of_the_shifted_system(crs):
    origin = np.array([2600000.0 if crs == "EPSG:2056" else 410505.3, 530000.0, 0.0])
    system = georeference.local_system(WorldFrame(tuple(origin), crs))
    local, world = (
        pyproj.Transformer.from_crs(one, pyproj.CRS(crs).geodetic_crs, always_xy=True)
        for one in (system, crs)
    )
    assert local.transform(3.0, -2.0) == pytest.approx(
        world.transform(origin[0] + 3.0, origin[1] - 2.0), abs=1e-9
    )


def test_a_virtual_tree_stands_at_its_site():
    frame = georeference.read(None, None, site={"latitude_deg": 48.0, "longitude_deg": 7.8})
    system = georeference.local_system(frame)
    turned = pyproj.Transformer.from_crs(system, "EPSG:4326", always_xy=True)
    assert turned.transform(0.0, 0.0) == pytest.approx((7.8, 48.0))
    # A degree of latitude is 111.2 km there.
    assert turned.transform(0.0, 111.2)[1] - 48.0 == pytest.approx(1e-3, rel=1e-3)


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:2277", ""])
def test_degrees_feet_and_nothing_are_no_system_of_metres(crs):
    assert georeference.world_frame([{"crs": crs}]).crs == ""


def test_the_fit_knows_the_origin_better_than_the_cloud_and_the_cloud_its_system(tmp_path):
    json.write(tmp_path / "frame.json", {"origin_m": [1.0, 2.0, 3.0], "crs": "EPSG:25832"})
    json.write(tmp_path / "fit.json", {"origin_m": [1.5, 2.0, 3.0]})
    found = georeference.read(tmp_path / "frame.json", tmp_path / "fit.json", crs="EPSG:25833")
    assert found == WorldFrame((1.5, 2.0, 3.0), "EPSG:25832")


def test_a_thousand_micromoles_for_ten_hours_are_36_moles():
    total = ground_sums.with_sum(maps(), "Europe/Berlin")[ground_sums.SUM]
    assert total.to_numpy().ravel() == pytest.approx(36.0 * np.arange(1, 7))


def test_maps_lie_in_the_world_north_up(tmp_path):
    found = ground_sums.with_sum(maps(), "Europe/Berlin")
    made = ground_sums.raster(found[ground_sums.SUM], UTM)
    rasters.write(tmp_path / "sum.tif", made, cloud_optimized=True)
    with rasterio.open(tmp_path / "sum.tif") as file:
        assert file.crs.to_epsg() == 25832
        assert file.tags(ns="IMAGE_STRUCTURE")["LAYOUT"] == "COG"
        at = [(ORIGIN[0] + 4.5, ORIGIN[1] - 0.5)]  # the middle of the northern row
        assert [*file.sample(at)] == [pytest.approx([36.0 * 5])]


def test_hours_are_bands_that_tell_their_time():
    made = ground_sums.raster(maps()[ground_sums.PAR], UTM)
    assert made.bands[0] == "par_umol_m2_s 2023-08-10T06:00Z"
    assert made.values.shape == (11, 2, 3)


def test_sensors_are_time_series_with_places():
    sensors = pd.DataFrame({"sensor": ["b", "a"], "x_m": [1.0, 0.0], "y_m": 0.0, "z_m": 0.1})
    times = pd.date_range("2023-08-10 08:00", periods=2, freq="h", tz="UTC")
    parts = ("par", "direct", "sky", "scattered", "standard_error")
    light = light_datasets.dataset(["a", "b"], times, **dict.fromkeys(parts, np.zeros((2, 2))))
    placed = placed_light.at_sensors(light, sensors, UTM)
    assert placed["x"].to_numpy().tolist() == [0.0, 1.0]
    assert placed["latitude"].to_numpy() == pytest.approx(48.0009, abs=2e-3)
    assert placed["longitude"].to_numpy() == pytest.approx(7.8003, abs=2e-3)
    assert placed["par_umol_m2_s"].attrs["grid_mapping"] == "crs" == placed["crs"].name


def test_without_a_system_nothing_is_claimed():
    found = georeference.located(maps(), WorldFrame(ORIGIN))
    assert "crs" not in found
    assert found.attrs["origin_m"] == list(ORIGIN)
