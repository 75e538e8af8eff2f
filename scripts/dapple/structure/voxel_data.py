"""What datasets of voxels hold: the names of their variables, and what flags say."""

import xarray as xr

DENSITY = "plant_area_density_m2_m3"
ESTIMATED = "plant_area_density_estimated_m2_m3"
"""What was estimated, where `DENSITY` is corrected to what light meets."""
NOT_REACHED, TOO_FEW_SHOTS, CAPPED = 1, 2, 4
"""Bits of the variable `flag`."""


def as_estimated(voxels: xr.Dataset) -> xr.Dataset:
    """Voxels with the density that was estimated, whether they were corrected or not."""
    if ESTIMATED not in voxels:
        return voxels
    return voxels.assign({DENSITY: voxels[ESTIMATED]}).drop_vars(ESTIMATED)
