"""Images as people bring them: any grid, scale and order of bands, made into one kind of raster."""

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyproj
import rasterio
import rasterio.warp
from rasterio.enums import ColorInterp, Resampling
from rasterio.transform import Affine
from rasterio.vrt import WarpedVRT
from rasterio.windows import Window

from dapple import findings
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import raster_bands, raster_gaps, raster_scale
from dapple.formats.raster_bands import CameraBand
from dapple.formats.rasters import Raster, same_crs

MOST_VALUES = 400_000_000


@dataclass(frozen=True)
class UserRaster:
    """An image as it is used, and how it came about.

    Attributes
    ----------
    raster : Raster
        Reflectance by band of the camera; NaN where there are no data.
    findings : tuple of Finding
    facts : dict
    """

    raster: Raster
    findings: tuple[Finding, ...]
    facts: dict


def read(
    path: str | Path | Sequence[str | Path],
    camera: Sequence[CameraBand],
    *,
    crs: str = "",
    bounds_m: Sequence[float] | None = None,
    scale: float = 0.0,
    nodata: float | None = None,
    band_order: Sequence[int] = (),
    hint: str = "",
) -> UserRaster:
    """Read reflectance images.

    Parameters
    ----------
    path : path or several
        GeoTIFF or what else GDAL opens. Bands of several files are brought to the pixels of the
        finest, and a file of one band is called after its name.
    camera : sequence of bands
        Name, centre and width of each band that is wanted.
    crs : str
        Coordinate system into which the images are warped; empty: their own, or, where that is not
        in true metres, the UTM zone of the place.
    bounds_m : four floats or None
        West, south, east, north beyond which nothing is read, in `crs` [m].
    scale : float
        Value that means a reflectance of 1; 0: the file's own scale, or none.
    nodata : float or None
        Value that means no data, besides the file's own.
    band_order : sequence of int
        Number of the image's band, from 1, for each band of the camera; empty: found.
    hint : str
        What else would help where bands do not fit, for messages.

    Raises
    ------
    InputError
        No such file, no raster, no coordinate system, bands that do not fit, no overlap, an image
        too large, or values that are no reflectance.
    """
    paths = [Path(path)] if isinstance(path, str | Path) else [Path(one) for one in path]
    for one in paths:
        if not one.is_file():
            raise InputError(one, "no file", "images", "Check the path in the configuration.")
    where = str(paths[0]) if len(paths) == 1 else f"{paths[0]} and {len(paths) - 1} more"
    noticed: list[Finding] = []
    gone: dict[str, float] = {}
    factors: list[float | str] = []
    layers: dict[int, np.ndarray] = {}
    grid: tuple[Affine, int, int] | None = None
    try:
        with ExitStack() as stack:
            files = [stack.enter_context(rasterio.open(one)) for one in paths]
            bands = [band for file in files for band in _bands(file, len(camera), len(files))]
            texts, tags = [band.text for band in bands], [band.tags for band in bands]
            order, how = raster_bands.match(
                camera, texts, tags, order=band_order, where=where, hint=hint
            )
            chosen = [bands[k] for k in order]
            target = _target(paths[0], files[0], crs)
            used = list(dict.fromkeys(band.file for band in chosen))
            if len(used) > 1:  # the finest first
                used.sort(key=lambda file: _pixel_m(file, target))
            for file in used:
                own = [k for k, band in enumerate(chosen) if band.file is file]
                numbers = [chosen[k].number for k in own]
                name = Path(file.name)
                empty = raster_gaps.flags(file, numbers, nodata)
                masks = _masks(file, len(camera) if len(files) == 1 else 1)
                if grid is None:
                    values, valid, transform = _read(
                        name, file, numbers, masks, target, empty, bounds_m
                    )
                    grid = (transform, values.shape[2], values.shape[1])
                else:
                    values, valid = _onto(file, numbers, masks, target, empty, grid)
                    noticed.append(findings.note(name, f"brought to pixels of {transform.a:g} m"))
                if not _fits(file, target):
                    noticed.append(findings.note(name, f"images in {file.crs}, warped to {target}"))
                kind = np.dtype(file.dtypes[numbers[0] - 1])
                is_integer = np.issubdtype(kind, np.integer)
                most = np.iinfo(kind).max if is_integer else None
                values, missing = raster_gaps.without_data(values, valid, empty, most)
                gone |= {text: max(share, gone.get(text, 0.0)) for text, share in missing.items()}
                scales, offsets = (
                    np.array([of_file[number - 1] for number in numbers])
                    for of_file in (file.scales, file.offsets)
                )
                values, factor = raster_scale.reflectance(
                    name, values, scale, scales, offsets, is_integer
                )
                factors.append(factor)
                layers |= dict(zip(own, values, strict=True))
    except (rasterio.errors.RasterioError, UnicodeDecodeError, pyproj.exceptions.CRSError) as error:
        raise InputError(
            where, f"no readable raster ({error})", "a GeoTIFF in a known coordinate system",
            "Copy or export the file again.",
        ) from error  # fmt: skip
    values = np.stack([layers[k] for k in range(len(chosen))])
    values = np.where(np.isfinite(values).all(axis=0), values, np.nan)
    if how == raster_bands.BY_ORDER:
        noticed.append(
            findings.warning(
                where,
                f"{len(chosen)} bands without names",
                f"bands {', '.join(band.name for band in camera)}",
                "They are taken in this order; set `band_order` if it is another.",
            )
        )
    noticed += [
        findings.note(where, f"{share:.1%} of pixels {text}") for text, share in gone.items()
    ]
    noticed += raster_scale.check(where, values, camera)
    if how == raster_bands.BY_ORDER:
        raster_scale.check_order(where, values, camera)
    names = tuple(band.name for band in camera)
    raster = Raster(
        values.astype(np.float32), transform.c, transform.f, float(transform.a), target, names
    )
    facts = {
        "path": where,
        "bands": {
            band.name: one.text or str(one.number) for band, one in zip(camera, chosen, strict=True)
        },
        "bands_found": how,
        "crs": target,
        "pixel_m": raster.pixel_m,
        "scale": factors[0] if len(set(factors)) == 1 else ", ".join(map(str, factors)),
        "without_data": gone,
    }
    return UserRaster(raster, tuple(noticed), facts)


@dataclass(frozen=True)
class _Band:
    """A band of an open file, by its number from 1, with its name and metadata."""

    file: rasterio.DatasetReader
    number: int
    text: str
    tags: dict[str, str]


def _bands(file: rasterio.DatasetReader, of_camera: int, files: int) -> list[_Band]:
    """Bands of a file that are no mask; the only one of a file among several is called after it."""
    masks = _masks(file, of_camera if files == 1 else 1)
    numbers = [k for k in range(1, file.count + 1) if k not in masks]
    stem = Path(file.name).stem if files > 1 and len(numbers) == 1 else ""
    return [_Band(file, k, file.descriptions[k - 1] or stem, file.tags(k)) for k in numbers]


def _pixel_m(file: rasterio.DatasetReader, target: str) -> float:
    """Edge of a file's pixels in the target system [m]; infinite where it has no place."""
    if file.crs is None:
        return np.inf
    with WarpedVRT(file, crs=target) as warped:
        return float(warped.transform.a)


def _onto(
    file: rasterio.DatasetReader,
    numbers: Sequence[int],
    masks: Sequence[int],
    target: str,
    empty: Sequence[float],
    grid: tuple[Affine, int, int],
) -> tuple[np.ndarray, np.ndarray]:
    """Values (b, rows, columns) on another file's grid, and where masks allow them."""
    if file.crs is None:
        raise InputError(
            file.name, "no coordinate system", "that of the other images",
            "Assign it (gdal_edit.py -a_srs EPSG:…).",
        )  # fmt: skip
    transform, width, height = grid
    with WarpedVRT(
        file, crs=target, transform=transform, width=width, height=height,
        resampling=Resampling.nearest, nodata=None if masks else _one(empty, file, numbers),
    ) as source:  # fmt: skip
        values = source.read(list(numbers), out_dtype=np.float64)
        valid = (source.read_masks(list(numbers)) > 0).all(axis=0)
        if masks:
            valid &= (source.read(list(masks)) > 0).all(axis=0)
    return values, valid


def _masks(file: rasterio.DatasetReader, n_bands: int) -> list[int]:
    """Numbers of bands that say where there are data: alpha, or called mask."""
    named = [k for k, text in enumerate(file.descriptions, start=1)
             if (text or "").lower().strip() in ("alpha", "mask", "opacity")]  # fmt: skip
    alpha = [k for k, kind in enumerate(file.colorinterp, start=1) if kind == ColorInterp.alpha]
    last = file.count
    if not named and not alpha and last > n_bands and not file.descriptions[last - 1]:
        few = np.unique(file.read(last, out_shape=(min(file.height, 256), min(file.width, 256))))
        if len(few) <= 2 and set(few.tolist()) <= {0, 1, 255, 65_535}:
            return [last]
    return sorted({*named, *alpha})


def _target(path: Path, file: rasterio.DatasetReader, crs: str) -> str:
    """The projected system in which the images are used."""
    if file.crs is None:
        raise InputError(
            path,
            "no coordinate system",
            "the one in which the images were made",
            "Assign it (gdal_edit.py -a_srs EPSG:…).",
        )
    own = pyproj.CRS(file.crs.to_wkt())
    if not own.is_projected and not own.is_geographic:
        raise InputError(
            path, f"the coordinate system '{own.name}', which is on no map",
            "a projected or geographic one",
            "Georeference the images, or assign their system (gdal_edit.py -a_srs EPSG:…).",
        )  # fmt: skip
    if crs:
        return crs
    # Feet are no metres, and the web's Mercator stretches them by the latitude.
    by = own.coordinate_operation.method_name if own.coordinate_operation else ""
    is_metric = own.axis_info and own.axis_info[0].unit_name == "metre"
    if own.is_projected and is_metric and "Pseudo" not in by:
        return str(file.crs.to_string())
    west, south, east, north = rasterio.warp.transform_bounds(file.crs, "EPSG:4326", *file.bounds)
    zone = int((0.5 * (west + east) + 180.0) // 6.0) + 1
    return f"EPSG:{32600 + zone if 0.5 * (south + north) >= 0 else 32700 + zone}"


def _fits(file: rasterio.DatasetReader, target: str) -> bool:
    """Whether the file's own grid can be taken: its system, square pixels, rows to the south."""
    grid = file.transform
    is_square = np.isclose(grid.a, -grid.e, rtol=1e-6) and grid.a > 0 and not grid.b and not grid.d
    return bool(is_square and same_crs(file.crs.to_string(), target))


def _read(
    path: Path,
    file: rasterio.DatasetReader,
    chosen: Sequence[int],
    masks: Sequence[int],
    target: str,
    empty: Sequence[float],
    bounds_m: Sequence[float] | None,
) -> tuple[np.ndarray, np.ndarray, Affine]:
    """Values (b, rows, columns), where masks allow them (rows, columns), and the grid."""
    if _fits(file, target):
        source, transform, shape = file, file.transform, (file.height, file.width)
        window = _window(path, transform, shape, bounds_m)
        _bound(path, window, len(chosen))
        values = source.read(list(chosen), window=window, out_dtype=np.float64)
        mask = source.read(list(masks), window=window) if masks else None
        own = source.read_masks(list(chosen), window=window) > 0
    else:
        options = {
            "crs": target,
            "resampling": Resampling.nearest,
            "nodata": None if masks else _one(empty, file, chosen),
        }
        with WarpedVRT(file, **options) as plain:
            square = _square(plain)
        size = Window(0, 0, square["width"], square["height"])
        if max(square["width"], square["height"]) > MOST_VALUES:
            _bound(path, size, len(chosen))
        with WarpedVRT(file, **options, **square) as source:
            transform, shape = source.transform, (source.height, source.width)
            window = _window(path, transform, shape, bounds_m)
            _bound(path, window, len(chosen))
            values = source.read(list(chosen), window=window, out_dtype=np.float64)
            mask = source.read(list(masks), window=window) if masks else None
            own = source.read_masks(list(chosen), window=window) > 0
    valid = own.all(axis=0) & (True if mask is None else (mask > 0).all(axis=0))
    corner = (
        transform.c + window.col_off * transform.a,
        transform.f - window.row_off * transform.a,
    )
    return values, valid, Affine(transform.a, 0, corner[0], 0, -transform.a, corner[1])


def _square(warped: WarpedVRT) -> dict[str, Any]:
    """The grid that warping gives, with the finer edge of its pixels for both."""
    grid = warped.transform
    pixel_m = min(grid.a, -grid.e)
    if not 0 < pixel_m < np.inf or not np.isfinite(grid).all():
        raise InputError(
            warped.name, f"pixels of {pixel_m:g} m", "pixels with a size",
            "Check the georeference of the images.",
        )  # fmt: skip
    return {
        "transform": Affine(pixel_m, 0.0, grid.c, 0.0, -pixel_m, grid.f),
        "width": int(np.ceil(round(warped.width * grid.a / pixel_m, 6))),
        "height": int(np.ceil(round(warped.height * -grid.e / pixel_m, 6))),
    }


def _one(
    empty: Sequence[float], file: rasterio.DatasetReader, chosen: Sequence[int]
) -> float | None:
    """A value that fits the file's type, to fill what lies beyond it when it is turned."""
    kind = np.dtype(file.dtypes[chosen[0] - 1])
    if np.issubdtype(kind, np.floating):
        return float(empty[0])
    limits = np.iinfo(kind)
    return next((v for v in empty if limits.min <= v <= limits.max), None)


def _window(
    path: Path, transform: Affine, shape: tuple[int, int], bounds_m: Sequence[float] | None
) -> Window:
    """Whole pixels within the bounds.

    Raises
    ------
    InputError
        There are none.
    """
    rows, columns = shape
    if bounds_m is None:
        return Window(0, 0, columns, rows)
    west, south, east, north = bounds_m
    left, top, pixel_m = transform.c, transform.f, transform.a
    first, last = (np.floor((west - left) / pixel_m), np.ceil((east - left) / pixel_m))
    upper, lower = (np.floor((top - north) / pixel_m), np.ceil((top - south) / pixel_m))
    first, upper = max(int(first), 0), max(int(upper), 0)
    last, lower = min(int(last), columns), min(int(lower), rows)
    if first >= last or upper >= lower:
        raise InputError(
            path,
            f"images of east {left:.1f} to {left + columns * pixel_m:.1f}, north "
            f"{top - rows * pixel_m:.1f} to {top:.1f} m",
            f"an overlap with the cloud (east {west:.1f} to {east:.1f}, north {south:.1f} to "
            f"{north:.1f} m)",
            "Give images and LiDAR of one place; check both coordinate systems.",
        )
    return Window(first, upper, last - first, lower - upper)


def _bound(path: Path, window: Window, n_bands: int) -> None:
    if window.width * window.height * n_bands > MOST_VALUES:
        raise InputError(
            path,
            f"{window.width} × {window.height} pixels in {n_bands} bands",
            f"{MOST_VALUES:.0e} values at most",
            "Crop the images to the plot or make their pixels larger (gdalwarp -tr).",
        )
