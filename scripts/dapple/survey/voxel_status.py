"""Which voxels beams hit, pass, or never reach."""

from dataclasses import dataclass

import numpy as np
from numba import njit, prange

from dapple.structure.traversal import (
    entry_and_exit,
    nearest_facet,
    next_facet,
    start_march,
)
from dapple.survey.hemisphere import Beams

N_BLOCKS = 4
"""Grids of flags that are filled side by side; joining them does not depend on threads."""

HIT, PASSED, UNSEEN = 1, 2, 3
"""What a scan knows of a voxel."""


@dataclass
class Reach:
    """Flags of every voxel; bit k belongs to the k-th scan density (or position).

    Attributes
    ----------
    size_m : float
        Edge of the voxels; the grid's corner is the origin [m].
    hit, passed : (blocks, nx, ny, nz) uint16 or uint32
        A return lies in the voxel; a beam entered by one face and left by the opposite one.
    any_face : bool
        Count beams that leave by any face as passing.
    """

    size_m: float
    hit: np.ndarray
    passed: np.ndarray
    any_face: bool = False

    @classmethod
    def empty(cls, shape, size_m: float, any_face: bool = False, dtype=np.uint16) -> "Reach":
        blocks = (N_BLOCKS, *shape)
        return cls(size_m, np.zeros(blocks, dtype), np.zeros(blocks, dtype), any_face)

    def add(self, beams: Beams, bits: np.ndarray | None = None) -> None:
        """Follow beams through the grid and set their bits."""
        bits = (beams.bits if bits is None else bits).astype(self.hit.dtype)
        _follow(beams.origin_m, beams.direction, beams.range_m, bits, self.size_m,
                self.hit, self.passed, self.any_face)  # fmt: skip

    def joined(self) -> tuple[np.ndarray, np.ndarray]:
        """Flags `hit` and `passed` (nx, ny, nz) of all blocks together."""
        return np.bitwise_or.reduce(self.hit, axis=0), np.bitwise_or.reduce(self.passed, axis=0)


def attribute(hit: np.ndarray, passed: np.ndarray, bit: int) -> np.ndarray:
    """HIT, PASSED or UNSEEN for every voxel at one density (uint8)."""
    is_hit, is_passed = hit >> bit & 1, passed >> bit & 1
    return np.where(is_hit, HIT, np.where(is_passed, PASSED, UNSEEN)).astype(np.uint8)


@njit(cache=True)
def _entry_axis(origin, direction, distance, size, shape):
    """Axis of the facet of the grid through which a ray comes in; -1 where it starts inside."""
    if distance <= 0.0:
        return -1
    best, gap = -1, np.inf
    for k in range(3):
        if direction[k] != 0.0:
            face = 0.0 if direction[k] > 0.0 else shape[k] * size
            miss = abs((face - origin[k]) / direction[k] - distance)
            if miss < gap:
                best, gap = k, miss
    return best


@njit(cache=True, parallel=True)
def _follow(origin, direction, range_m, bits, size, hit, passed, any_face):
    n_blocks, n, n_returns = len(hit), len(direction), range_m.shape[1]
    shape = np.array(hit.shape[1:])
    corner = np.zeros(3)
    for block in prange(n_blocks):
        inverse, facet, index = np.empty(3), np.empty(3), np.empty(3, np.int64)
        for i in range(block * n // n_blocks, (block + 1) * n // n_blocks):
            d, bit = direction[i], bits[i]
            distance, far = entry_and_exit(origin, d, corner, shape, size)
            following = 0
            while following < n_returns and range_m[i, following] < distance:
                following += 1
            # a beam ends at its last return; nobody knows how far it went on
            ended = following > 0 and (following == n_returns or range_m[i, following] == np.inf)
            if not distance < far or ended:
                continue
            start_march(origin, d, corner, shape, size, distance, inverse, index, facet)
            entered = _entry_axis(origin, d, distance, size, shape)
            while True:
                k = nearest_facet(facet)
                leave = facet[k]
                x, y, z = index[0], index[1], index[2]
                is_hit = following < n_returns and range_m[i, following] < leave
                if is_hit:
                    hit[block, x, y, z] |= bit
                    while following < n_returns and range_m[i, following] < leave:
                        following += 1
                    if following == n_returns or range_m[i, following] == np.inf:
                        break
                straight = entered == k or (any_face and leave - distance > 1e-9 * size)
                if straight and passed[block, x, y, z] & bit != bit:
                    passed[block, x, y, z] |= bit
                distance = max(distance, leave)
                entered = k
                index[k] += 1 if inverse[k] > 0.0 else -1
                if index[k] < 0 or index[k] >= shape[k]:
                    break
                facet[k] = next_facet(origin, inverse, corner, size, index[k], k)
