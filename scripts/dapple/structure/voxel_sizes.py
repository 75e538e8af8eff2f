"""How voxel reconstructions are called, and which sizes go together."""

from collections.abc import Sequence


def name_of(size_m: float) -> str:
    """The reconstruction of voxels of a size, such as `voxels_0.2`."""
    return f"voxels_{size_m}"


def size_of(name: str) -> float:
    """Edge of the voxels of a reconstruction such as `voxels_0.2` or `voxels_0.2_corrected` [m]."""
    return float(name.split("_")[1])


def finer_than(size_m: float, sizes_m: Sequence[float]) -> float | None:
    """The finest of some sizes, if voxels of `size_m` hold a whole number of its voxels [m]."""
    finest = min(sizes_m)
    ratio = size_m / finest
    return finest if ratio > 1.5 and abs(ratio - round(ratio)) < 1e-6 else None
