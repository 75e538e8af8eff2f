"""Sensors against the cloud: in one frame, above the ground, within reach."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from dapple import findings
from dapple.check.cloud_facts import CloudFacts
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.scene import sensors

REACH_M = 30.0
"""Sensors stand no farther from the cloud, as `sensors.check` has it."""


def judge_sensors(
    facts: CloudFacts, path: str | Path, origin_m: np.ndarray | None, columns: dict[str, Any]
) -> tuple[dict[str, Any], list[Finding]]:
    """Numbers of a sensor table, and what is wrong with it beside the cloud.

    Parameters
    ----------
    facts : CloudFacts
    path : str or Path
        The table, world coordinates.
    origin_m : (3,) or None
        Of the tree's frame as the configuration has it; None: the cloud's own.
    columns : dict
        Options of `sensors.read` about its columns.
    """
    own = facts.cloud.origin_m
    try:
        origin = own if origin_m is None else np.asarray(origin_m, float)
        table = sensors.read(path, origin.tolist(), **columns)
    except InputError as mistake:
        return {}, [findings.of(mistake)]
    if columns.get("heights") == "above_ground":
        table = sensors.on_ground(table, facts.ground)
    places = table[sensors.POSITION].to_numpy(float)
    low, high = facts.cloud.xyz_m.min(axis=0), facts.cloud.xyz_m.max(axis=0)
    outside = np.linalg.norm(np.maximum(np.maximum(low - places, places - high), 0.0), axis=1)
    above = places[:, 2] - facts.ground.height_m(places[:, :2])
    numbers = {
        "sensors": len(table),
        "farthest_outside_m": float(outside.max()),
        "least_height_m": float(above.min()),
        "greatest_height_m": float(above.max()),
    }
    return numbers, [*_apart(table, outside, facts, path, origin_m), *_heights(table, above, path)]


def _apart(table: pd.DataFrame, outside: np.ndarray, facts: CloudFacts, path, origin_m) -> list:
    worst = int(outside.argmax())
    if outside[worst] <= REACH_M:
        return []
    world = table[sensors.POSITION].to_numpy(float)[worst]
    world = world + (facts.cloud.origin_m if origin_m is None else origin_m)
    low, high = facts.numbers["low_m"], facts.numbers["high_m"]
    remedy = (
        "Export cloud and sensors in one coordinate system; where the cloud's frame is unknown, "
        "say where its zero lies."
    )
    return [
        findings.error(
            path,
            f"sensor {table['sensor'].iloc[worst]} at {_text(world)}, {outside[worst]:,.0f} m from "
            f"the cloud ({_text(low)} to {_text(high)})",
            f"sensors within {REACH_M:g} m of the cloud",
            remedy,
            "registration:\n  origin_m: [east, north, height]",
        )
    ]


def _heights(table: pd.DataFrame, above: np.ndarray, path) -> list[Finding]:
    lowest = int(above.argmin())
    if above[lowest] >= -sensors.DEEPEST_M or above[lowest] < -REACH_M:
        return []
    return [
        findings.error(
            path,
            f"sensor {table['sensor'].iloc[lowest]} {-above[lowest]:.2f} m below the ground",
            "sensors on the ground or above it",
            "Check the heights of the table and those of the cloud.",
        )
    ]


def _text(place_m: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.2f}" for value in place_m) + ")"
