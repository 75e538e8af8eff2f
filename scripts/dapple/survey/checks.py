"""Settings of a survey that contradict each other, found before anything runs."""

from dapple.errors import InputError
from dapple.survey import designs
from dapple.survey.hemisphere import Hemisphere
from dapple.survey.shadow import voxels_per_cell
from dapple.virtual.stands import grid_shape


def check(
    *,
    stands: tuple[str, ...],
    leaf_area_index: tuple[float, ...],
    volume_m: tuple[float, float, float],
    voxel_size_m: float,
    cell_size_m: float,
    design_names: tuple[str, ...],
    positions_m: tuple[tuple[float, float], ...],
    height_m: float,
    density_step_deg: float,
    scanner: dict,
) -> None:
    """Raise an `InputError` that names the first key that does not fit the others."""
    if len(stands) != len(leaf_area_index) or not stands:
        raise InputError(
            "survey.leaf_area_index",
            f"{len(leaf_area_index)} values for {len(stands)} stands",
            "one for each stand, and at least one stand",
            "Complete the shorter list.",
        )
    for edge_m in (voxel_size_m, cell_size_m):
        grid_shape(volume_m, edge_m)
    voxels_per_cell(cell_size_m, voxel_size_m)
    hemisphere = Hemisphere(**scanner)
    if density_step_deg not in hemisphere.azimuth_steps_deg:
        raise InputError(
            "survey.density_step_deg",
            f"{density_step_deg:g}°",
            f"one of survey.azimuth_steps_deg: {list(hemisphere.azimuth_steps_deg)}",
            "Density is estimated from the beams of one of these scans.",
        )
    if "single" not in design_names:
        raise InputError(
            "survey.designs",
            ", ".join(design_names) or "none",
            "`single` among them",
            "The planner starts from its scan.",
        )
    for name in design_names:
        places = designs.positions(name, volume_m, height_m, positions_m)
        hemisphere.n_azimuth(len(places))
        if (places < 0).any() or (places > volume_m).any():
            raise InputError(
                "survey.positions_m",
                f"a scanner outside the volume of {list(volume_m)} m",
                "positions inside",
                "Move it, or enlarge survey.volume_m.",
            )
