"""External programs."""

from __future__ import annotations

from dapple.config.base import Name, Section, key


class Tools(Section):
    """External programs; a bare name is looked up on the PATH and in .tools."""

    pdal: Name = key("pdal", "PDAL")
    cloudcompare: Name = key("CloudCompare", "CloudCompare")
