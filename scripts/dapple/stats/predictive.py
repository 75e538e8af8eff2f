"""Between which bounds a record of light is expected: the predictive interval of a simulation.

A standard error of simulated light is that of rays, or of the mean over placements of leaves: it
tells how far another simulation would differ, not how far the truth is. What a scan misses and
a reconstruction makes wrong is known only where the truth is, in virtual worlds; their errors are
tabled (`reconstruction_errors.csv`, made by `benchmarks/predictive.py`) by what every run knows:
the kind of reconstruction, and the share of the open sky's light that it lets through. In partial
shade errors are largest.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.structure.voxel_sizes import size_of

COVERAGE = 0.9
NORMAL = 1.6449
"""Half the width of an interval that holds 90 % of a normal distribution, in its deviations."""
BY_CHANCE, TRUTH = "virtual_leaves", "truth"
"""What leaves placed by chance are called in the table; the true tree, which has no such error."""
EDGES = np.array([0.0, 0.05, 0.15, 0.25, 0.4, 0.6, 0.8, 0.95, np.inf])
"""Of the classes of simulated light as a share of the open sky's."""


@dataclass(frozen=True)
class SensorError:
    """Standard deviations of what stands between light and its record.

    Attributes
    ----------
    radiation_relative : float
        Of the light above the tree, as it was measured or modelled.
    calibration_relative : float
        Of a sensor's factor.
    noise_relative, noise_umol_m2_s : float
        Of a single record: share of the light, and constant [µmol m⁻² s⁻¹].
    """

    radiation_relative: float = 0.05
    calibration_relative: float = 0.05
    noise_relative: float = 0.02
    noise_umol_m2_s: float = 2.0

    def of(self, par: np.ndarray) -> np.ndarray:
        """Standard deviation of records of this light [µmol m⁻² s⁻¹]."""
        relative = (self.radiation_relative, self.calibration_relative, self.noise_relative)
        return np.hypot(par * np.linalg.norm(relative), self.noise_umol_m2_s)


def error_table(records: pd.DataFrame) -> pd.DataFrame:
    """Errors of reconstructions in worlds whose light is known.

    Parameters
    ----------
    records : DataFrame
        `reconstruction`, `measured` (true light without noise), `simulated` and `baseline`
        [µmol m⁻² s⁻¹].

    Returns
    -------
    DataFrame
        `reconstruction`, `share` (of the open sky's light, mean of a class), `low` and `high`: the
        quantiles of true minus simulated light that hold `COVERAGE` of it, as shares of the open
        sky's; `n` records.
    """
    lit = records[records["baseline"] > 0].reset_index(drop=True)
    share = lit["simulated"] / lit["baseline"]
    error = (lit["measured"] - lit["simulated"]) / lit["baseline"]
    tail = (1 - COVERAGE) / 2
    rows = [
        {
            "reconstruction": name,
            "share": share[rows].mean(),
            "low": error[rows].quantile(tail),
            "high": error[rows].quantile(1 - tail),
            "n": len(rows),
        }
        for (name, _), rows in lit.groupby(
            ["reconstruction", np.digitize(share, EDGES)]
        ).groups.items()
    ]
    return pd.DataFrame(rows)


def interval(
    records: pd.DataFrame,
    errors: pd.DataFrame,
    sensor: SensorError,
    *,
    leaves_by_chance: bool = False,
) -> pd.DataFrame:
    """Bounds between which 90 % of records are expected.

    Parameters
    ----------
    records : DataFrame
        `reconstruction`, `simulated` and `baseline` [µmol m⁻² s⁻¹].
    errors : DataFrame
        As `error_table` makes it.
    sensor : SensorError
    leaves_by_chance : bool
        Leaves stand along real wood by chance, whatever light meets then: errors are those of
        virtual leaves.

    Returns
    -------
    DataFrame
        `low` and `high` [µmol m⁻² s⁻¹], with the index of `records`; NaN where errors of a
        reconstruction are not known.

    Notes
    -----
    Errors of the reconstruction (which hold those of rays and placements) and of records are
    independent: the distances of the bounds from the simulated light add in squares.
    """
    bounds = pd.DataFrame(np.nan, index=records.index, columns=["low", "high"])
    for name, rows in records.groupby("reconstruction"):
        par, open_sky = rows["simulated"].to_numpy(), rows["baseline"].to_numpy()
        share = np.divide(par, open_sky, out=np.zeros_like(par), where=open_sky > 0)
        known = BY_CHANCE if leaves_by_chance else _like(str(name), set(errors["reconstruction"]))
        own = errors[errors["reconstruction"] == known]
        if not len(own) and name != TRUTH:
            continue
        low, high = (
            open_sky * (np.interp(share, own["share"], own[end]) if len(own) else 0.0)
            for end in ("low", "high")
        )
        noise = NORMAL * sensor.of(par)
        bounds.loc[rows.index, "low"] = np.maximum(par - np.hypot(np.minimum(low, 0), noise), 0)
        bounds.loc[rows.index, "high"] = par + np.hypot(np.maximum(high, 0), noise)
    return bounds


def _like(name: str, tabled: set[str]) -> str:
    """The tabled reconstruction that one is like: voxels of the nearest size."""
    if not name.startswith("voxels_"):
        return name
    sizes = sorted(other for other in tabled if other.startswith("voxels_"))
    return min(sizes, key=lambda other: abs(np.log(size_of(other) / size_of(name))), default=name)
