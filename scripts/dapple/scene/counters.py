"""What a light path counts, and how its counts fit one number."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError
from dapple.scene.scene_optics import Optics

WORD_BITS, MOST_BITS = 64, 8
KINDS = ("leaves", "opaque")
FEW = 4
"""So many counters of 8 bits fit half a word, with which kernels are faster."""


@dataclass(frozen=True)
class Counters:
    """Reflections and transmissions by each kind of leaf, then reflections by each opaque kind.

    Attributes
    ----------
    leaves, opaque : tuple of str
        Names of optics, without spaces.
    """

    leaves: tuple[str, ...]
    opaque: tuple[str, ...]

    @classmethod
    def from_attributes(cls, attributes: Mapping[str, str]) -> "Counters":
        """Counters of a file, from what `attributes` gave it."""
        return cls(*(tuple(attributes[kind].split()) for kind in KINDS))

    @property
    def attributes(self) -> dict[str, str]:
        """Names as attributes of a file."""
        return {kind: " ".join(getattr(self, kind)) for kind in KINDS}

    def __len__(self) -> int:
        return 2 * len(self.leaves) + len(self.opaque)

    @property
    def names(self) -> tuple[str, ...]:
        """What each of them counts."""
        events = [f"{leaf} {event}" for leaf in self.leaves for event in ("reflected", "passed")]
        return (*events, *(f"{name} reflected" for name in self.opaque))

    @property
    def bits(self) -> int:
        """Of one counter in the packed number."""
        return min(MOST_BITS, WORD_BITS // len(self))

    @property
    def word(self) -> np.dtype:
        """Of the packed number."""
        return np.dtype("<u4" if len(self) <= FEW else "<u8")

    def reflected(self, optics: str) -> int:
        """The counter of reflections; that of a leaf's transmissions is the next."""
        if optics in self.leaves:
            return 2 * self.leaves.index(optics)
        return 2 * len(self.leaves) + self.opaque.index(optics)

    def check(self, max_orders: int) -> None:
        """Make sure that no counter can overflow.

        Raises
        ------
        InputError
            Paths of more surfaces than one counter can tell.
        """
        if max_orders >= 1 << self.bits:
            raise InputError(
                "max_orders",
                f"{max_orders}, and {len(self.leaves)} kinds of leaves and {len(self.opaque)} of "
                "opaque surfaces",
                f"at most {(1 << self.bits) - 1} surfaces on a path",
                "Lower max_orders, or give surfaces that look alike one name of optics.",
            )

    def unpacked(self, packed: np.ndarray) -> np.ndarray:
        """Counts (k, n) uint8 of packed numbers (k,)."""
        shift = np.arange(len(self), dtype=np.uint64) * np.uint64(self.bits)
        counts = packed.astype(np.uint64)[:, None] >> shift & np.uint64((1 << self.bits) - 1)
        return counts.astype(np.uint8)

    def packed(self, counts: np.ndarray) -> np.ndarray:
        """Numbers (k,) of counts (k, n): in their order kinds of paths are sorted."""
        shift = np.arange(len(self), dtype=np.uint64) * np.uint64(self.bits)
        return (counts.astype(np.uint64) << shift).sum(axis=1, dtype=np.uint64).astype(self.word)

    def spectral_factor(self, counts: np.ndarray, optics: Optics) -> np.ndarray:
        """What is left of light after the events of a path.

        Parameters
        ----------
        counts : (k, n) uint8
            Of k kinds of paths.
        optics : Optics
            In b bands; optics that no counter names are left out.

        Returns
        -------
        (k, b) float64
            Product of (2 ρ)^reflections (2 τ)^transmissions over the kinds of leaves and
            ρ^reflections over the opaque kinds; the powers of two undo the even choice between a
            leaf's reflection and transmission.
        """
        bases = []
        for name in self.leaves:
            bases += [2 * optics.reflectance_of(name), 2 * optics.transmittance_of(name)]
        bases += [optics.reflectance_of(name) for name in self.opaque]
        factor = np.ones((len(counts), len(optics)))
        for column, base in enumerate(bases):
            powers = base ** np.arange(counts[:, column].max(initial=0) + 1)[:, None]
            factor *= powers[counts[:, column]]
        return factor

    def largest_albedo(self, optics: Optics) -> float:
        """The largest share of light that any of the surfaces sends on in any band."""
        leaves = [optics.albedo(name) for name in self.leaves]
        return max(x.max() for x in (*leaves, *(optics.reflectance_of(n) for n in self.opaque)))
