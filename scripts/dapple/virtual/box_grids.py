"""Voxels that fill a box, and cells that fill with voxels: one size divides the other."""

from collections.abc import Sequence

from dapple.errors import InputError


def grid_shape(size_m: Sequence[float], voxel_size_m: float) -> tuple[int, ...]:
    """Voxels along each edge of a box.

    Raises
    ------
    InputError
        The voxels do not fill the box exactly.
    """
    count = [float(edge) / voxel_size_m for edge in size_m]
    if any(n < 0.5 or abs(n - round(n)) > 1e-6 + 1e-5 * n for n in count):
        raise InputError(
            "survey.voxel_size_m",
            f"{voxel_size_m:g} m in a box of {' x '.join(f'{s:g}' for s in size_m)} m",
            "a size that divides every edge",
            "Choose voxels and volume so that one divides the other.",
        )
    return tuple(round(n) for n in count)


def voxels_per_cell(cell_size_m: float, voxel_size_m: float) -> int:
    """Voxels along the edge of a cell.

    Raises
    ------
    InputError
        One does not divide the other.
    """
    ratio = cell_size_m / voxel_size_m
    if ratio < 1 or abs(ratio - round(ratio)) > 1e-6:
        raise InputError(
            "survey.cell_size_m",
            f"{cell_size_m:g} m with voxels of {voxel_size_m:g} m",
            "a multiple of survey.voxel_size_m",
            f"Contact frequency counts the voxels in a cell: take {5 * voxel_size_m:g}.",
        )
    return round(ratio)
