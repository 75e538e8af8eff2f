"""What a real scan reached, from its shots alone."""

from collections.abc import Callable, Iterable

import numpy as np

from dapple.errors import InputError
from dapple.formats.shots import Shots
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density
from dapple.survey.correction import CLASSES, contact_frequency, coverage_classes
from dapple.survey.fill import krige
from dapple.survey.hemisphere import Beams
from dapple.survey.voxel_status import Reach, attribute
from dapple.virtual.box_grids import voxels_per_cell

LARGEST_GRID = 200_000_000


def of_shots(
    chunks: Callable[[], Iterable[Shots]],
    *,
    voxel_size_m: float = 0.1,
    cell_size_m: float = 1.0,
    range_m: float = 2.0,
    neighbours: int = 16,
) -> tuple[list[dict], dict]:
    """Coverage classes of cells, and how much canopy lies where no beam came.

    A beam counts as passing up to its last return; every return is a hit.

    Parameters
    ----------
    chunks : callable
        Gives all shots, chunk by chunk; called twice. Misses have to be among them.
    voxel_size_m, cell_size_m : float
        Edges of the voxels that are hit or passed, and of cells [m].
    range_m, neighbours
        Of `fill.krige`.

    Returns
    -------
    classes : list of dict
        `coverage_class`, `cells`, `mean_contact_frequency`, `mean_density_m2_m3`; the class
        `never` holds cells that no beam reached, with the density that they are filled with.
    summary : dict
        Sizes, and shares of canopy (plant area, filled cells included) that is unknown.
    """
    per_edge = voxels_per_cell(cell_size_m, voxel_size_m)
    low, high = _bounds(chunks())
    cells = Grid.around(np.array([low, high]), cell_size_m)
    shape = tuple(count * per_edge for count in cells.shape)
    if np.prod(shape, dtype=float) > LARGEST_GRID:
        raise InputError(
            "survey.voxel_size_m",
            f"{np.prod(shape, dtype=float):.3g} voxels",
            f"at most {LARGEST_GRID:.3g}",
            "Take larger voxels or cut the scan.",
        )
    reach = Reach.empty(shape, voxel_size_m, dtype=np.uint8)

    def followed():
        for chunk in chunks():
            add_shots(reach, chunk, cells.corner_m)
            yield chunk

    density = plant_area_density(followed(), cells, contact_voxel_m=0.0)
    hit, passed = reach.joined()
    contact, share = contact_frequency(attribute(hit, passed, 0), per_edge)
    number = coverage_classes(share)
    value = density.plant_area_density_m2_m3.values.astype(np.float64)
    error = density.standard_error_m2_m3.values.astype(np.float64)
    filled, _, is_filled = krige(
        value, error, cell_size_m=cell_size_m, range_m=range_m, neighbours=neighbours
    )
    classes = [
        {
            "coverage_class": name,
            "cells": int((number == k).sum()),
            "mean_contact_frequency": float(contact[number == k].mean()),
            "mean_density_m2_m3": float(filled[number == k].mean()),
        }
        for k, name in enumerate((*CLASSES, "never"))
        if (number == k).any()
    ]
    poor = (number >= len(CLASSES) - 1) | is_filled
    summary = {
        "n_cells": int(number.size),
        "cell_size_m": cell_size_m,
        "share_of_voxels_reached": float(share.mean()),
        "share_of_cells_never_reached": float((number == len(CLASSES)).mean()),
        "plant_area_m2": float(filled.sum() * cell_size_m**3),
        "share_of_canopy_filled": float(filled[is_filled].sum() / filled.sum()),
        "share_of_canopy_in_cells_below_20_percent": float(filled[poor].sum() / filled.sum()),
        "share_of_canopy_in_unseen_voxels": float((filled * (1 - share)).sum() / filled.sum()),
    }
    return classes, summary


def add_shots(reach: Reach, shots: Shots, corner_m: np.ndarray) -> None:
    """Follow shots with any number of returns through the grid; bit 0 is set."""
    n_returns = np.diff(shots.first)
    range_m = np.full((len(shots), max(int(n_returns.max(initial=0)), 1)), np.inf)
    shot = np.repeat(np.arange(len(shots)), n_returns)
    range_m[shot, np.arange(len(shot)) - shots.first[shot]] = shots.range_m
    bits = np.ones(len(shots), reach.hit.dtype)
    for origin in np.unique(shots.origin_m, axis=0):
        own = (shots.origin_m == origin).all(axis=1)
        reach.add(Beams(origin - corner_m, shots.direction[own], range_m[own], bits[own]))


def _bounds(chunks: Iterable[Shots]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest coordinates of all returns."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for chunk in chunks:
        shot = np.repeat(np.arange(len(chunk)), np.diff(chunk.first))
        place = chunk.origin_m[shot] + chunk.range_m[:, None] * chunk.direction[shot]
        low = np.minimum(low, place.min(axis=0, initial=np.inf))
        high = np.maximum(high, place.max(axis=0, initial=-np.inf))
    if not np.isfinite(low).all():
        raise InputError("shots", "no return", "a scan that met something", "Check the scan.")
    return low, high
