"""Leaf or wood by what a cloud has: reflectance in dB is surer than shape."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from dapple.cloud.geometry import along_branches
from dapple.cloud.reflectance import fixed_threshold
from dapple.formats.clouds import Cloud

USUAL_DB = (-40.0, 20.0)
"""Where the median reflectance of a cloud lies: leaves are at about -8, bark at about -3."""


def as_it_can(
    cloud: Cloud, settings: Mapping[str, Any], seed: int
) -> tuple[np.ndarray, dict[str, Any]]:
    """Tell leaf from wood by reflectance where points have it in dB, else by geometry.

    Parameters and returns are those of every classifier; `method` is among the facts.
    """
    method = chosen(cloud)
    told = along_branches if method == "geometry" else fixed_threshold
    leaf, facts = told(cloud, settings, seed)
    return leaf, {**facts, "method": method}


def chosen(cloud: Cloud) -> str:
    """The method that a cloud's attributes allow."""
    values = cloud.attributes.get("Reflectance")
    return "geometry" if values is None or not is_decibel(values) else "reflectance"


def is_decibel(values: np.ndarray) -> bool:
    """Whether values (n,) can be reflectance in dB: not all alike, their median where it may be."""
    known = values[np.isfinite(values)]
    if not len(known) or np.ptp(known) == 0:
        return False
    return bool(USUAL_DB[0] <= np.median(known) <= USUAL_DB[1])
