"""Where the sensors stand."""

from __future__ import annotations

from typing import Annotated

from annotated_types import Ge, Le

from dapple.config.base import FREY, Section, key


class Site(Section):
    """Where the sensors stand."""

    latitude_deg: Annotated[float, Ge(-90), Le(90)] = key(48.0009, "north", FREY)
    longitude_deg: Annotated[float, Ge(-180), Le(180)] = key(7.8003, "east", FREY)
    crs: str = key(
        "",
        "coordinate system of clouds and sensors that name none, as EPSG:25832; empty: unknown",
    )
    altitude_m: float = key(230.0, "above sea level", FREY)
    timezone: str = key("Europe/Berlin", "IANA zone of local time, for figures")
