"""Rasters keep values, place and names, and refuse what would be silently wrong."""

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from dapple.errors import InputError
from dapple.formats import rasters
from dapple.formats.rasters import Raster

BANDS = ("450", "560")


@pytest.fixture
def image():
    values = np.random.default_rng(1).uniform(0, 0.6, (2, 30, 40)).astype(np.float32)
    values[0, 3, 4] = np.nan
    return Raster(values, 612_000.0, 5_324_015.0, 0.5, "EPSG:25832", BANDS)


def tiff(path, values, *, crs="EPSG:25832", transform=None, bands=BANDS, **profile):
    """A GeoTIFF as other programs write it."""
    transform = transform or Affine(0.5, 0, 612_000, 0, -0.5, 5_324_015)
    with rasterio.open(
        path, "w", driver="GTiff", count=len(values), height=values.shape[1],
        width=values.shape[2], dtype=values.dtype, crs=crs, transform=transform, **profile,
    ) as file:  # fmt: skip
        file.write(values)
        file.descriptions = bands
    return path


def test_a_file_gives_back_what_was_written(image, tmp_path):
    rasters.write(tmp_path / "image.tif", image)
    again = rasters.read(tmp_path / "image.tif")
    np.testing.assert_array_equal(again.values, image.values)
    assert (again.left_m, again.top_m, again.pixel_m) == (612_000.0, 5_324_015.0, 0.5)
    assert again.crs == "EPSG:25832"
    assert again.bands == BANDS


def test_the_first_row_lies_in_the_north(image):
    row, column = image.pixel_of([[612_000.1, 5_324_014.9], [612_019.9, 5_324_000.1]])
    assert row.tolist() == [0, 29]
    assert column.tolist() == [0, 39]
    y, x = image.centres_m()
    assert image.pixel_of(np.column_stack([x[:30], y]))[0].tolist() == list(range(30))


def test_nodata_becomes_nan(tmp_path):
    values = np.full((2, 4, 4), 0.3, np.float32)
    values[1, 2, 2] = -9999
    read = rasters.read(tiff(tmp_path / "a.tif", values, nodata=-9999))
    assert np.isnan(read.values[1, 2, 2])
    assert np.isfinite(read.values).sum() == 31


def test_a_scale_in_the_file_is_applied(tmp_path):
    path = tiff(tmp_path / "a.tif", np.full((2, 4, 4), 3000, np.uint16))
    with rasterio.open(path, "r+") as file:
        file.scales = (1e-4, 1e-4)
    np.testing.assert_allclose(rasters.read(path).values, 0.3, rtol=1e-6)


def test_a_file_without_a_coordinate_system_is_refused(tmp_path):
    path = tiff(tmp_path / "a.tif", np.zeros((2, 4, 4), np.float32), crs=None)
    with pytest.raises(InputError, match="no coordinate system"):
        rasters.read(path)


def test_degrees_are_refused(tmp_path):
    path = tiff(
        tmp_path / "a.tif", np.zeros((2, 4, 4), np.float32), crs="EPSG:4326",
        transform=Affine(1e-5, 0, 10, 0, -1e-5, 48),
    )  # fmt: skip
    with pytest.raises(InputError, match="projected"):
        rasters.read(path)


@pytest.mark.parametrize(
    "transform", [Affine(0.5, 0, 0, 0, -0.4, 9), Affine(0.5, 0, 0, 0, 0.5, 9),
                  Affine(0.5, 0.1, 0, 0.1, -0.5, 9)],
)  # fmt: skip
def test_pixels_that_are_not_square_or_do_not_run_south_are_refused(tmp_path, transform):
    path = tiff(tmp_path / "a.tif", np.zeros((2, 4, 4), np.float32), transform=transform)
    with pytest.raises(InputError, match="square pixels"):
        rasters.read(path)


def test_a_damaged_or_missing_file_is_an_input_error(tmp_path):
    (tmp_path / "a.tif").write_text("no image")
    with pytest.raises(InputError, match="no readable raster"):
        rasters.read(tmp_path / "a.tif")
    with pytest.raises(InputError, match="no file"):
        rasters.read(tmp_path / "b.tif")


def test_bands_are_chosen_by_name_and_a_missing_one_is_named(image):
    turned = rasters.select(image, ("560", "450"), "image.tif")
    np.testing.assert_array_equal(turned.values, image.values[::-1])
    with pytest.raises(InputError, match=r"bands 450, 560, none called 840"):
        rasters.select(image, ("450", "840"), "image.tif")


def test_the_share_of_overlap_is_that_of_the_area(image):
    share = rasters.require_overlap(
        image, (612_010.0, 5_324_000.0), (612_100.0, 5_324_100.0), "EPSG:25832",
        where="image", other="cloud",
    )  # fmt: skip
    assert share == pytest.approx(0.5)


def test_heights_in_the_coordinate_system_do_not_matter(image):
    assert rasters.same_crs("EPSG:25832", "EPSG:25832+7837")
    assert not rasters.same_crs("EPSG:25832", "EPSG:25833")


@pytest.mark.parametrize(
    ("low", "crs", "message"),
    [
        ((612_000.0, 5_324_000.0), "EPSG:25833", "EPSG:25832; expected EPSG:25833"),
        ((712_000.0, 5_324_000.0), "EPSG:25832", "0 % of it under cloud"),
        ((612_000.0, 5_324_000.0), None, "cloud: found no coordinate system"),
    ],
)
def test_data_of_another_place_or_system_are_refused(image, low, crs, message):
    with pytest.raises(InputError, match=message):
        rasters.require_overlap(image, low, np.add(low, 20.0), crs, where="image", other="cloud")
