"""Sound small files of every format that dapple reads, and the reader of each."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import geopandas
import laspy
import numpy as np
import pye57
import rasterio
import shapely
from rasterio.transform import from_origin

from dapple.cloud import scan_windows, selection
from dapple.formats import clouds, meshes, rami, rasters, user_rasters, vectors, voxel_grids
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.raster_bands import CameraBand
from dapple.optics import cameras, responses, spectrum_table
from dapple.scene import sensors
from dapple.sky import measured_sky, radiation_table
from dapple.stats import measured

XYZ = np.round(np.random.default_rng(3).uniform(-2, 6, (120, 3)), 3)


@dataclass(frozen=True)
class Seed:
    """A sound file.

    Attributes
    ----------
    path : Path
    read : function of a path
        What dapple does with such a file.
    is_text : bool
        Whether lines and words of it mean something.
    """

    path: Path
    read: Callable[[Path], object]
    is_text: bool


@dataclass(frozen=True)
class Band:
    name: str
    centre_nm: float
    width_nm: float = 30.0


BANDS: list[CameraBand] = [Band("Red", 668.0), Band("NIR", 840.0)]


def read_cloud(path: Path) -> None:
    """Points, shots told one by one, and ordered scans, as the workflow takes them."""
    cloud, source = clouds.read_with_source(path)
    selection.take(cloud, source, path)
    clouds.fired(path)
    if path.suffix.lower() in clouds.ORDERED:
        for _ in clouds.ordered_scans(path):
            pass


def read_records(path: Path) -> object:
    places = sensors.pd.DataFrame({"sensor": ["3_7", "3_8"], "x_m": 0.0, "y_m": 0.0, "z_m": 0.0})
    return measured.read(path, sensors=places, timezone="Europe/Berlin")


def read_radiation(path: Path) -> object:
    return radiation_table.read(path, timezone="Europe/Berlin")


def read_spectrum(path: Path) -> object:
    return spectrum_table.read(path, (400.0, 700.0), with_transmittance="leaf" in path.name)


def read_images(path: Path) -> object:
    return user_rasters.read(path, BANDS, crs="EPSG:25832", scale=10_000.0)


def read_crowns(path: Path) -> object:
    return vectors.read(path, crs="EPSG:25832")


def make(folder: Path) -> list[Seed]:
    """Write all of them."""
    folder.mkdir(parents=True, exist_ok=True)
    found = [*_clouds(folder), *_meshes(folder), *_rasters(folder), *_vectors(folder)]
    for name, (text, read) in texts().items():
        path = folder / name
        path.write_bytes(text.encode("utf-8"))
        found.append(Seed(path, read, True))
    (folder / "leg000_pulse.txt").write_text(PULSES)
    return found


def _clouds(folder: Path) -> list[Seed]:
    attributes = {
        "Reflectance": np.linspace(-20, 0, len(XYZ)).astype(np.float32),
        "Classification": np.tile([2, 4, 7], 40).astype(np.uint8),
        "ReturnNumber": np.ones(len(XYZ), np.uint8),
        "NumberOfReturns": np.ones(len(XYZ), np.uint8),
    }
    cloud = Cloud(XYZ, np.array([5e5, 5.3e6, 0.0]), attributes)
    for name in ("points.las", "points.laz", "points.ply"):
        options = {} if name.endswith("ply") else {"crs": "EPSG:25832"}
        clouds.write(folder / name, cloud, **options)
    header = laspy.LasHeader(point_format=3, version="1.2")
    header.scales = np.full(3, 1e-3)
    old = laspy.LasData(header)
    old.x, old.y, old.z = XYZ.T
    old.write(folder / "old.las")
    old.write(folder / "old.laz")
    with pye57.E57(str(folder / "scans.e57"), mode="w") as file:
        data = {f"cartesian{axis}": XYZ[:, k].copy() for k, axis in enumerate("XYZ")}
        data["intensity"] = np.linspace(0, 1, len(XYZ))
        file.write_scan_raw(data, translation=np.array([1.0, 2.0, 3.0]))
        file.write_scan_raw(data, translation=np.array([9.0, 2.0, 3.0]))
    fields = np.dtype([(axis, "<f8") for axis in "xyz"])
    head = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\nWIDTH 120\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(XYZ)}\nDATA binary\n"
    )
    (folder / "points.pcd").write_bytes(head.encode() + XYZ.ravel().view(fields).tobytes())
    names = (
        *("points.las", "points.laz", "points.ply", "old.las", "old.laz", "scans.e57"),
        "points.pcd",
    )
    return [Seed(folder / name, read_cloud, False) for name in names]


def _meshes(folder: Path) -> list[Seed]:
    mesh = Mesh(
        np.eye(4, 3), np.array([[0, 1, 2], [1, 2, 3]], np.int32), np.arange(2, dtype=np.int32)
    )
    meshes.write_ply(folder / "mesh.ply", mesh, np.zeros(3))
    meshes.write_obj(folder / "mesh.obj", mesh, "local")
    return [
        Seed(folder / "mesh.ply", meshes.read_ply, False),
        Seed(folder / "mesh.obj", lambda path: meshes.read_obj(path, "local"), True),
    ]


def _rasters(folder: Path) -> list[Seed]:
    values = np.random.default_rng(1).uniform(300, 4500, (2, 24, 24)).astype(np.uint16)
    grid = {"crs": "EPSG:25832", "transform": from_origin(5e5, 5.3e6, 0.5, 0.5)}
    shape = {"driver": "GTiff", "count": 2, "height": 24, "width": 24}
    for name, more in {
        "images.tif": {"dtype": "uint16"},
        "packed.tif": {"dtype": "uint16", "compress": "deflate", "tiled": True,
                       "blockxsize": 16, "blockysize": 16},
        "maps.tif": {"dtype": "float32"},
    }.items():  # fmt: skip
        scaled = values.astype("float32") / 1e4 if more["dtype"] == "float32" else values
        with rasterio.open(folder / name, "w", **shape, **grid, **more) as file:
            file.write(scaled)
            file.descriptions = ["Red", "NIR"]
    return [
        Seed(folder / "images.tif", read_images, False),
        Seed(folder / "packed.tif", read_images, False),
        Seed(folder / "maps.tif", rasters.read, False),
    ]


def _vectors(folder: Path) -> list[Seed]:
    boxes = [shapely.box(5e5 + 3 * k, 5.3e6, 5e5 + 3 * k + 2, 5.3e6 + 2) for k in range(3)]
    frame = geopandas.GeoDataFrame(
        {"tree": ["a", "b", "c"], "lcc": [30.0, 41.5, np.nan]}, geometry=boxes, crs="EPSG:25832"
    )
    frame.to_file(folder / "crowns.gpkg")
    frame.to_crs(4326).to_file(folder / "crowns.geojson", driver="GeoJSON")
    frame.to_file(folder / "crowns.shp")
    return [
        Seed(folder / "crowns.gpkg", read_crowns, False),
        Seed(folder / "crowns.geojson", read_crowns, True),
        Seed(folder / "crowns.shp", read_crowns, False),
    ]


def _rows(template: str, count: int = 30) -> str:
    return "".join(
        template.format(hour=k // 2, minute=30 * (k % 2), k=k, value=20.5 * k) for k in range(count)
    )


def _points(template: str, count: int = 40) -> str:
    return "".join(template.format(*row, k % 5) for k, row in enumerate(XYZ[:count]))


PTX = (
    "3\n4\n1 2 3\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n1 2 3 1\n"
    + "0 0 0 0.5\n1.5 2 0.3 0.7\n" * 6
)
PULSES = _rows("1 2 3 0 0.6 0.8 0 {k}\n")
MTL = '"TOA5","CR1000","CR1000","1","CR1000.Std.32","CPU:a.CR1","4711","Tab10"\n'


def texts() -> dict[str, tuple[str, Callable[[Path], object]]]:
    """Text files by name, each with its reader."""
    stamps = "2023-08-10 {hour:02d}:{minute:02d}"
    return {
        "points.txt": ("//X Y Z Reflectance\n40\n" + _points("{} {} {} -{}\n"), read_cloud),
        "points.csv": ("X[mm];Y[mm];Z[mm];Label\n"
                       + _points("{};{};{};{}\n").replace(".", ","), read_cloud),
        "points.pts": (2 * ("40\n" + _points("{} {} {} -{} 0 0 0\n")), read_cloud),
        "points.asc.xyz": (_points("{} {} {} {}\n"), read_cloud),
        "ascii.ply": ("ply\nformat ascii 1.0\nelement vertex 40\nproperty float x\nproperty float "
                      "y\nproperty float z\nproperty uchar label\nend_header\n"
                      + _points("{} {} {} {}\n"), read_cloud),
        "scan.ptx": (PTX + PTX, read_cloud),
        "shots.txt": ('"XOrigin" "YOrigin" "ZOrigin" "XDirection" "YDirection" "ZDirection" '
                      '"Range0" "EmptyShot"\n' + _rows("0 0 1.5 0 {k} 0.8 {value} 0\n"),
                      read_cloud),
        "leg000_points.xyz": (_rows("1 {k} 0.8 7 1 1 1 {k} 0\n"), read_cloud),
        "radiation.csv": ("time_utc,global_W_m2,diffuse_W_m2\n"
                          + _rows(stamps + ":00,{value},{k}\n"), read_radiation),
        "german.csv": ("time;Globalstrahlung [W/m²];Diffusstrahlung [W/m²]\n"
                       + _rows("10.08.2023 {hour:02d}:{minute:02d};{k},5;{k}\n"), read_radiation),
        "toa5.dat": (MTL + '"TIMESTAMP","RECORD","global","diffuse"\n"TS","RN","W/m^2","W/m^2"\n'
                     '"","","Avg","Avg"\n' + _rows('"' + stamps + ':00",{k},{value},"NAN"\n'),
                     read_radiation),
        "dwd.txt": ("STATIONS_ID;MESS_DATUM;  QN;DS_10;GS_10;SD_10;LS_10;eor\n"
                    + _rows("1443;20230810{hour:02d}{minute:02d};3; {k}.0;{value};0.1;-999;eor\n"),
                    read_radiation),
        "nsrdb.csv": ("Source,Location ID,Time Zone\nNSRDB,1,-5\nYear,Month,Day,Hour,Minute,GHI,"
                      "DHI\n" + _rows("2023,8,10,{hour},{minute},{value},{k}\n"), read_radiation),
        "pvgis.csv": ("Latitude (decimal degrees):\t48.0\nSlope: 0 deg.\ntime,Gb(i),Gd(i)\n"
                      + _rows("20230810:{hour:02d}{minute:02d},{value},{k}\n") + "\nGb(i): beam\n",
                      read_radiation),
        "pangaea.tab": ("/* comment\n*/\nDate/Time\tSWD [W/m**2]\tDIF [W/m**2]\n"
                        + _rows("2023-08-10T{hour:02d}:{minute:02d}\t{value}\t{k}\n"),
                        read_radiation),
        "records.csv": ("logger,channel,time_utc,par_umolm2s\n"
                        + _rows("3,7," + stamps + ",{value}\n"), read_records),
        "wide.csv": ("time;PAR_3_7;PAR_3_8\n" + _rows(stamps + ";{k},5;{k}\n"), read_records),
        "hobo_3_7.csv": ('"Plot Title: a"\n"#","Date Time, GMT+01:00","PAR, uE (LGR S/N: 0)"\n'
                         + _rows("{k},08/1{k}/23 11:30:00 PM,{value}\n", 10), read_records),
        "sensors.csv": ("label,X,Y,Z\n" + _points("s{}{}{},1,2,{}\n"), sensors.read),
        "positions.csv": ("position,x,y,z\n1,0,0,1.5\n2,5,5,1.6\n",
                          lambda path: scan_windows.read_positions(path, np.zeros(3))),
        "bark.csv": ("wavelength_nm,reflectance\n"
                     + "".join(f"{390 + 10 * k},0.{10 + k}\n" for k in range(40)), read_spectrum),
        "leaf.csv": ("wavelength_nm;reflectance [%];transmittance [%]\n"
                     + "".join(f"{390 + 10 * k};{k},5;{k}\n" for k in range(40)), read_spectrum),
        "response.csv": ("angle_deg,response\n0,1\n45,0.7\n90,0\n", responses.read),
        "camera.csv": ("wavelength_nm,Red,NIR\n"
                       + "".join(f"{400 + 20 * k},{k % 7},{k % 5}\n" for k in range(30)),
                       lambda path: cameras.camera([("Red", 668, 14), ("NIR", 840, 40)], path)),
        "sky.csv": ("zenith_deg,azimuth_deg,radiance\n"
                    + "".join(f"{z},{a},1\n" for z in range(3, 90, 6) for a in range(0, 360, 6)),
                    measured_sky.read),
        "discs.def": ("".join(f"0.1 {k} 1 2 0 0 1\n" for k in range(20)), rami.read_discs),
        "grid.vox": ("VOXEL SPACE\n#min_corner: 0 0 0\n#max_corner: 2 2 1\n#split: 2 2 1\n#res: 1"
                     "\ni j k PadBVTotal\n0 0 0 1.5\n0 1 0 NaN\n1 0 0 2\n1 1 0 0\n",
                     voxel_grids.read_vox),
        "nothing.json": (json.dumps({"type": "FeatureCollection", "features": []}), read_crowns),
    }  # fmt: skip
