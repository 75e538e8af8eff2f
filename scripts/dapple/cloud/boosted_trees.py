"""Gradient-boosted trees as plain arrays: a model that a file can hold without code in it."""

from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from zipfile import BadZipFile

import numba
import numpy as np

from dapple.errors import InputError
from dapple.formats.atomic import atomic

LEAF = -1
"""In `feature`: a node at which a tree ends."""


@dataclass(frozen=True)
class BoostedTrees:
    """The sum of what many small trees say.

    Attributes
    ----------
    baseline : (1,) float32
        Log odds before any tree speaks.
    root : (t,) int32
        First node of every tree.
    feature : (k,) int16
        Which feature a node asks for, or `LEAF`.
    threshold : (k,) float32
        Rows whose feature is at most this go to `left`, others and unknown ones to `right`.
    left, right : (k,) int32
        Nodes.
    value : (k,) float32
        What a leaf adds to the log odds.
    """

    baseline: np.ndarray
    root: np.ndarray
    feature: np.ndarray
    threshold: np.ndarray
    left: np.ndarray
    right: np.ndarray
    value: np.ndarray

    def log_odds(self, rows: np.ndarray) -> np.ndarray:
        """(n,) float64 log odds of rows (n, f) float32."""
        arrays = (self.root, self.feature, self.threshold, self.left, self.right, self.value)
        return _log_odds(np.ascontiguousarray(rows, np.float32), *arrays) + self.baseline[0]


def write(path: str | Path, models: Mapping[str, BoostedTrees]) -> None:
    """Write models by name to a `.npz` file, the same bytes for the same models."""
    arrays = {
        f"{name}.{field.name}": getattr(model, field.name)
        for name, model in models.items()
        for field in fields(BoostedTrees)
    }
    with atomic(path) as part, Path(part).open("wb") as file:
        np.savez_compressed(file, **arrays)


def read(path: str | Path, name: str) -> BoostedTrees:
    """Read one of the models of a file.

    Raises
    ------
    InputError
        The file is no such file or has no such model. What is not an array of numbers is not
        loaded: a file cannot bring code.
    """
    names = [field.name for field in fields(BoostedTrees)]
    try:
        with np.load(path, allow_pickle=False) as file:
            known = sorted({key.partition(".")[0] for key in file})
            arrays = [file[f"{name}.{one}"] for one in names] if name in known else []
    except (OSError, ValueError, KeyError, AttributeError, BadZipFile) as error:
        raise InputError(
            str(path),
            str(error) or type(error).__name__,
            "a model: arrays of numbers as the rule leaf_wood_model writes them",
            "Train it again.",
        ) from error
    if name not in known:
        raise InputError(str(path), f"models {', '.join(known)}", name, "Train it again.")
    return BoostedTrees(*arrays)


@numba.njit(cache=True, parallel=True)
def _log_odds(rows, root, feature, threshold, left, right, value):
    found = np.zeros(len(rows))
    for i in numba.prange(len(rows)):
        for start in root:
            node = start
            while feature[node] >= 0:
                is_low = rows[i, feature[node]] <= threshold[node]
                node = left[node] if is_low else right[node]
            found[i] += value[node]
    return found
