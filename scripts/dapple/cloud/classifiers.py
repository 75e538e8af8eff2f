"""The ways to tell leaf from wood, by name.

A new one is a module with a function such as `all_leaf.all_leaf`, and an entry here: configuration,
rules, scripts and stability map take their choices from this table. What an entry needs is
imported when it is used, so that the configuration can be read without it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy as np

    from dapple.formats.clouds import Cloud

    Method = Callable[[Cloud, Mapping[str, Any], int], tuple[np.ndarray, dict[str, float]]]
    """From a cloud, the section `classify` of the configuration and a seed to (n,) bool, True for
    leaf, and facts for the file of scores."""


@dataclass(frozen=True)
class Classifier:
    """A way to tell leaf from wood.

    Attributes
    ----------
    summary : str
        For the documentation of the configuration.
    needs : tuple of str
        Attributes that every point must have.
    load : callable
        Imports the function.
    """

    summary: str
    needs: tuple[str, ...]
    load: Callable[[], Method]


def _as_it_can() -> Method:
    from dapple.cloud.auto import as_it_can

    return as_it_can


def _fixed_threshold() -> Method:
    from dapple.cloud.reflectance import fixed_threshold

    return fixed_threshold


def _own_threshold() -> Method:
    from dapple.cloud.reflectance import own_threshold

    return own_threshold


def _along_branches() -> Method:
    from dapple.cloud.geometry import along_branches

    return along_branches


def _learned() -> Method:
    from dapple.cloud.learned import learned

    return learned


def _all_leaf() -> Method:
    from dapple.cloud.all_leaf import all_leaf

    return all_leaf


CLASSIFIERS = {
    "auto": Classifier("reflectance where points have it in dB, else geometry", (), _as_it_can),
    "reflectance": Classifier("fixed threshold", ("Reflectance",), _fixed_threshold),
    "mixture": Classifier("threshold from the data", ("Reflectance",), _own_threshold),
    "geometry": Classifier("the course of branches", (), _along_branches),
    "learned": Classifier("shapes around a point, learned from virtual scans", (), _learned),
    "all_leaf": Classifier("none", (), _all_leaf),
}
