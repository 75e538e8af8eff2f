"""Values of a configuration that contradict each other, or of which one needs another.

All that a configuration alone can tell is found here, before the first job; what is in files is
found by the step that reads them.
"""

from __future__ import annotations

from pathlib import PurePath
from typing import TYPE_CHECKING

from dapple import clock
from dapple.config import study_checks
from dapple.errors import InputError, MissingMissesError
from dapple.timezones import find_timezone
from dapple.virtual import plant_sizes

if TYPE_CHECKING:
    from dapple.config.settings import Settings


def check(settings: Settings, where: str) -> None:
    """Raise an `InputError` where values contradict each other or one needs another.

    Parameters
    ----------
    settings : Settings
        Each value of them valid alone.
    where : str
        The files that they come from.
    """
    for one in CHECKS:
        one(settings, where)


def reconstructions(settings: Settings, where: str) -> None:
    """Each is known, and named once."""
    known = ["polygons", *(f"voxels_{size}" for size in settings.voxels.sizes_m)]
    if settings.source != "wood":
        known.insert(1, "surfels")
    if settings.source == "virtual":
        known.append("truth")
    for name in settings.reconstructions:
        if settings.reconstructions.count(name) > 1:
            raise InputError(
                where,
                f"`reconstructions: {list(settings.reconstructions)}`",
                "each name once",
                f"Leave out one `{name}`.",
            )
        if name not in known:
            raise InputError(
                where,
                f"`reconstructions: {name}`",
                f"one of {', '.join(known)} (source: {settings.source})",
                "Voxel reconstructions are named after voxels.sizes_m; truth exists in virtual "
                "worlds only.",
            )


def paths(settings: Settings, where: str) -> None:
    """A file is named wherever one is read."""
    needed = {
        "source: wood": ("wood_path", settings.source == "wood", settings.wood_path),
        "source: cloud": ("cloud.path", settings.source == "cloud", settings.cloud.path),
    }
    for name in ("radiation", "sensors", "measured"):
        section = getattr(settings, name)
        needed[f"{name}.kind: table"] = (f"{name}.path", section.kind == "table", section.path)
    radiation, sensors = settings.radiation, settings.sensors
    is_table = sensors.response == "table"
    needed["sensors.response: table"] = ("sensors.response_table", is_table, sensors.response_table)
    is_measured = radiation.sky == "measured"
    needed["radiation.sky: measured"] = ("radiation.sky_table", is_measured, radiation.sky_table)
    for reason, (key, is_read, path) in needed.items():
        if is_read and not path:
            raise InputError(
                where,
                f"`{reason}` and no `{key}`",
                "a file, relative to data_dir",
                f"Set `{key}`.",
            )


def misses(settings: Settings, where: str) -> None:
    """Plant area density needs every shot that was fired, those without a return too."""
    cloud = settings.cloud
    if settings.source != "cloud":
        return
    wanted = [name for name in settings.reconstructions if name.startswith("voxels_")]
    if wanted and cloud.shots == "none":
        raise MissingMissesError(
            where,
            f"`reconstructions: {wanted[0]}` and `cloud.shots: none`",
            f"the shots of {cloud.path} that met nothing: plant area density has no denominator "
            "without them",
            "Set cloud.shots to `auto`, or leave voxels out of the reconstructions.",
        )
    keepers = (".ptx", ".e57", ".ply", ".txt", ".xyz", ".csv")
    if cloud.shots == "recorded" and PurePath(cloud.path).suffix.lower() not in keepers:
        raise InputError(
            where,
            f"`cloud.shots: recorded` and `cloud.path: {cloud.path}`",
            "PTX, a structured E57, a ray cloud (PLY) or a table of shots: other formats keep no "
            "misses",
            "Export the scan as one of these, or set cloud.shots to `auto`.",
        )
    if cloud.shots == "positions" and not cloud.scan_positions:
        raise InputError(
            where,
            "`cloud.shots: positions` and no `cloud.scan_positions`",
            "a table of the places where the scanner stood",
            "Set `cloud.scan_positions`.",
        )


def tree(settings: Settings, where: str) -> None:
    """A tree is chosen in one way, out of a cloud."""
    chosen = settings.tree
    if chosen.id is not None and chosen.at is not None:
        raise InputError(
            where,
            f"`tree.id: {chosen.id}` and `tree.at: {list(chosen.at)}`",
            "one of them",
            "Leave one out.",
        )
    if settings.source != "cloud" and (chosen.id is not None or chosen.at is not None):
        raise InputError(
            where,
            f"`tree` and `source: {settings.source}`",
            "`source: cloud`: a virtual tree stands alone",
            "Leave the section out.",
        )


def corrections(settings: Settings, where: str) -> None:
    """What the scan did not see is known from its shots."""
    wanted = [name for name in ("occlusion", "clumping") if getattr(settings.corrections, name)]
    if wanted and settings.source == "cloud" and settings.cloud.shots == "none":
        raise MissingMissesError(
            where,
            f"`corrections.{wanted[0]}: true` and `cloud.shots: none`",
            "shots, from which coverage is known",
            "Set cloud.shots to `auto`, or turn the correction off.",
        )
    if settings.corrections.occlusion and settings.source == "wood":
        raise InputError(
            where,
            "`corrections.occlusion: true` and `source: wood`",
            "polygons of scanned leaves; those along real wood are virtual",
            "Turn the correction off.",
        )


def measured(settings: Settings, where: str) -> None:
    """Virtual records need a virtual truth."""
    if settings.measured.kind == "virtual" and settings.source != "virtual":
        raise InputError(
            where,
            "`measured.kind: virtual`",
            "`table` or `none` where the source is not virtual",
            "Give the records in measured.path or compute light without comparison.",
        )


def registration(settings: Settings, where: str) -> None:
    """A fit needs surveyed sensors and their records; a gain is fitted."""
    if not settings.registration.fit:
        if settings.registration.gain != "none":
            raise InputError(
                where,
                f"`registration.gain: {settings.registration.gain}` and `registration.fit: false`",
                "`gain: none`, or `fit: true`",
                "A gain is fitted on the records of the fitting sensors.",
            )
        return
    for key, kind in (("sensors", settings.sensors.kind), ("measured", settings.measured.kind)):
        if kind != "table":
            raise InputError(
                where,
                f"`registration.fit: true` and `{key}.kind: {kind}`",
                f"`{key}.kind: table`: the fit needs surveyed sensors and their records",
                f"Give the file in {key}.path or set registration.fit to false.",
            )


def spectra(settings: Settings, where: str) -> None:
    """A spectrum has a reflectance for each of its wavelengths."""
    for name, spectrum in (("bark", settings.optics.bark), ("ground", settings.optics.ground)):
        if len(spectrum.wavelength_nm) != len(spectrum.reflectance):
            raise InputError(
                where,
                f"`optics.{name}` with {len(spectrum.wavelength_nm)} wavelengths and "
                f"{len(spectrum.reflectance)} reflectances",
                "as many of one as of the other",
                "Complete the shorter list.",
            )


def light(settings: Settings, where: str) -> None:
    """Advice and tiles are for the transport engine; LESS has sensors that are plates."""
    if settings.light.model == "advised" and settings.light.engine != "transport":
        raise InputError(
            where,
            f"`light.model: advised` and `light.engine: {settings.light.engine}`",
            "`light.engine: transport`, which the advice is about",
            "Choose the transport engine or `light.model: full`.",
        )
    if settings.light.tiles.size_m and settings.light.engine != "transport":
        raise InputError(
            where,
            f"`light.tiles.size_m: {settings.light.tiles.size_m:g}` and "
            f"`light.engine: {settings.light.engine}`",
            "`light.engine: transport`, which alone traces tiles",
            "Choose the transport engine or `light.tiles.size_m: 0`.",
        )
    engines = (settings.light.engine, *settings.light.check_with)
    if "less" in engines and settings.sensors.response != "cosine":
        raise InputError(
            where,
            f"LESS for sensors with `sensors.response: {settings.sensors.response}`",
            "`sensors.response: cosine`, the response of a level plate",
            "Choose another engine for these sensors.",
        )


def sensors(settings: Settings, where: str) -> None:
    """A tilt says to where; the stability map has sensors of its own, which are level."""
    if not settings.sensors.tilt_deg:
        return
    if settings.sensors.kind == "grid" and settings.sensors.azimuth_deg is None:
        raise InputError(
            where,
            f"`sensors.tilt_deg: {settings.sensors.tilt_deg:g}` and no `sensors.azimuth_deg`",
            "to where the sensors lean, clockwise from north",
            "Set sensors.azimuth_deg, for example to 180 for sensors that face south.",
        )
    if settings.study == "stability":
        raise InputError(
            where,
            f"`study: stability` and `sensors.tilt_deg: {settings.sensors.tilt_deg:g}`",
            "`sensors.tilt_deg: 0`: the stability map has level sensors",
            "Remove the tilt from this configuration.",
        )


def times(settings: Settings, where: str) -> None:
    """There are times, and zones to read them in."""
    for section in ("site", "time", "radiation", "measured"):
        zone = getattr(settings, section).timezone
        if zone or section == "site":
            find_timezone(zone, f"{where}, `{section}.timezone`")
    clock.time_range(**dict(settings.time), where=f"{where}, `time`")


def voxels(settings: Settings, where: str) -> None:
    """The estimator has the sums that it needs."""
    section = settings.voxels
    if section.estimator == "contact_frequency" and section.contact_voxel_m == 0:
        raise InputError(
            where,
            "`voxels.estimator: contact_frequency` and `voxels.contact_voxel_m: 0`",
            "a size of sub-voxels, whose contacts are counted",
            "Set voxels.contact_voxel_m, for example to 0.05.",
        )


def plant(settings: Settings, where: str) -> None:
    """The virtual tree has sizes that a tree can have."""
    tree = settings.plant
    plant_sizes.check_sizes(
        tree.height_m, tree.crown_base_m, tree.crown_radius_m, tree.dbh_m, tree.leaf_area_m2
    )
    plant_sizes.check_leaves(tree.leaf_length_min_m, tree.leaf_length_max_m)


def figures(settings: Settings, where: str) -> None:
    """Sensors of a grid that are to be drawn exist; those of a table are known when it is read."""
    grid = settings.sensors
    known = {f"{row + 1}_{k + 1}" for row in range(grid.rows) for k in range(grid.columns)}
    unknown = set(settings.figures.sensors) - known
    if grid.kind == "grid" and unknown:
        raise InputError(
            where,
            f"`figures.sensors: {sorted(unknown)}`",
            f"labels of the grid, from 1_1 to {grid.rows}_{grid.columns} (row_column)",
            "Choose among these, or leave the list empty.",
        )


CHECKS = (
    tree,
    reconstructions,
    paths,
    misses,
    corrections,
    measured,
    registration,
    times,
    spectra,
    light,
    sensors,
    voxels,
    plant,
    figures,
    study_checks.survey,
    study_checks.survey_beams,
    study_checks.chlorophyll,
    study_checks.own_plot,
    study_checks.stability,
)
