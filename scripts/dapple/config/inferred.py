"""What the files of a configuration tell of its other keys, so that these need not be written."""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from dapple.config.settings import Settings

KEEPS_SHOTS = (".ptx", ".e57")
"""Formats of which a scan is expected to know its shots that met nothing."""


def resolved(settings: Settings) -> Settings:
    """Settings in which `auto` gave way to what the files tell.

    The source is a cloud or real wood where one is named; records are a table where one is named
    and those of the virtual truth in a virtual world. The reconstructions of the default are those
    that such a source has: no truth out of the virtual world, no voxels of a cloud whose misses
    nothing tells.
    """
    source = settings.source
    if source == "auto":
        source = "cloud" if settings.cloud.path else "wood" if settings.wood_path else "virtual"
    measured = settings.measured
    if measured.kind == "auto":
        kind = "virtual" if source == "virtual" else "table" if measured.path else "none"
        measured = measured.model_copy(update={"kind": kind})
    names = settings.reconstructions
    if names == type(settings).model_fields["reconstructions"].default:
        names = tuple(name for name in names if _is_there(name, source, settings))
    return settings.model_copy(
        update={"source": source, "measured": measured, "reconstructions": names}
    )


def _is_there(name: str, source: str, settings: Settings) -> bool:
    """Whether a source has a reconstruction of the default."""
    if source == "virtual":
        return True
    cloud = settings.cloud
    knows_misses = (
        source == "wood"
        or PurePath(cloud.path).suffix.lower() in KEEPS_SHOTS
        or bool(cloud.scan_positions)
        or cloud.shots not in ("auto", "none")
    )
    if name.startswith("voxels_"):
        return knows_misses
    return name == "polygons" or (name == "surfels" and source == "cloud")
