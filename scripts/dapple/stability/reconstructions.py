"""What the stability map rebuilds from a scan: the names alone, which the configuration knows."""

from collections.abc import Iterable, Sequence

from dapple.errors import InputError
from dapple.structure.voxel_sizes import name_of


def names(sizes_m: Sequence[float]) -> list[str]:
    """Reconstructions for these sizes of voxels, the truth left out."""
    scanned = ["polygons", *(name_of(size) for size in sizes_m)]
    return [*scanned, "surfels", "virtual_leaves", *(f"{name}_corrected" for name in scanned)]


def chosen(
    wanted: Iterable[str], sizes_m: Sequence[float], where: str = "stability.reconstructions"
) -> list[str]:
    """The reconstructions that are wanted; empty: all.

    Raises
    ------
    InputError
        One that there is not.
    """
    known = names(sizes_m)
    if unknown := set(wanted) - set(known):
        raise InputError(
            where,
            ", ".join(f"`{name}`" for name in sorted(unknown)),
            f"some of {', '.join(known)}",
            "Choose among these; voxels are named after voxels.sizes_m.",
        )
    return list(wanted) or known
