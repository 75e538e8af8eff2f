"""The PAR sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Literal

from annotated_types import Ge, Le

from dapple.config.base import FREY, Count, NotNegative, Positive, Section, key
from dapple.optics import responses

if TYPE_CHECKING:
    SensorResponse = str
else:
    SensorResponse = Literal[(*responses.NAMED, "table")]


class Sensors(Section):
    """PAR sensors, level or tilted."""

    kind: Literal["grid", "table", "none"] = key(
        "grid", "a grid around the stem, a file, or no light"
    )
    path: str = key("", "table of labels and world coordinates, relative to data_dir")
    sensor_column: str = key("", "column of labels; empty: sensor or label")
    x_column: str = key("", "column of east; empty: x_m, x, east or easting")
    y_column: str = key("", "column of north; empty: y_m, y, north or northing")
    z_column: str = key("", "column of height; empty: z_m, z or up")
    decimal: Literal["", ".", ","] = key("", "decimal sign; empty: as the cells show")
    columns: Count = key(9, "grid: sensors from west to east")
    rows: Count = key(8, "grid: sensors from south to north")
    spacing_m: Positive = key(1.0, "grid: distance between neighbours", FREY)
    height_m: NotNegative = key(0.1, "grid: height above the ground")
    heights: Literal["world", "above_ground"] = key(
        "world", "table: heights are coordinates, or lie above the ground below each sensor"
    )
    tilt_deg: Annotated[float, Ge(0), Le(180)] = key(
        0.0, "angle of the normal from straight up, where a table has no column tilt_deg"
    )
    azimuth_deg: Annotated[float, Ge(0), Le(360)] | None = key(
        None, "to where the normal leans, clockwise from north; or a column azimuth_deg"
    )
    response: SensorResponse = key(
        "cosine",
        "light by where it comes from: cosine, all of the upper hemisphere alike, or a table",
    )
    response_table: str = key(
        "", "response: table: CSV of angle_deg from the normal, 0 to 90, and response"
    )

    def table(self) -> dict[str, Any]:
        """Options of `scene.sensors.read`, without path and origin."""
        return self.model_dump(
            include={
                "sensor_column",
                "x_column",
                "y_column",
                "z_column",
                "decimal",
                "heights",
                "tilt_deg",
                "azimuth_deg",
            }
        )

    def grid(self) -> dict[str, Any]:
        """Options of `scene.sensors.grid_around`, without its centre."""
        return self.model_dump(include={"columns", "rows", "spacing_m", "height_m"})

    def facing(self) -> dict[str, Any]:
        """Angles of the normals of a grid."""
        return self.model_dump(include={"tilt_deg", "azimuth_deg"})
