"""External programs."""

from __future__ import annotations

from dapple.config.base import Section, key


class Tools(Section):
    """External programs; a bare name is looked up on the PATH and in .tools."""

    pdal: str = key("pdal", "PDAL")
    cloudcompare: str = key("CloudCompare", "CloudCompare")
