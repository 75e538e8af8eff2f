"""What the returns of shots are: leaf hits, wood, noise; and whether shots can be followed."""

from collections.abc import Callable

import numpy as np

from dapple.cloud import voxel_groups
from dapple.errors import InputError, MissingMissesError
from dapple.formats.shots import Shots
from dapple.structure.traversal import HIT, NOISE, WOOD

Kinds = Callable[[Shots], np.ndarray] | np.ndarray | None
"""A function of a chunk, an array for the returns of all chunks, or None: all are leaf hits."""

BESIDE = np.array([step for step in np.ndindex(3, 3, 3) if step != (1, 1, 1)]) - 1
"""From a voxel to the 26 around it."""


def kinds_by_place(
    points_m: np.ndarray, classes: np.ndarray, *, voxel_size_m: float, beside: bool = True
) -> Callable[[Shots], np.ndarray]:
    """Kinds of returns from a classified cloud that was filtered and thinned.

    A return is what most points of the cloud in its voxel are. Where the cloud has none, the return
    was filtered out: weak and mixed echoes, which a leaf's edge gives. Beside the plant such an
    echo still tells that the beam met something, so it is what most points in the 26 voxels around
    it are. Farther away it is noise.

    Parameters
    ----------
    points_m : (n, 3) float64
        The classified cloud in the local frame of the shots [m].
    classes : (n,)
        4 leaf, everything else wood. Where both are equal, leaf.
    voxel_size_m : float
        Edge of the voxels, as in the majority vote of the classification.
    beside : bool
        False: what was filtered out is noise beside the plant, too.

    Returns
    -------
    callable
        Gives the (m,) uint8 kinds of a chunk's returns, for `accumulate`.
    """
    points_m, classes = np.asarray(points_m, np.float64), np.asarray(classes)
    low, high = (
        np.floor(corner / voxel_size_m).astype(np.int64)
        for corner in (points_m.min(axis=0), points_m.max(axis=0))
    )

    def key(i: np.ndarray) -> np.ndarray:
        n_y, n_z = (high - low + 1)[1:]
        return ((i[:, 0] - low[0]) * n_y + i[:, 1] - low[1]) * n_z + i[:, 2] - low[2]

    voxels, votes = [], []
    for slab in voxel_groups.slabs(np.floor(points_m[:, 0] / voxel_size_m).astype(np.int64)):
        own = key(np.floor(points_m[slab] / voxel_size_m).astype(np.int64))
        found, inverse = np.unique(own, return_inverse=True)
        voxels.append(found)
        votes.append(np.bincount(inverse, np.where(classes[slab] == 4, 1.0, -1.0)))
    known, leaf_votes = np.concatenate(voxels), np.concatenate(votes)

    def ballot(at: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Whether the cloud has points in voxels, and votes for leaf less those for wood."""
        inside = ((at >= low) & (at <= high)).all(axis=1)
        place = np.minimum(np.searchsorted(known, key(at)), len(known) - 1)
        found = inside & (known[place] == key(at))
        return found, np.where(found, leaf_votes[place], 0.0)

    def kinds(chunk: Shots) -> np.ndarray:
        at = np.floor(chunk.return_xyz_m / voxel_size_m).astype(np.int64)
        found, balance = ballot(at)
        if beside:
            alone = np.flatnonzero(~found & ((at >= low - 1) & (at <= high + 1)).all(axis=1))
            for offset in BESIDE:
                near, votes = ballot(at[alone] + offset)
                found[alone] |= near
                balance[alone] += votes
        return np.where(found, np.where(balance >= 0, HIT, WOOD), NOISE).astype(np.uint8)

    return kinds


def kinds_of_chunk(kinds: Kinds, chunk: Shots, at: int) -> np.ndarray:
    """Kinds of a chunk's returns, whose first is number `at` of all."""
    if kinds is None:
        return np.zeros(len(chunk.range_m), np.uint8)
    values = kinds(chunk) if callable(kinds) else kinds[at : at + len(chunk.range_m)]
    values = np.ascontiguousarray(values, np.uint8)
    if len(values) != len(chunk.range_m) or (len(values) and values.max() > NOISE):
        raise InputError(
            "kinds",
            f"{len(values)} values up to {values.max(initial=0)}",
            f"{len(chunk.range_m)} of {HIT} (leaf), {WOOD} (wood) or {NOISE} (noise)",
            "Give one for each return of the shots.",
        )
    return values


def check_chunk(chunk: Shots) -> None:
    """Refuse shots that the traversal would follow wrongly without a word."""
    ranges, length = chunk.range_m, np.linalg.norm(chunk.direction, axis=1)
    same = np.ones(len(ranges), bool)  # of the same shot as the return before
    same[chunk.first[:-1][chunk.n_returns > 0]] = False
    if not np.isfinite(chunk.origin_m).all() or not (np.abs(length - 1) < 1e-3).all():
        found = "origins that are not finite or directions that are no unit vectors"
    elif not np.isfinite(ranges).all() or (np.diff(ranges, prepend=0.0)[same] < 0).any():
        found = "ranges that are not finite or not in ascending order within a shot"
    else:
        return
    raise InputError("shots", found, "finite numbers, near to far", "Write the shots again.")


def check_all(kinds: Kinds, n_shots: int, n_misses: int, n_returns: int, allow: bool) -> None:
    """Refuse what only shows when all shots are read."""
    if n_shots == 0:
        raise InputError("shots", "none", "at least one shot", "Check the scan's window.")
    if isinstance(kinds, np.ndarray) and len(kinds) != n_returns:
        raise InputError("kinds", f"{len(kinds)}", f"{n_returns}, one a return", "Pass them all.")
    if n_misses == 0 and not allow:
        raise MissingMissesError(
            "shots",
            f"{n_shots} shots and no miss",
            "shots without a return among them",
            "Without misses plant area density comes out several times too high. Export all pulses "
            "from the scanner's software, or let misses be rebuilt from the scanner's frame.",
        )
