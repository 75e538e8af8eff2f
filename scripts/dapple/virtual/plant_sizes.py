"""Which sizes a plant can have."""

from math import isfinite

from dapple.errors import InputError

TWIG_RADIUS_M = 0.0015


def check_sizes(
    height_m: float,
    crown_base_m: float,
    crown_radius_m: float,
    dbh_m: float,
    leaf_area_m2: float,
    twig_radius_m: float = TWIG_RADIUS_M,
) -> None:
    """Raise an `InputError` that names the size that no tree can have [m, m²]."""
    sizes = {
        "height_m": height_m,
        "crown_base_m": crown_base_m,
        "crown_radius_m": crown_radius_m,
        "leaf_area_m2": leaf_area_m2,
        "twig_radius_m": twig_radius_m,
    }
    for name, size in sizes.items():
        if not (isfinite(size) and size > 0):
            raise InputError(
                f"plant.{name}", f"{size:g}", "a number above 0", "Give the size of a tree."
            )
    if height_m - crown_base_m < 0.3:
        raise InputError(
            "plant.crown_base_m",
            f"{crown_base_m:g} m in a tree of {height_m:g} m",
            "at least 0.3 m less than the height",
            "Lower the crown base (a third of the height is common) or raise the height.",
        )
    if not 4 * twig_radius_m <= dbh_m < crown_base_m:
        raise InputError(
            "plant.dbh_m",
            f"{dbh_m:g} m",
            f"{4 * twig_radius_m:g} m (twice the thickness of twigs) to {crown_base_m:g} m",
            "Give the stem's diameter in metres.",
        )


def check_leaves(
    length_min_m: float, length_max_m: float, fold_deg: float = 10.0, n_clumps: int = 1
) -> None:
    """Raise an `InputError` that names what leaves cannot be like [m, °]."""
    if not 0 < length_min_m <= length_max_m:
        raise InputError(
            "plant.leaf_length_min_m",
            f"{length_min_m:g} m, with leaf_length_max_m {length_max_m:g} m",
            "0 < leaf_length_min_m <= leaf_length_max_m",
            "Swap them or mend the units: metres.",
        )
    if not 0 <= fold_deg < 90:
        raise InputError(
            "plant.leaf_fold_deg", f"{fold_deg:g}°", "0° to below 90°", "0 makes flat leaves."
        )
    if n_clumps < 1:
        raise InputError("plant.n_clumps", f"{n_clumps}", "at least 1", "70 is usual.")
