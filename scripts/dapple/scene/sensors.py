"""Where the light is measured: PAR sensors, level or tilted."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.spatial import cKDTree

from dapple import findings
from dapple.errors import InputError
from dapple.formats import column_names, ground_surface, user_tables
from dapple.formats.ground_surface import GroundSurface
from dapple.formats.meshes import Mesh
from dapple.scene.surfaces import GROUND, Surface

COLUMN_NAMES = {
    "sensor": (*column_names.SENSOR, "name", "id", "point", "station"),
    "x_m": ("x_m", "x", "east", "easting", "utm_x", "rechtswert", "coord_x", "x_coord"),
    "y_m": ("y_m", "y", "north", "northing", "utm_y", "hochwert", "coord_y", "y_coord"),
    "z_m": (
        "z_m",
        "z",
        "up",
        "height",
        "height_m",
        "elevation",
        "altitude",
        "hoehe",
        "höhe",
        "coord_z",
        "z_coord",
    ),
}
POSITION = ["x_m", "y_m", "z_m"]
TILT = ("tilt_deg", "tilt", "inclination_deg", "inclination", "neigung")
AZIMUTH = ("azimuth_deg", "azimuth", "aspect_deg", "aspect", "azimut", "orientation_deg")
CALIBRATION = ("calibration", "calibration_factor")
LARGEST = {"tilt_deg": 180.0, "azimuth_deg": 360.0}
DEEPEST_M, LIFT_M = 0.15, 0.01
"""So far below the ground a sensor still lies on it, and so far above it is laid then."""


def read(
    path: str | Path,
    origin_m: Sequence[float] = (0.0, 0.0, 0.0),
    *,
    sensor_column: str = "",
    x_column: str = "",
    y_column: str = "",
    z_column: str = "",
    decimal: str = "",
    heights: str = "world",
    tilt_deg: float = 0.0,
    azimuth_deg: float | None = None,
) -> pd.DataFrame:
    """Read where sensors stand and where they face.

    Parameters
    ----------
    path : path
        A text table with columns of labels and of world coordinates [m], and perhaps `tilt_deg` and
        `azimuth_deg` of the normal, and `calibration`, by which the records of a sensor are
        multiplied; further columns are ignored. A row that stands there twice is read once.
    origin_m : (3,) float
        World coordinates of the local origin [m].
    sensor_column, x_column, y_column, z_column : str
        Empty: found by the usual names, `COLUMN_NAMES`; capitals do not matter.
    decimal : {"", ".", ","}
        Decimal sign; empty: as the cells show.
    heights : {"world", "above_ground"}
        Whether the heights of the table are coordinates, or heights above the ground below each
        sensor, to be laid upon it by `on_ground`.
    tilt_deg, azimuth_deg : float, float or None
        Of all sensors, where the table has no such column [°].

    Returns
    -------
    pandas.DataFrame
        `sensor` (text), `x_m`, `y_m`, `z_m` in the local frame [m], in the order of the file;
        `tilt_deg` and `azimuth_deg` where a sensor is tilted; `calibration` where the file has it.

    Raises
    ------
    InputError
        No file, column or row; a label that is missing or repeated; a coordinate that is not a
        number; a calibration that is not positive; a tilt without the azimuth to which it is.
    """
    source = user_tables.read(path, decimal=decimal)
    asked = dict(zip(COLUMN_NAMES, (sensor_column, x_column, y_column, z_column), strict=True))
    columns = {
        name: source.require(
            [asked[name]] if asked[name] else aliases, f"sensors.{name.removesuffix('_m')}_column"
        )
        for name, aliases in COLUMN_NAMES.items()
    }
    labels = source.text(columns["sensor"])
    numbers = pd.DataFrame({name: source.numbers(columns[name]).values for name in POSITION})
    wrong = ~np.isfinite(numbers).all(axis=1).to_numpy()
    if wrong.any():
        first = source.cells[wrong].iloc[0]
        where = ", ".join(first[columns[name]] for name in POSITION)
        raise InputError(
            path,
            f"sensor {first[columns['sensor']]} at ({where})",
            "three numbers",
            "Complete its coordinates or remove the sensor.",
        )
    table = numbers - np.asarray(origin_m, float) * [1.0, 1.0, float(heights == "world")]
    table.insert(0, "sensor", labels.to_numpy())
    angles = {"tilt_deg": (TILT, tilt_deg), "azimuth_deg": (AZIMUTH, azimuth_deg)}
    for name, (names, of_all) in angles.items():
        column = source.find(names)
        table[name] = source.numbers(column).values if column else of_all
    if column := source.find(CALIBRATION):
        table["calibration"] = source.numbers(column).values
    table = table.drop_duplicates(ignore_index=True)
    if len(table) < len(numbers):
        findings.say([findings.note(path, f"{len(numbers) - len(table)} rows twice, read once")])
    _check_labels(table["sensor"], path)
    if "calibration" in table:
        _check_calibration(table, path)
    return turned(table, path)


def turned(
    table: pd.DataFrame,
    where: str | Path = "sensors",
    *,
    tilt_deg: float | None = None,
    azimuth_deg: float | None = None,
) -> pd.DataFrame:
    """Sensors with the angles of their normals, or without where all are level.

    Parameters
    ----------
    table : pandas.DataFrame
        With `tilt_deg` and `azimuth_deg`, unless they are given here for all sensors.
    where : str or path
        The file or key, for messages.
    tilt_deg : float or None
        Of the normal from straight up [°].
    azimuth_deg : float or None
        To where the normal leans, clockwise from north [°].

    Raises
    ------
    InputError
        Angles out of range, or a tilt without an azimuth.
    """
    if tilt_deg is not None:
        table = table.assign(tilt_deg=tilt_deg, azimuth_deg=azimuth_deg)
    angles = table[["tilt_deg", "azimuth_deg"]].astype(float)
    table = table.drop(columns=list(angles))
    if (angles["tilt_deg"] == 0).all():
        return table
    angles.loc[angles["tilt_deg"] == 0, "azimuth_deg"] = 0.0
    for name, largest in LARGEST.items():
        wrong = ~angles[name].between(0.0, largest).to_numpy()
        if wrong.any():
            first = int(wrong.argmax())
            raise InputError(
                where,
                f"{name} {angles[name].iloc[first]:g} of sensor {table['sensor'].iloc[first]}",
                f"0 to {largest:g} degrees for every tilted sensor",
                "tilt_deg is the angle between the sensor's normal and straight up; azimuth_deg "
                "says to where the normal leans, clockwise from north. Complete both columns, or "
                "set `sensors.tilt_deg` and `sensors.azimuth_deg` for all.",
            )
    return pd.concat([table, angles], axis=1)


def on_ground(table: pd.DataFrame, ground: GroundSurface) -> pd.DataFrame:
    """Sensors whose heights are above the ground below them, in the local frame."""
    below = ground.height_m(table[["x_m", "y_m"]].to_numpy(float))
    return table.assign(z_m=table["z_m"] + below)


def _check_calibration(table: pd.DataFrame, path: str | Path) -> None:
    wrong = ~(table["calibration"] > 0)
    if wrong.any():
        first = table[wrong].iloc[0]
        raise InputError(
            path,
            f"calibration {first['calibration']:g} of sensor {first['sensor']}",
            "a factor above 0 in every row",
            "Write 1 where records need none.",
        )


def grid_around(
    centre_m: Sequence[float],
    columns: int,
    rows: int,
    spacing_m: float,
    height_m: float,
    ground: GroundSurface | None = None,
) -> pd.DataFrame:
    """Place a grid of sensors around a point.

    Parameters
    ----------
    centre_m : (2,) float
        East and north of its middle in the local frame [m].
    columns, rows : int
        Number of sensors from west to east and from south to north.
    spacing_m, height_m : float
        Between neighbours, and above the ground [m].
    ground : GroundSurface or None
        None: flat ground at 0.

    Returns
    -------
    pandas.DataFrame
        `sensor`, `x_m`, `y_m`, `z_m`; labels `row_column`, both from 1, from the southwest.
    """
    row, column = np.divmod(np.arange(rows * columns), columns)
    x_m = centre_m[0] + (column - 0.5 * (columns - 1)) * spacing_m
    y_m = centre_m[1] + (row - 0.5 * (rows - 1)) * spacing_m
    below_m = (ground or ground_surface.flat(0.0)).height_m(np.column_stack([x_m, y_m]))
    labels = [f"{r + 1}_{c + 1}" for r, c in zip(row, column, strict=True)]
    return pd.DataFrame({"sensor": labels, "x_m": x_m, "y_m": y_m, "z_m": below_m + height_m})


def check(
    sensors: pd.DataFrame,
    surfaces: Iterable[Surface] = (),
    *,
    bounds_m: np.ndarray | None = None,
    margin_m: float = 30.0,
    clearance_m: float = 0.005,
    ground: GroundSurface | None = None,
    where: str | Path = "sensors",
) -> None:
    """Make sure that every sensor stands in the scene, and not in a leaf, in wood or underground.

    Parameters
    ----------
    sensors : pandas.DataFrame
        `sensor`, `x_m`, `y_m`, `z_m` (local frame).
    surfaces : iterable of Surface
        What the sensors must keep clear of, but for the ground; it also spans the scene.
    bounds_m : (2, 3) float or None
        Lowest and highest corner of further parts of the scene, such as voxels [m].
    margin_m : float
        How far outside the bounding box of the scene a sensor may stand [m].
    clearance_m : float
        Smallest distance from a surface [m].
    ground : GroundSurface or None
        None: there is none.
    where : str or path
        The file or key, for messages.

    Raises
    ------
    InputError
        Names the sensor that is nearest to a surface or furthest outside, and the distance.
    """
    _check_labels(sensors["sensor"], where)
    points = sensors[POSITION].to_numpy(float)
    surfaces = list(surfaces)
    corners = [one.mesh.vertices_m for one in surfaces if len(one.mesh.vertices_m)]
    corners += [] if bounds_m is None else [np.asarray(bounds_m, float)]
    if corners:
        low = np.min([c.min(axis=0) for c in corners], axis=0)
        high = np.max([c.max(axis=0) for c in corners], axis=0)
        outside = np.linalg.norm(np.maximum(np.maximum(low - points, points - high), 0.0), axis=1)
        worst = int(outside.argmax())
        if outside[worst] > margin_m:
            raise InputError(
                where,
                f"sensor {sensors['sensor'].iloc[worst]} at {_text(points[worst])}, "
                f"{outside[worst]:.1f} m outside the scene ({_text(low)} to {_text(high)})",
                f"at most {margin_m:g} m",
                "Check the origin and the coordinate system of the sensor table.",
            )
    above = points[:, 2] - ground.height_m(points[:, :2]) if ground else np.zeros(1)
    if (above < 0).any():
        lowest = int(above.argmin())
        raise InputError(
            where,
            f"sensor {sensors['sensor'].iloc[lowest]} {-above[lowest]:.3f} m below the ground",
            f"z of at least {points[lowest, 2] - above[lowest]:g} m",
            "Raise the sensor or lower the ground.",
        )
    for surface in (one for one in surfaces if one.optics != GROUND):
        distance = surface_distance(points, surface.mesh, clearance_m)
        nearest = int(distance.argmin()) if len(distance) else 0
        if len(distance) and distance[nearest] < clearance_m:
            raise InputError(
                where,
                f"sensor {sensors['sensor'].iloc[nearest]} {1000 * distance[nearest]:.1f} mm "
                f"from {surface.optics}, in effect inside it",
                f"at least {1000 * clearance_m:g} mm",
                "Move the sensor, or check that sensors and scan share one frame.",
            )


def lifted(sensors: pd.DataFrame, ground: GroundSurface) -> pd.DataFrame:
    """Sensors that lie a little below a ground that was found in a cloud, laid upon it.

    Survey and scan agree to some centimetres. What lies deeper than `DEEPEST_M` stays, for `check`.
    """
    height = ground.height_m(sensors[["x_m", "y_m"]].to_numpy(float))
    below = (sensors["z_m"] < height + LIFT_M) & (sensors["z_m"] > height - DEEPEST_M)
    return sensors.assign(z_m=sensors["z_m"].where(~below, height + LIFT_M))


def surface_distance(points_m: np.ndarray, mesh: Mesh, within_m: float) -> np.ndarray:
    """Distance from points to the nearest triangle, where it is small.

    Parameters
    ----------
    points_m : (n, 3) float
    mesh : Mesh
    within_m : float
        Triangles further away than this are not looked at [m].

    Returns
    -------
    (n,) float64
        Exact distances [m] up to `within_m`, infinity beyond.
    """
    nearest = np.full(len(points_m), np.inf)
    if not len(points_m) or not len(mesh.faces):
        return nearest
    triangles = mesh.vertices_m[mesh.faces]
    centre = triangles.mean(axis=1)
    radius = np.linalg.norm(triangles - centre[:, np.newaxis], axis=2).max(axis=1)
    hits = cKDTree(points_m).query_ball_point(centre, radius + within_m, return_sorted=True)
    counts = np.fromiter(map(len, hits), np.int64, len(hits))
    if not counts.any():
        return nearest
    point = np.concatenate([hit for hit in hits if hit]).astype(np.int64)
    triangle = np.repeat(np.arange(len(hits)), counts)
    distance = _point_triangle(points_m[point], triangles[triangle])
    np.minimum.at(nearest, point, distance)
    return np.where(nearest <= within_m, nearest, np.inf)


def _point_triangle(p: np.ndarray, triangle: np.ndarray) -> np.ndarray:
    """Distances (n,) between points (n, 3) and triangles (n, 3, 3).

    The nearest point is the foot on the plane where that lies inside, and on an edge otherwise.
    """
    corner = [triangle[:, k] for k in range(3)]
    normal = np.cross(corner[1] - corner[0], corner[2] - corner[0])
    length = np.linalg.norm(normal, axis=1)
    unit = np.divide(normal, length[:, None], out=np.zeros_like(normal), where=length[:, None] > 0)
    inside = length > 0
    nearest = np.full(len(p), np.inf)
    for k in range(3):
        a, b = corner[k], corner[(k + 1) % 3]
        along, to_point = b - a, p - a
        inside &= np.einsum("ij,ij->i", np.cross(along, to_point), unit) >= 0
        squared = np.maximum(np.einsum("ij,ij->i", along, along), 1e-300)
        share = np.clip(np.einsum("ij,ij->i", to_point, along) / squared, 0.0, 1.0)
        nearest = np.minimum(nearest, np.linalg.norm(to_point - share[:, None] * along, axis=1))
    height = np.abs(np.einsum("ij,ij->i", p - corner[0], unit))
    return np.where(inside, height, nearest)


def _check_labels(labels: pd.Series, where: str | Path) -> None:
    if labels.empty:
        raise InputError(where, "no sensors", "at least one", "Is the file complete?")
    if (labels == "").any() or labels.isna().any():
        raise InputError(where, "a sensor without a label", "a label in each row", "Name it.")
    if labels.duplicated().any():
        raise InputError(
            where,
            f"sensor {labels[labels.duplicated()].iloc[0]} more than once",
            "each label once",
            "Remove or rename the repeated row.",
        )


def _text(point: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in point) + ") m"
