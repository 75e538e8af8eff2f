"""As `checks`, for the studies: survey, chlorophyll, stability."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dapple import clock
from dapple.config.chlorophyll import GridRange, OwnPlot
from dapple.errors import InputError
from dapple.optics.cameras import camera
from dapple.stability import stressors
from dapple.stability.reconstructions import chosen
from dapple.survey import designs
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.virtual.box_grids import grid_shape, voxels_per_cell
from dapple.virtual.stand_species import of_stand

if TYPE_CHECKING:
    from dapple.config.settings import Settings


def survey(settings: Settings, where: str) -> None:
    """Stands can be grown, scanned by every design, and divided into voxels and cells."""
    section = settings.survey
    if len(section.stands) != len(section.leaf_area_index):
        raise InputError(
            where,
            f"`survey.leaf_area_index` with {len(section.leaf_area_index)} values for "
            f"{len(section.stands)} stands",
            "one for each stand",
            "Complete the shorter list.",
        )
    for species, leaf_area_index in zip(section.stands, section.leaf_area_index, strict=True):
        of_stand(species, section.trees_m, section.volume_m, leaf_area_index)
    for edge_m in (section.voxel_size_m, section.cell_size_m):
        grid_shape(section.volume_m, edge_m)
    voxels_per_cell(section.cell_size_m, section.voxel_size_m)
    if "single" not in section.designs:
        raise InputError(
            where,
            f"`survey.designs: {list(section.designs)}`",
            "`single` among them",
            "The planner starts from its scan.",
        )
    if section.plan_scans > section.candidates**2:
        raise InputError(
            where,
            f"`survey.plan_scans: {section.plan_scans}` and `survey.candidates: "
            f"{section.candidates}`",
            f"no more scans than the {section.candidates**2} places of the candidates",
            "Take fewer scans or more candidates.",
        )


def survey_beams(settings: Settings, where: str) -> None:
    """Every scan of a design has beams, and density is estimated from one of those fired."""
    section = settings.survey
    scanner = Hemisphere(**section.scanner)
    if section.density_step_deg not in scanner.azimuth_steps_deg:
        raise InputError(
            where,
            f"`survey.density_step_deg: {section.density_step_deg:g}`",
            f"one of survey.azimuth_steps_deg: {list(scanner.azimuth_steps_deg)}",
            "Density is estimated from the beams of one of these scans.",
        )
    for name in section.designs:
        places = designs.positions(name, section.volume_m, section.height_m, section.positions_m)
        scanner.n_azimuth(len(places))
        inside = (
            all(0 <= x <= edge for x, edge in zip(place, section.volume_m, strict=True))
            for place in places
        )
        if not all(inside):
            raise InputError(
                where,
                f"`survey.positions_m` or `survey.height_m` with a scanner outside the volume of "
                f"{list(section.volume_m)} m",
                "positions inside",
                "Move it, or enlarge survey.volume_m.",
            )


def own_plot(settings: Settings, where: str) -> None:
    """A plot of the user's has its files, and a sun."""
    plot = settings.chlorophyll.user
    if "user" not in settings.chlorophyll.plots:
        return
    for name in ("lidar", "images"):
        if not getattr(plot, name):
            raise InputError(
                where,
                f"`chlorophyll.plots` with `user` and no `chlorophyll.user.{name}`",
                "LiDAR and images of the plot, relative to data_dir",
                f"Set `chlorophyll.user.{name}`.",
            )
    if plot.time:
        clock.time_range(plot.time, plot.time, 1.0, plot.timezone, f"{where}, chlorophyll.user")
    elif plot.sun_zenith_deg is None or plot.sun_azimuth_deg is None:
        raise InputError(
            where,
            "`chlorophyll.user` without the sun of its images",
            "`time` of the flight, or `sun_zenith_deg` and `sun_azimuth_deg`",
            "Set `chlorophyll.user.time` to the middle of the flight, as 2024-07-01 11:30, and "
            "`timezone` to the zone of that clock.",
        )


def chlorophyll(settings: Settings, where: str) -> None:
    """Bands tell sunlit leaves, plots hold pixels and trees, grids of leaves run upwards."""
    section = settings.chlorophyll
    names = [name for name, _, _ in section.camera_bands]
    if len(set(names)) < len(names):
        raise InputError(
            where, f"`chlorophyll.bands` named {names}", "each name once", "Rename one of them."
        )
    if "sunlit" in section.retrieval.masks:
        _ = camera(section.camera_bands).near_infrared
    for name in section.plots:
        plot = getattr(section, name)
        if isinstance(plot, OwnPlot):
            continue
        for key, pixel_m in (("images", section.images.pixel_m), (name, plot.pixel_m)):
            if pixel_m > min(plot.size_m):
                raise InputError(
                    where,
                    f"`chlorophyll.{key}.pixel_m: {pixel_m:g}` in a plot of "
                    f"{plot.size_m[0]:g} x {plot.size_m[1]:g} m",
                    "pixels smaller than the plot",
                    "Choose smaller pixels.",
                )
        if plot.dbh_m > 0.2 * plot.height_m:
            raise InputError(
                where,
                f"`chlorophyll.{name}.dbh_m: {plot.dbh_m:g}` of trees {plot.height_m:g} m high",
                "trees at least five times as high as thick",
                "Give the stem's diameter in metres.",
            )
    pairs = {"world.lcc_range_ug_cm2": section.world.lcc_range_ug_cm2}
    for key, value in section.retrieval:
        if type(section.retrieval).model_fields[key].annotation == GridRange:
            pairs[f"retrieval.{key}"] = value[:2]
    for key, (low, high) in pairs.items():
        if low > high:
            raise InputError(
                where,
                f"`chlorophyll.{key}` from {low:g} to {high:g}",
                "the least value before the greatest",
                "Exchange them.",
            )


def stability(settings: Settings, where: str) -> None:
    """What is to be made worse and rebuilt is known; the sky is one that other suns have too."""
    if settings.study == "stability" and settings.radiation.sky == "measured":
        raise InputError(
            where,
            "`study: stability` and `radiation.sky: measured`",
            "a sky model that follows the sun and the radiation",
            "Set radiation.sky to perez.",
        )
    for name in settings.stability.stressors:
        stressors.find(name, where)
    wanted, key = settings.stability.reconstructions, f"{where}, `stability.reconstructions`"
    chosen(wanted, settings.voxels.sizes_m, key)
