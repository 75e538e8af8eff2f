"""A rough canopy from an airborne cloud: enough to choose where to scan from the ground."""

import numpy as np

from dapple.errors import InputError


def canopy_density(
    xy_m: np.ndarray,
    height_m: np.ndarray,
    weight: np.ndarray,
    *,
    cell_size_m: float = 1.0,
    projection: float = 0.5,
    understorey_m: float = 0.5,
) -> tuple[np.ndarray, np.ndarray]:
    """Plant area density from the share of vertical pulses that each layer stops.

    Parameters
    ----------
    xy_m : (n, 2) float64
        Returns, local frame [m].
    height_m : (n,) float64
        Their height above the ground [m]; up to `understorey_m` they are taken for ground.
    weight : (n,) float64
        Share of its pulse that a return stands for: 1 over the pulse's number of returns.
    cell_size_m : float
        Edge of the cubic cells [m].
    projection : float
        Mean projection G of a leaf on the level.

    Returns
    -------
    density_m2_m3 : (nx, ny, nz) float64
        Never NaN: cells that no pulse reached count as empty.
    corner_m : (2,) float64
        Lower corner of the grid, local frame [m]; heights begin at 0.

    Raises
    ------
    InputError
        No return above the understorey.

    Notes
    -----
    MacArthur and Horn (1969), Ecology 50, 802, column by column. Pulses are taken as vertical and
    a return as stopping its share of the pulse, so that the density of lower layers is uncertain.
    """
    if not (height_m > understorey_m).any():
        raise InputError(
            "survey.canopy", f"no return higher than {understorey_m:g} m",
            "a canopy above the ground", "Check that the cloud holds vegetation.",
        )  # fmt: skip
    corner_m = np.floor(xy_m.min(axis=0) / cell_size_m) * cell_size_m
    column = np.floor((xy_m - corner_m) / cell_size_m).astype(int)
    is_canopy = height_m > understorey_m
    layer = np.where(is_canopy, np.floor(height_m / cell_size_m).astype(int) + 1, 0)
    shape = (*(column.max(axis=0) + 1), layer.max() + 1)
    energy = np.zeros(shape)
    np.add.at(energy, (*column.T, layer), weight)
    leaving = np.cumsum(energy, axis=2) - energy  # what goes on below each layer
    share = np.divide(leaving, leaving + energy, out=np.ones(shape), where=leaving + energy > 0)
    # a layer that let nothing through is only known to be dense: as if half a pulse had passed
    share = np.maximum(share, 0.5 / np.maximum(leaving + energy, 1))
    return (-np.log(share) / (projection * cell_size_m))[:, :, 1:], corner_m
