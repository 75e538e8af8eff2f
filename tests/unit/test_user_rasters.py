"""Images as people bring them become reflectance by band on a grid in metres, or are refused."""

from dataclasses import dataclass

import numpy as np
import pytest
import rasterio
from rasterio.enums import ColorInterp
from rasterio.transform import Affine
from rasterio.warp import calculate_default_transform, reproject

from dapple.errors import InputError
from dapple.formats import raster_bands, user_rasters
from dapple.formats.raster_bands import match

GRID = Affine(0.1, 0, 612_000, 0, -0.1, 5_324_010)
NAMES = ("450", "560", "650", "730", "840")


@dataclass
class Band:
    name: str
    centre_nm: float
    width_nm: float = 32.0


CAMERA = [Band(name, float(name)) for name in NAMES]


def leaves():
    """Reflectance (5, 100, 100) of vegetation."""
    rng = np.random.default_rng(1)
    level = np.array([0.03, 0.08, 0.04, 0.25, 0.45])[:, None, None]
    return level * rng.uniform(0.8, 1.2, (5, 100, 100))


def tiff(path, values, *, crs="EPSG:25832", grid=GRID, names=NAMES, alpha=False, **profile):
    with rasterio.open(
        path, "w", driver="GTiff", count=len(values), height=values.shape[1],
        width=values.shape[2], dtype=values.dtype, crs=crs, transform=grid, **profile,
    ) as file:  # fmt: skip
        file.write(values)
        if names:
            file.descriptions = [*names, *[""] * (len(values) - len(names))]
        if alpha:
            file.colorinterp = [*[ColorInterp.gray] * (len(values) - 1), ColorInterp.alpha]
    return path


def medians(read):
    return np.nanmedian(read.raster.values, axis=(1, 2))


USUAL = np.array([0.03, 0.08, 0.04, 0.25, 0.45])


# --- bands --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "how"),
    [
        (NAMES, "by name"),
        ([f"{name} nm" for name in NAMES], "by wavelength"),
        (["Blue-450", "Green-560", "Red-650", "Red edge-730", "NIR-840"], "by wavelength"),
        (["0.45 um", "0.56 um", "0.65 um", "0.73 um", "0.84 um"], "by wavelength"),
        (["Blue", "Green", "Red", "RedEdge", "NIR"], "by colour"),
        (["blue", "green", "red", "red edge", "near infrared"], "by colour"),
        (["", "", "", "", ""], "by order, for they have no names"),
        (["Band 1", "Band 2", "Band 3", "Band 4", "Band 5"], "by order, for they have no names"),
    ],
)
def test_bands_are_matched_by_name_wavelength_colour_or_order(names, how):
    order, found = match(CAMERA, names, [{}] * 5, where="a.tif")
    assert (order, found) == ([0, 1, 2, 3, 4], how)
    turned = match(CAMERA, names[::-1], [{}] * 5, where="a.tif")[0]
    assert turned == ([0, 1, 2, 3, 4] if "order" in how else [4, 3, 2, 1, 0])


def test_wavelengths_may_be_in_the_metadata_and_an_order_may_be_declared():
    tags = [{"Wavelength": str(nm / 1000)} for nm in (840, 730, 650, 560, 450)]
    assert match(CAMERA, [""] * 5, tags, where="a.tif")[0] == [4, 3, 2, 1, 0]
    assert match(CAMERA, [""] * 5, [{}] * 5, order=[2, 1, 3, 4, 5], where="a.tif")[0][0] == 1
    with pytest.raises(InputError, match="5 numbers from 1 to 5"):
        match(CAMERA, [""] * 5, [{}] * 5, order=[1, 2], where="a.tif")


def test_the_bands_of_another_camera_are_refused_with_what_is_there():
    names = ["Blue-475", "Green-560", "Red-668", "Red edge-717", "NIR-842"]
    with pytest.raises(InputError, match=r"none at 450 nm.*`chlorophyll.camera`"):
        match(CAMERA, names, [{}] * 5, where="a.tif")
    with pytest.raises(InputError, match="bands a, b, c"):
        match(CAMERA, ["a", "b", "c"], [{}] * 3, where="a.tif")


# --- data -----------------------------------------------------------------------------------------


def test_alpha_mask_and_flags_leave_no_data(tmp_path):
    values = leaves()
    alpha = np.full((1, 100, 100), 255.0)
    alpha[0, :10] = 0
    values[:, 10:20] = -10000.0
    values[:, 20:30] = 0.0
    path = tiff(tmp_path / "a.tif", np.concatenate([values, alpha]), alpha=True)
    read = user_rasters.read(path, CAMERA)
    assert np.isnan(read.raster.values[:, :30]).all()
    assert np.isfinite(read.raster.values[:, 30:]).all()
    assert list(read.facts["without_data"].values()) == pytest.approx([0.1, 0.1, 0.1])
    assert "black in all bands" in " ".join(map(str, read.findings))


def test_a_sixth_band_of_two_values_is_a_mask_though_nothing_says_so(tmp_path):
    mask = np.full((1, 100, 100), 255.0)
    mask[0, :, :50] = 0
    read = user_rasters.read(
        tiff(tmp_path / "a.tif", np.concatenate([leaves(), mask]), names=()), CAMERA
    )
    assert np.isnan(read.raster.values[:, :, :50]).all()
    assert medians(read) == pytest.approx(USUAL, rel=0.02)


@pytest.mark.parametrize("own", [True, False])
def test_the_files_nodata_and_a_declared_one_are_no_data(tmp_path, own):
    values = (1e4 * leaves()).astype(np.uint16)
    values[:, :5] = 65_535
    options = {"nodata": 65_535} if own else {}
    path = tiff(tmp_path / "a.tif", values, **options)
    read = user_rasters.read(path, CAMERA, scale=1e4, nodata=None if own else 65_535)
    assert np.isnan(read.raster.values[:, :5]).all()
    assert medians(read) == pytest.approx(USUAL, rel=0.02)


# --- scale ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("scale", "kind"),
    [(32_768, np.uint16), (65_535, np.uint16), (10_000, np.int16), (255, np.uint8)],
)
def test_whole_numbers_need_a_scale_and_none_is_guessed(tmp_path, scale, kind):
    path = tiff(tmp_path / "a.tif", (scale * leaves()).round().astype(kind))
    with pytest.raises(InputError, match=rf"Set `scale`.*{scale}"):
        user_rasters.read(path, CAMERA)
    assert medians(user_rasters.read(path, CAMERA, scale=scale)) == pytest.approx(USUAL, rel=0.05)


def test_a_scale_in_the_file_is_applied(tmp_path):
    path = tiff(tmp_path / "a.tif", (1e4 * leaves()).astype(np.uint16))
    with rasterio.open(path, "r+") as file:
        file.scales = (1e-4,) * 5
    read = user_rasters.read(path, CAMERA)
    assert medians(read) == pytest.approx(USUAL, rel=0.02)
    assert read.facts["scale"] == "the file's own"


@pytest.mark.parametrize(
    ("factor", "options", "message"),
    [
        (100.0, {}, "Set `scale`"),
        (1.0, {"scale": 100.0}, "divided by too much"),
        (-0.5, {}, "reflectance of -0"),
    ],
)
def test_values_that_are_no_reflectance_are_refused_high_and_low(
    tmp_path, factor, options, message
):
    path = tiff(tmp_path / "a.tif", factor * leaves())
    with pytest.raises(InputError, match=message):
        user_rasters.read(path, CAMERA, **options)


def test_a_band_without_data_is_refused(tmp_path):
    values = leaves()
    values[1] = np.nan
    with pytest.raises(InputError, match="no data in band 450"):
        user_rasters.read(tiff(tmp_path / "a.tif", values), CAMERA)


# --- place ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:3857", "EPSG:25833"])
def test_images_in_another_system_are_warped(tmp_path, crs):
    straight = user_rasters.read(tiff(tmp_path / "a.tif", leaves()), CAMERA)
    with rasterio.open(tmp_path / "a.tif") as file:
        grid, width, height = calculate_default_transform(
            file.crs, crs, file.width, file.height, *file.bounds
        )
        turned = np.full((5, height, width), -10_000.0)
        reproject(
            leaves(), turned, src_transform=file.transform, src_crs=file.crs,
            dst_transform=grid, dst_crs=crs, dst_nodata=-10_000.0,
        )  # fmt: skip
    path = tiff(tmp_path / "b.tif", turned, crs=crs, grid=grid)
    read = user_rasters.read(path, CAMERA, crs="EPSG:25832")
    assert medians(read) == pytest.approx(medians(straight), rel=0.02)
    # A grid that was turned by four degrees has corners without data.
    assert read.raster.left_m == pytest.approx(612_000, abs=1.0)
    assert read.raster.top_m == pytest.approx(5_324_010, abs=1.0)
    assert "warped to EPSG:25832" in " ".join(map(str, read.findings))
    alone = user_rasters.read(path, CAMERA)
    assert alone.raster.crs == (crs if crs == "EPSG:25833" else "EPSG:32632")


def test_pixels_that_are_not_square_are_made_so(tmp_path):
    path = tiff(tmp_path / "a.tif", leaves(), grid=Affine(0.1, 0, 612_000, 0, -0.2, 5_324_020))
    read = user_rasters.read(path, CAMERA)
    assert read.raster.bottom_m == pytest.approx(5_324_000, abs=0.3)
    assert medians(read) == pytest.approx(USUAL, rel=0.02)


def test_only_what_is_wanted_is_read_and_no_overlap_is_refused(tmp_path):
    path = tiff(tmp_path / "a.tif", leaves())
    box = (612_002.0, 5_324_001.0, 612_005.0, 5_324_006.0)
    read = user_rasters.read(path, CAMERA, bounds_m=box).raster
    assert read.values.shape == (5, 50, 30)
    assert (read.left_m, read.top_m) == pytest.approx((612_002, 5_324_006))
    with pytest.raises(InputError, match="an overlap with the cloud"):
        user_rasters.read(path, CAMERA, bounds_m=(0.0, 0.0, 10.0, 10.0))


def test_files_without_a_system_or_that_are_no_rasters_are_refused(tmp_path):
    with pytest.raises(InputError, match="no coordinate system"):
        user_rasters.read(tiff(tmp_path / "a.tif", leaves(), crs=None), CAMERA)
    (tmp_path / "b.tif").write_text("image")
    with pytest.raises(InputError, match="no readable raster"):
        user_rasters.read(tmp_path / "b.tif", CAMERA)
    with pytest.raises(InputError, match="no file"):
        user_rasters.read(tmp_path / "c.tif", CAMERA)


# --- what looks right and is not ------------------------------------------------------------------


def test_pixels_as_bright_as_the_file_can_tell_in_all_bands_are_no_data(tmp_path):
    values = (leaves() * 32_768).astype("uint16")
    values[:, :40] = 65_535
    read = user_rasters.read(tiff(tmp_path / "a.tif", values), CAMERA, scale=32_768)
    np.testing.assert_allclose(medians(read), USUAL, rtol=0.05)
    assert any("40.0% of pixels as bright" in str(found) for found in read.findings)


def test_numbers_that_no_image_holds_are_no_data(tmp_path):
    values = leaves().astype("float32")
    values[:, :40] = 1e20
    read = user_rasters.read(tiff(tmp_path / "a.tif", values), CAMERA)
    np.testing.assert_allclose(medians(read), USUAL, rtol=0.05)


def test_a_scale_that_makes_most_leaves_brighter_than_light_is_refused(tmp_path):
    path = tiff(tmp_path / "a.tif", (leaves() * 32_768).astype("uint16"))
    with pytest.raises(InputError, match=r"1\.48 at half of the pixels.*Check `scale`"):
        user_rasters.read(path, CAMERA, scale=10_000)


def test_a_scale_that_makes_leaves_dim_is_doubted(tmp_path):
    path = tiff(tmp_path / "a.tif", (leaves() * 10_000).astype("uint16"))
    read = user_rasters.read(path, CAMERA, scale=65_535)
    assert any("Check `scale`" in str(found) for found in read.findings)
    assert not user_rasters.read(path, CAMERA, scale=10_000).findings


@pytest.mark.parametrize(
    ("crs", "grid", "pixel_m"),
    [
        ("EPSG:2263", Affine(0.3, 0, 980_000, 0, -0.3, 200_000), 0.3 * 0.3048),
        ("EPSG:3857", Affine(0.1, 0, 1_170_000, 0, -0.1, 6_100_000), 0.1 * 0.676),
    ],
    ids=["feet", "web"],
)
def test_systems_that_are_not_in_true_metres_are_brought_into_them(tmp_path, crs, grid, pixel_m):
    path = tiff(tmp_path / "a.tif", leaves().astype("float32"), crs=crs, grid=grid)
    read = user_rasters.read(path, CAMERA)
    assert read.raster.crs.startswith("EPSG:326")
    assert read.raster.pixel_m == pytest.approx(pixel_m, rel=0.02)


def test_bands_without_names_whose_red_edge_outshines_the_infrared_are_in_another_order(tmp_path):
    path = tiff(tmp_path / "a.tif", leaves()[[0, 1, 2, 4, 3]].astype("float32"), names=None)
    with pytest.raises(InputError, match=r"`band_order` of the plot; \[1, 2, 3, 5, 4\] fits"):
        user_rasters.read(path, CAMERA)
    read = user_rasters.read(path, CAMERA, band_order=(1, 2, 3, 5, 4))
    np.testing.assert_allclose(medians(read), USUAL, rtol=0.05)


# --- several files, other names -------------------------------------------------------------------


def test_bands_in_files_of_their_own_are_brought_to_the_finest_pixels(tmp_path):
    names = ("blue", "green", "red", "red_edge", "nir")
    values = (leaves() * 1e4).astype("uint16")
    paths = []
    for k, name in enumerate(names):
        step = 2 if k > 2 else 1
        grid = Affine(0.1 * step, 0, 612_000, 0, -0.1 * step, 5_324_010)
        band = values[k : k + 1, ::step, ::step]
        paths.append(tiff(tmp_path / f"ortho_{name}.tif", band, names=None, grid=grid))
    read = user_rasters.read(paths[::-1], CAMERA, scale=10_000)
    assert read.raster.values.shape == values.shape
    assert medians(read) == pytest.approx(USUAL, rel=0.05)
    assert read.facts["bands"][CAMERA[4].name] == "ortho_nir"
    assert "brought to pixels of 0.1 m" in " ".join(map(str, read.findings))
    with pytest.raises(InputError, match="one band at 840 nm"):
        user_rasters.read(paths[:4], CAMERA, scale=10_000)


def test_a_file_beyond_the_others_covers_nothing(tmp_path):
    near = tiff(tmp_path / "vis.tif", leaves()[:3], names=["Blue", "Green", "Red"])
    far = tiff(tmp_path / "ir.tif", leaves()[3:], names=["Red edge", "NIR"],
               grid=Affine(0.1, 0, 700_000, 0, -0.1, 5_324_010))  # fmt: skip
    with pytest.raises(InputError, match="no data in band"):
        user_rasters.read([near, far], CAMERA)


@pytest.mark.parametrize(
    "names",
    [
        ["Blau", "Grün", "Rot", "Rotkante", "Nahes Infrarot"],
        ["B", "G", "R", "RE", "NIR"],
        ["mean_blue", "mean_green", "mean_red", "mean_rededge", "mean_nir"],
        ["bleu", "vert", "rouge", "red-edge", "proche infrarouge"],
    ],
)
def test_colours_are_known_in_other_words(tmp_path, names):
    order = [4, 2, 0, 3, 1]
    path = tiff(tmp_path / "a.tif", leaves()[order], names=[names[k] for k in order])
    read = user_rasters.read(path, CAMERA)
    assert medians(read) == pytest.approx(USUAL, rel=0.02)


def test_numbers_of_bands_are_no_colours(tmp_path):
    path = tiff(tmp_path / "a.tif", leaves(), names=["B1", "B2", "B3", "B4", "B5"])
    assert user_rasters.read(path, CAMERA).facts["bands_found"] == raster_bands.BY_ORDER


def test_bands_that_are_dark_at_most_pixels_are_refused(tmp_path):
    values = leaves()
    values[:4, :, 10:] = 0.0
    with pytest.raises(InputError, match="0 at half of the pixels"):
        user_rasters.read(tiff(tmp_path / "a.tif", values), CAMERA)


def test_a_system_that_is_on_no_map_is_refused(tmp_path):
    local = rasterio.crs.CRS.from_wkt('LOCAL_CS["of the site",UNIT["metre",1]]')
    path = tiff(tmp_path / "a.tif", leaves(), crs=local)
    with pytest.raises(InputError, match="on no map"):
        user_rasters.read(path, CAMERA, crs="EPSG:25832")
