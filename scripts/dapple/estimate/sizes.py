"""How large a run is: the numbers that its time and memory grow with.

The standard library alone, as in `planned`. Sizes are known before anything is computed: of virtual
scans from the geometry of scanner and crown, of clouds from the headers of their files.
"""

import math
import struct
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

from dapple.clock import time_range

if TYPE_CHECKING:
    from dapple.config.settings import Settings

ONE = "one"
POINTS_A_SHOT, KEPT_OF_CROWN = 0.53, 0.42
"""Points of a virtual scan, ground included, and those left of shots at the crown."""
BYTES_A_POINT = {".laz": 12, ".e57": 20, ".ptx": 35, ".ply": 20, ".pcd": 16}
TEXT_BYTES = 35
MAP_CELLS = 16_000
"""More cells no ground map has."""
LOWEST_SUN_DEG = 15.0
FIRST_BYTES = 4096
"""Enough of a text for the length of its lines."""


def sizes(settings: "Settings") -> dict[str, float]:
    """Sizes of a run.

    Returns
    -------
    dict
        `points` of the scan, `kept` after cleaning, `shots`, `sensors`, `sensor_times`, those that
        the check computes again (`checked`), values of the `ground_map`; and 1 as `one`.
    """
    times = time_range(**dict(settings.time))
    shots, points, kept = _virtual(settings) if settings.source == "virtual" else _cloud(settings)
    n_sensors = _sensors(settings)
    step = max(1, round(settings.light.timestep.step_min / settings.time.step_min))
    batch = settings.light.timestep.times_per_job
    return {
        ONE: 1.0,
        "points": points,
        "kept": kept,
        "shots": shots,
        "sensors": n_sensors,
        "sensor_times": n_sensors * len(times),
        "checked": n_sensors * min(batch, -(-len(times) // step)),
        "ground_map": _map_values(settings, times),
    }


def points_of(path: Path) -> float:
    """Points of a cloud, from its header or the length of its first lines."""
    if not path.is_file():
        return 0.0
    size, suffix = path.stat().st_size, path.suffix.lower()
    with path.open("rb") as file:
        head = file.read(FIRST_BYTES)
    if head.startswith(b"LASF") and len(head) > 255:
        counted: int = struct.unpack_from("<I", head, 107)[0]
        if head[25] >= 4:
            counted = counted or struct.unpack_from("<Q", head, 247)[0]
        return float(counted)
    for line in head.split(b"\n"):
        words = line.split()
        if words[:2] == [b"element", b"vertex"] or words[:1] == [b"POINTS"]:
            return float(words[-1])
    if suffix in BYTES_A_POINT:
        return size / BYTES_A_POINT[suffix]
    lines = head.count(b"\n")
    return size * lines / len(head) if lines else size / TEXT_BYTES


def _virtual(settings: "Settings") -> tuple[float, float, float]:
    """Shots, points, and points after cleaning, of a virtual scan."""
    scan, plant = settings.scan, settings.plant
    step = math.radians(scan.angular_step_deg)
    half_m = plant.crown_radius_m + scan.window_margin_m
    near_m = max(scan.radius_m - half_m, 0.1)
    wide = 2 * math.atan2(half_m, near_m)
    up = math.atan2(plant.height_m + scan.window_margin_m - scan.height_m, near_m)
    shots = scan.positions * wide * (up + math.atan2(scan.height_m, near_m)) / step**2
    crown_m2 = 2 * plant.crown_radius_m * (plant.height_m - plant.crown_base_m)
    at_crown = scan.positions * crown_m2 / (scan.radius_m * step) ** 2
    return shots, POINTS_A_SHOT * shots, KEPT_OF_CROWN * at_crown


def _cloud(settings: "Settings") -> tuple[float, float, float]:
    points = points_of(Path(settings.data_dir) / settings.cloud.path) if settings.cloud.path else 0
    shots = 2 * points if settings.has_shots else 0.0
    return shots, points, points


def _sensors(settings: "Settings") -> float:
    if settings.sensors.kind == "table":
        path = Path(settings.data_dir) / settings.sensors.path
        return max(1.0, path.read_bytes().count(b"\n") - 1.0) if path.is_file() else 1.0
    if settings.sensors.kind == "none":
        return 0.0
    return float(settings.sensors.columns * settings.sensors.rows)


def _map_values(settings: "Settings", times: list[datetime]) -> float:
    """Cells of the ground map, over all of its hours."""
    hours = len({time.replace(minute=0) for time in times})
    if settings.source != "virtual":
        return float(MAP_CELLS * hours)
    shadow_m = settings.plant.height_m / math.tan(math.radians(45 + LOWEST_SUN_DEG / 2))
    edge_m = 2 * (settings.plant.crown_radius_m + settings.figures.map_margin_m) + 2 * shadow_m
    return min(MAP_CELLS, (edge_m / settings.figures.map_spacing_m) ** 2) * hours
