"""NetCDF of what sensors see of the sun."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr

from dapple.formats import netcdf
from dapple.light.visibility import Sunlit

AXES = ("placement", "sensor", "time")
ABOUT = {
    "share": "share of the sun's disc that is seen; with voxels the transmittance",
    "standard_error": "standard error of it",
    "n_rays": "shadow rays in each replicate",
}
IDENTITY = "what the sensor's light depends on, as a number"


@dataclass(frozen=True)
class Suns:
    """What n sensors see of the sun at t times, for each of p placements of leaves.

    Attributes
    ----------
    share, standard_error : (p, n, t) float64
        As in `visibility.Sunlit`, the mean of the replicates.
    n_rays : (p, n, t) int64
    """

    share: np.ndarray
    standard_error: np.ndarray
    n_rays: np.ndarray

    @classmethod
    def from_placements(cls, placements: Sequence[Sunlit]) -> "Suns":
        """Of one placement after the other."""
        return cls(
            np.stack([seen.share.mean(axis=0) for seen in placements]),
            np.stack([seen.standard_error for seen in placements]),
            np.stack([seen.n_rays for seen in placements]),
        )

    @property
    def placements(self) -> list[Sunlit]:
        """What is seen with each of them."""
        return [
            Sunlit(share[None], error, n_rays)
            for share, error, n_rays in zip(
                self.share, self.standard_error, self.n_rays, strict=True
            )
        ]

    def of(self, sensors: np.ndarray) -> "Suns":
        """Of the sensors with these numbers, in their order."""
        return Suns(*(getattr(self, name)[:, sensors] for name in ABOUT))

    @classmethod
    def joined(cls, parts: Sequence["Suns"]) -> "Suns":
        """Of the sensors of all parts, one part after the other."""
        return cls(
            *(np.concatenate([getattr(part, name) for part in parts], axis=1) for name in ABOUT)
        )


def write(path: str | Path, suns: Suns, identities: np.ndarray) -> None:
    """Write what sensors see of the sun, whole or not at all."""
    dataset = xr.Dataset(
        {
            name: (AXES, getattr(suns, name), {"units": "1", "long_name": text})
            for name, text in ABOUT.items()
        }
        | {"identity": ("sensor", identities, {"units": "1", "long_name": IDENTITY})}
    )
    netcdf.store(path, dataset, {name: {"zlib": True, "complevel": 1} for name in ABOUT})


def read(path: str | Path) -> tuple[np.ndarray, Suns]:
    """Read identities of sensors and what they see of the sun, as `write` writes it.

    Raises
    ------
    InputError
        No such file, or one of another kind.
    """
    dataset = netcdf.read(path, [*ABOUT, "identity"])
    return dataset["identity"].to_numpy(), Suns(*(dataset[name].to_numpy() for name in ABOUT))
