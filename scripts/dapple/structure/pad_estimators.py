"""The estimators of plant area density, by name.

A new one is a function of the sums of all voxels, such as those in `densities`, and an entry here:
configuration, voxel files and tables take their names from this table. What an entry needs is
imported when it is used, so that the configuration can be read without it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

    from dapple.structure.voxel_sums import Sums

    Method = Callable[[Sums], np.ndarray | None]
    """From sums to (v,) plant area density [m² m⁻³], not yet capped; None where they lack what it
    needs."""


@dataclass(frozen=True)
class Estimator:
    """A way to estimate plant area density.

    Attributes
    ----------
    summary : str
        For the documentation of the configuration.
    load : callable
        Imports the function.
    """

    summary: str
    load: Callable[[], Method]


def _transmittance() -> Method:
    from dapple.structure.densities import transmittance

    return transmittance


def _ppl() -> Method:
    from dapple.structure.densities import ppl

    return ppl


def _fpl() -> Method:
    from dapple.structure.densities import fpl

    return fpl


def _fpl_biased() -> Method:
    from dapple.structure.densities import fpl_biased

    return fpl_biased


def _contact_frequency() -> Method:
    from dapple.structure.densities import contact_frequency

    return contact_frequency


ESTIMATORS = {
    "transmittance": Estimator("Beer-Lambert", _transmittance),
    "ppl": Estimator("likelihood of potential path lengths", _ppl),
    "fpl": Estimator("likelihood of free path lengths, corrected for bias", _fpl),
    "fpl_biased": Estimator("the same as it is", _fpl_biased),
    "contact_frequency": Estimator("Hosoi and Omasa's share of sub-voxels", _contact_frequency),
}
