"""What a scan did not see, made up for."""

from __future__ import annotations

from dapple.config.base import Positive, Section, key


class Corrections(Section):
    """What a scan did not see, made up for."""

    occlusion: bool = key(
        False, "add leaf polygons where coverage is poor", "after Van der Zande et al. 2008"
    )
    clumping: bool = key(False, "give voxels the effective density that light meets")
    fill_range_m: Positive = key(
        0.5, "unknown voxels are like known ones within about this distance"
    )
