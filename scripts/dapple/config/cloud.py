"""A real point cloud."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import Section, key


class CloudInput(Section):
    """A real point cloud (`source: cloud`)."""

    path: str = key("", "point cloud (las, laz, ply, e57, ptx, txt), relative to data_dir")
    scan_positions: str = key(
        "", "CSV of scan positions: position, x, y, z in the cloud's coordinates"
    )
    shots: Literal["none", "recorded", "scan_frame"] = key(
        "none", "misses: not known, recorded in the file (ptx), or rebuilt from scan_frame"
    )
