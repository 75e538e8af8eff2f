"""A real point cloud."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import Section, key


class CloudInput(Section):
    """A real point cloud (`source: cloud`)."""

    path: str = key("", "point cloud (las, laz, ply, e57, ptx, txt), relative to data_dir")
    unit: Literal["auto", "m", "cm", "mm", "ft", "us-ft"] = key(
        "auto", "of its coordinates; auto: as its coordinate system or header has it, else metres"
    )
    up: Literal["z", "y", "-z"] = key("z", "axis of the file that points up")
    scan_positions: str = key(
        "", "CSV of scan positions: position, x, y, z in the cloud's coordinates"
    )
    shots: Literal["auto", "none", "recorded", "scan_frame", "positions"] = key(
        "auto",
        "misses: recorded in the file, rebuilt from scan_frame or from a frame found for each of "
        "scan_positions, or not known; auto: as the file and the tables allow",
    )
