"""The PAR sensors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

from dapple.config.base import FREY, Count, NotNegative, Positive, Section, key
from dapple.optics import responses

if TYPE_CHECKING:
    SensorResponse = str
else:
    SensorResponse = Literal[(*responses.NAMED, "table")]


class Sensors(Section):
    """Horizontal PAR sensors."""

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
            include={"sensor_column", "x_column", "y_column", "z_column", "decimal"}
        )

    def grid(self) -> dict[str, Any]:
        """Options of `scene.sensors.grid_around`, without its centre."""
        return self.model_dump(include={"columns", "rows", "spacing_m", "height_m"})
