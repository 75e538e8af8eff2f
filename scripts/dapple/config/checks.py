"""What is wrong with a configuration, in words that help: one value, or several together."""

from __future__ import annotations

import difflib
from pathlib import PurePath
from typing import TYPE_CHECKING

from pydantic import BaseModel, ValidationError

from dapple.errors import InputError, MissingMissesError
from dapple.frames import find_timezone

if TYPE_CHECKING:
    from dapple.config.settings import Settings

REMEDIES = {
    "string_type": "Put the value in quotes: YAML takes 3_7 for a number and `no` for false.",
}


def explain(error: ValidationError, settings: type[BaseModel], where: str) -> InputError:
    """The first complaint of pydantic in our own terms, unknown keys before wrong values.

    Parameters
    ----------
    error : ValidationError
    settings : type of BaseModel
        The whole configuration, for its valid keys.
    where : str
        The files that the configuration comes from.
    """
    complaints = error.errors()
    unknown = [one for one in complaints if one["type"] == "extra_forbidden"]
    first = (unknown or complaints)[0]
    key = ".".join(str(part) for part in first["loc"])
    if unknown:
        return InputError(
            where,
            f"unknown key `{key}`",
            "a key of config/README.md",
            _nearest(first["loc"], _keys(settings)),
        )
    return InputError(
        where,
        f"`{key}: {first['input']!r}`",
        first["msg"].removeprefix("Input should be "),
        REMEDIES.get(first["type"], "See config/README.md for the meaning and range of every key."),
    )


def _nearest(location: tuple[int | str, ...], keys: list[str]) -> str:
    """The key that may have been meant: in its own section, or of that name in another."""
    *parents, wrong = (str(part) for part in location)
    beside = [key for key in keys if key.split(".")[:-1] == parents]
    names = [key.rsplit(".", 1)[-1] for key in beside]
    if close := difflib.get_close_matches(wrong, names, n=1, cutoff=0.7):
        return f"Did you mean `{'.'.join([*parents, close[0]])}`?"
    if elsewhere := [key for key in keys if key.rsplit(".", 1)[-1] == wrong]:
        return f"Did you mean `{'` or `'.join(elsewhere)}`?"
    if close := difflib.get_close_matches(wrong, names, n=1, cutoff=0.4):
        return f"Did you mean `{'.'.join([*parents, close[0]])}`?"
    return f"Known keys: {', '.join(names)}."


def _keys(section: type[BaseModel], prefix: str = "") -> list[str]:
    """Every valid key, from the section down, with dots between."""
    found = []
    for name, field in section.model_fields.items():
        found.append(f"{prefix}{name}")
        if isinstance(field.annotation, type) and issubclass(field.annotation, BaseModel):
            found += _keys(field.annotation, f"{prefix}{name}.")
    return found


def check(settings: Settings, where: str) -> None:
    """Raise an `InputError` where values contradict each other or one needs another.

    Parameters
    ----------
    settings : Settings
        Each value of them valid alone.
    where : str
        The files that they come from.
    """
    for rule in (
        _reconstructions,
        _paths,
        _misses,
        _corrections,
        _measured,
        _registration,
        _timesteps,
        _spectra,
    ):
        rule(settings, where)
    for section in ("site", "time", "radiation"):
        find_timezone(getattr(settings, section).timezone, f"{where}, `{section}.timezone`")


def _reconstructions(settings: Settings, where: str) -> None:
    known = ["polygons", *(f"voxels_{size}" for size in settings.voxels.sizes_m)]
    if settings.source == "virtual":
        known.append("truth")
    for name in settings.reconstructions:
        if name not in known:
            raise InputError(
                where,
                f"`reconstructions: {name}`",
                f"one of {', '.join(known)} (source: {settings.source})",
                "Voxel reconstructions are named after voxels.sizes_m; truth exists in virtual "
                "worlds only.",
            )


def _paths(settings: Settings, where: str) -> None:
    """A file is named wherever one is read."""
    needed = {
        "source: wood": ("wood_path", settings.source == "wood", settings.wood_path),
        "source: cloud": ("cloud.path", settings.source == "cloud", settings.cloud.path),
    }
    for name in ("radiation", "sensors", "measured"):
        section = getattr(settings, name)
        needed[f"{name}.kind: table"] = (f"{name}.path", section.kind == "table", section.path)
    for reason, (key, is_read, path) in needed.items():
        if is_read and not path:
            raise InputError(
                where,
                f"`{reason}` and no `{key}`",
                "a file, relative to data_dir",
                f"Set `{key}`.",
            )


def _misses(settings: Settings, where: str) -> None:
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
            "Set cloud.shots to `recorded` (ptx keeps misses) or, for the regular frame of a "
            "single scan, to `scan_frame`; or leave voxels out of the reconstructions.",
        )
    if cloud.shots == "recorded" and PurePath(cloud.path).suffix.lower() != ".ptx":
        raise InputError(
            where,
            f"`cloud.shots: recorded` and `cloud.path: {cloud.path}`",
            "a ptx file: other formats keep no misses",
            "Export the scan as ptx, or set cloud.shots to `scan_frame` or `none`.",
        )


def _corrections(settings: Settings, where: str) -> None:
    """What the scan did not see is known from its shots."""
    wanted = [name for name in ("occlusion", "clumping") if getattr(settings.corrections, name)]
    if wanted and settings.source == "cloud" and settings.cloud.shots == "none":
        raise MissingMissesError(
            where,
            f"`corrections.{wanted[0]}: true` and `cloud.shots: none`",
            "shots, from which coverage is known",
            "Set cloud.shots to `recorded` or `scan_frame`, or turn the correction off.",
        )


def _measured(settings: Settings, where: str) -> None:
    if settings.measured.kind == "virtual" and settings.source != "virtual":
        raise InputError(
            where,
            "`measured.kind: virtual`",
            "`table` or `none` where the source is not virtual",
            "Give the records in measured.path or compute light without comparison.",
        )


def _registration(settings: Settings, where: str) -> None:
    if not settings.registration.fit:
        return
    for key, kind in (("sensors", settings.sensors.kind), ("measured", settings.measured.kind)):
        if kind != "table":
            raise InputError(
                where,
                f"`registration.fit: true` and `{key}.kind: {kind}`",
                f"`{key}.kind: table`: the fit needs surveyed sensors and their records",
                f"Give the file in {key}.path or set registration.fit to false.",
            )


def _timesteps(settings: Settings, where: str) -> None:
    """Two engines are compared at times that both have."""
    ratio = settings.light.timestep.step_min / settings.time.step_min
    if ratio > 1 and abs(ratio - round(ratio)) > 1e-9:
        raise InputError(
            where,
            f"`light.timestep.step_min: {settings.light.timestep.step_min}` and "
            f"`time.step_min: {settings.time.step_min}`",
            "the first a multiple of the second",
            "Change one of the two.",
        )


def _spectra(settings: Settings, where: str) -> None:
    for name, spectrum in (("bark", settings.optics.bark), ("ground", settings.optics.ground)):
        if len(spectrum.wavelength_nm) != len(spectrum.reflectance):
            raise InputError(
                where,
                f"`optics.{name}` with {len(spectrum.wavelength_nm)} wavelengths and "
                f"{len(spectrum.reflectance)} reflectances",
                "as many of one as of the other",
                "Complete the shorter list.",
            )


def _light(settings: Settings, where: str) -> None:
    if settings.light.model == "advised" and settings.light.engine != "transport":
        raise InputError(
            where,
            f"`light.model: advised` and `light.engine: {settings.light.engine}`",
            "`light.engine: transport`, which the advice is about",
            "Choose the transport engine or `light.model: full`.",
        )
