"""Rasters with world coordinates: images, heights, labels and maps as GeoTIFF."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import rasterio
from rasterio.transform import Affine

from dapple.errors import InputError
from dapple.formats.atomic import atomic

MOST_VALUES = 1_000_000_000
"""More values of all bands are not read: they would take 8 GB."""


@dataclass(frozen=True)
class Raster:
    """Pixels on a north-up grid.

    Attributes
    ----------
    values : (b, rows, columns) float32
        NaN where there are no data; row 0 lies in the north.
    left_m, top_m : float
        World coordinates of the outer north-west corner [m].
    pixel_m : float
        Edge of a pixel [m].
    crs : str
        Coordinate system, as in "EPSG:25832"; empty where it is not known.
    bands : tuple of str
        What each band is: a wavelength ("450") or a quantity ("height_m").
    """

    values: np.ndarray
    left_m: float
    top_m: float
    pixel_m: float
    crs: str
    bands: tuple[str, ...]

    def __post_init__(self):
        if self.values.ndim != 3 or len(self.values) != len(self.bands):
            raise ValueError(f"values {self.values.shape} for bands {self.bands}")

    @property
    def right_m(self) -> float:
        return self.left_m + self.values.shape[2] * self.pixel_m

    @property
    def bottom_m(self) -> float:
        return self.top_m - self.values.shape[1] * self.pixel_m

    def pixel_of(self, xy_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Row and column (n,) of the pixels that hold world points (n, 2); may lie outside."""
        xy = np.asarray(xy_m, np.float64)
        column = np.floor((xy[..., 0] - self.left_m) / self.pixel_m).astype(np.int64)
        row = np.floor((self.top_m - xy[..., 1]) / self.pixel_m).astype(np.int64)
        return row, column

    def centres_m(self) -> tuple[np.ndarray, np.ndarray]:
        """World y of the rows and x of the columns, at the centres of pixels [m]."""
        _, rows, columns = self.values.shape
        y = self.top_m - (np.arange(rows) + 0.5) * self.pixel_m
        return y, self.left_m + (np.arange(columns) + 0.5) * self.pixel_m


def read(path: str | Path) -> Raster:
    """Read a GeoTIFF, or what else GDAL opens, whole.

    Missing data (the file's nodata value or mask) become NaN, and the file's own scale and offset
    are applied. Bands without a description are called by their number, from "1".

    Raises
    ------
    InputError
        No such file, no raster, more pixels than fit into memory, no coordinate system or one in
        degrees, pixels that are not square or do not run east and south.
    """
    path = Path(path)
    if not path.is_file():
        raise InputError(path, "no file", "a raster", "Check the path in the configuration.")
    try:
        with rasterio.open(path) as file:
            _check_size(path, file.width, file.height, file.count)
            crs = _crs(path, file.crs)
            transform, pixel_m = file.transform, _pixel(path, file.transform)
            masked = file.read(masked=True, out_dtype=np.float64)
            scales, offsets = np.array(file.scales), np.array(file.offsets)
            bands = tuple(
                text or str(number) for number, text in enumerate(file.descriptions, start=1)
            )
    except (rasterio.errors.RasterioError, UnicodeDecodeError) as error:
        raise InputError(
            path, f"no readable raster ({error})", "a GeoTIFF", "Copy or export the file again."
        ) from error
    values = masked.filled(np.nan) * scales[:, None, None] + offsets[:, None, None]
    values[~np.isfinite(values)] = np.nan
    return Raster(values.astype(np.float32), transform.c, transform.f, pixel_m, crs, bands)


def write(path: str | Path, raster: Raster, *, cloud_optimized: bool = False) -> None:
    """Write a GeoTIFF of 32-bit floats, compressed, whole or not at all; NaN is its nodata.

    With `cloud_optimized` it has overviews and the order of a COG, for maps that people look at.
    """
    count, rows, columns = raster.values.shape
    layout: dict[str, Any] = (
        {"driver": "COG", "blocksize": 256, "predictor": "floating_point"}
        if cloud_optimized
        else {
            "driver": "GTiff",
            "tiled": True,
            "blockxsize": 256,
            "blockysize": 256,
            "predictor": 3,
        }
    )
    with (
        atomic(path) as partial,
        rasterio.open(
            partial,
            "w",
            height=rows,
            width=columns,
            count=count,
            dtype="float32",
            crs=raster.crs or None,
            transform=Affine(raster.pixel_m, 0, raster.left_m, 0, -raster.pixel_m, raster.top_m),
            nodata=np.nan,
            compress="deflate",
            **layout,
        ) as file,
    ):
        file.write(raster.values.astype(np.float32))
        file.descriptions = raster.bands


def select(raster: Raster, bands: Sequence[str], where: str | Path) -> Raster:
    """The named bands in the order asked.

    Raises
    ------
    InputError
        A band is not there; the message lists those that are.
    """
    missing = [band for band in bands if band not in raster.bands]
    if missing:
        raise InputError(
            where,
            f"bands {', '.join(raster.bands)}, none called {', '.join(missing)}",
            f"bands {', '.join(bands)}",
            "Add the missing bands, or write the wavelength in nm as each band's description.",
        )
    index = [raster.bands.index(band) for band in bands]
    return replace(raster, values=raster.values[index], bands=tuple(bands))


def same_crs(one: str, other: str) -> bool:
    """Whether two coordinate systems agree on east and north; heights are left out."""
    return horizontal(one).equals(horizontal(other), ignore_axis_order=True)


def require_overlap(
    raster: Raster,
    low_m: Sequence[float],
    high_m: Sequence[float],
    crs: str | None,
    *,
    where: str | Path,
    other: str | Path,
    min_share: float = 0.0,
) -> float:
    """Check that a raster and other data share a coordinate system and a place.

    Parameters
    ----------
    raster : Raster
    low_m, high_m : at least two floats
        Corners of the other data: east, north in world coordinates [m].
    crs : str or None
        Coordinate system of the other data.
    where, other : str or Path
        Names of the raster and of the other data, for messages.
    min_share : float
        Least share of the raster's area that the other data's box has to cover.

    Returns
    -------
    float
        The share that it covers.

    Raises
    ------
    InputError
        No or another coordinate system, or no (or not enough) overlap.
    """
    if not crs:
        raise InputError(
            other, "no coordinate system", raster.crs, "Write it into the file's header."
        )
    if not same_crs(raster.crs, crs):
        raise InputError(
            where,
            f"coordinate system {_name(raster.crs)}",
            f"{_name(crs)}, as in {other}",
            "Reproject one of them (gdalwarp, or PDAL's filters.reprojection).",
        )
    width = min(raster.right_m, high_m[0]) - max(raster.left_m, low_m[0])
    height = min(raster.top_m, high_m[1]) - max(raster.bottom_m, low_m[1])
    whole = (raster.right_m - raster.left_m) * (raster.top_m - raster.bottom_m)
    share = max(width, 0.0) * max(height, 0.0) / whole
    if share <= min_share:
        raise InputError(
            where,
            f"east {raster.left_m:.1f} to {raster.right_m:.1f}, north {raster.bottom_m:.1f} to "
            f"{raster.top_m:.1f} m, {100 * share:.0f} % of it under {other} (east {low_m[0]:.1f} "
            f"to {high_m[0]:.1f}, north {low_m[1]:.1f} to {high_m[1]:.1f} m)",
            f"more than {100 * min_share:.0f} %",
            "Give data of one place in one coordinate system.",
        )
    return share


def _check_size(path: Path, width: int, height: int, bands: int) -> None:
    if width * height * bands > MOST_VALUES:
        raise InputError(
            path,
            f"{width} x {height} pixels in {bands} bands",
            f"at most {MOST_VALUES:,} values",
            "Cut out what belongs to the plot (gdalwarp -te), or make its pixels larger (-tr).",
        )


def _crs(path: Path, crs) -> str:
    if crs is None:
        raise InputError(
            path,
            "no coordinate system",
            "a projected one in metres, as EPSG:25832",
            "Assign the one it was made in (gdal_edit.py -a_srs).",
        )
    text = crs.to_string()
    if not pyproj.CRS(text).is_projected:
        raise InputError(
            path,
            f"coordinates in {_name(text)}",
            "a projected system in metres, as EPSG:25832",
            "Reproject it (gdalwarp -t_srs).",
        )
    return text


def _pixel(path: Path, transform) -> float:
    square = np.isclose(transform.a, -transform.e, rtol=1e-6) and transform.a > 0
    if not square or transform.b or transform.d:
        raise InputError(
            path,
            f"pixels of {transform.a:g} x {transform.e:g} m, turned by {transform.b:g}, "
            f"{transform.d:g}",
            "square pixels, columns to the east and rows to the south",
            "Resample it (gdalwarp -tr).",
        )
    return float(transform.a)


def horizontal(crs: str | pyproj.CRS) -> pyproj.CRS:
    """A coordinate system without its heights."""
    whole = pyproj.CRS(crs)
    return whole.sub_crs_list[0] if whole.is_compound else whole.to_2d()


def _name(crs: str) -> str:
    whole = pyproj.CRS(crs)
    authority = whole.to_authority()
    return ":".join(authority) if authority else whole.name
