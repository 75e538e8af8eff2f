"""What is wrong, or may be, with a point cloud for what a run wants of it; each with its remedy."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from dapple import findings
from dapple.check.cloud_facts import TALLEST_M, WIDEST_M, CloudFacts, is_a_plot
from dapple.cloud import ground_finder, selection
from dapple.cloud.auto import is_decibel
from dapple.findings import Finding
from dapple.formats.clouds import Cloud
from dapple.structure import polygon_sizes

LEAST_M = 0.3
MANY_DUPLICATES = 0.01
ROUNDED_M = 0.004
"""Steps of coordinates from which on points fall on each other by themselves."""
SLENDER = 0.12
ON_GROUND = 0.9
"""Of the ground plan with points near the ground: from this share on the ground itself is there."""
OTHER_AXES = {
    "y": "y up",
    "-z": "z down",
}


def judge(facts: CloudFacts, settings: dict[str, Any], path: str | Path) -> list[Finding]:
    """All findings on a cloud, the errors first.

    Parameters
    ----------
    facts : CloudFacts
    settings : dict
        Sections of the configuration by name, as `Settings.model_dump` gives them.
    path : str or Path
        The file, for messages.
    """
    rules = (extent, up, heights, steps, spacing, reflectance, duplicates, left_out, trees)
    found = [one for rule in rules for one in rule(facts, settings, path)]
    rank = {"error": 0, "warning": 1, "note": 2}
    return sorted(found, key=lambda one: rank[one.level])


def extent(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Heights and widths are those of trees in metres."""
    across = float(facts.numbers["extent_m"][:2].max())
    height = facts.numbers["height_m"]
    if height > TALLEST_M:
        unit = "mm" if height > 1000 else "cm" if height > 500 else "ft"
        yield findings.error(
            path,
            f"points {height:,.0f} m above the ground",
            f"plants up to {TALLEST_M:g} m",
            "Name the unit of the coordinates, or remove points that lie far from the rest.",
            f"cloud:\n  unit: {unit}",
        )
    if across < LEAST_M < height:
        yield findings.error(
            path,
            f"{across:.2g} m from west to east or south to north, and {height:.1f} m of height",
            "east and north in metres",
            "These are degrees, it seems: reproject the cloud into a system in metres (pdal "
            "translate … reprojection).",
        )
    if across > WIDEST_M:
        low, high = np.quantile(
            facts.cloud.xyz_m[:: max(1, len(facts.cloud) // 100_000)], [0.001, 0.999], axis=0
        )
        core = float((high - low)[:2].max())
        yield findings.warning(
            path,
            f"{across:,.0f} m across, {core:,.0f} m without the outermost thousandth of the points",
            f"a plot of at most {WIDEST_M:,.0f} m",
            "Clip the cloud to the plot.",
        )


def up(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """A tree stands along z: it is slender below and wide above."""
    if facts.ground.found_by == "ground class" or not is_a_plot(facts.cloud.xyz_m):
        return
    some = facts.cloud.select(slice(None, None, max(1, len(facts.cloud) // 50_000)))
    above, plan = _heights_and_plan(some)
    if _cells(plan[above < 0.1 * np.quantile(above, 0.995)]) > ON_GROUND * _cells(plan):
        return
    slender = {axis: slenderness(selection.turned_up(some, axis)) for axis in OTHER_AXES}
    axis = min(slender, key=lambda one: slender[one])
    if slender[axis] < SLENDER and slenderness(some) > 2.5 * slender[axis]:
        yield findings.warning(
            path,
            f"a plant that is slender below and wide above with {OTHER_AXES[axis]}, not with z up",
            "x to the east, y to the north, z up",
            "Say which way is up, or turn the cloud.",
            f"cloud:\n  up: '{axis}'",
        )


def slenderness(cloud: Cloud) -> float:
    """Ground plan of the part from a tenth to a third of the height, over that of all."""
    above, plan = _heights_and_plan(cloud)
    top = float(np.quantile(above, 0.995))
    low = (above >= 0.1 * top) & (above < 0.33 * top)
    whole = _cells(plan[above >= 0.1 * top])
    return _cells(plan[low]) / whole if whole and low.any() else 1.0


def _heights_and_plan(cloud: Cloud) -> tuple[np.ndarray, np.ndarray]:
    """Heights above the ground [m], and the cells of the ground plan (n, 2) that points are in."""
    surface = ground_finder.find(cloud)
    above = cloud.xyz_m[:, 2] - surface.height_m(cloud.xyz_m[:, :2])
    cell = max(0.02 * float(np.ptp(cloud.xyz_m, axis=0).max()), 1e-6)
    return above, np.floor(cloud.xyz_m[:, :2] / cell).astype(np.int64)


def _cells(plan: np.ndarray) -> int:
    return len(np.unique(plan, axis=0))


def heights(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """The height of the ground that the configuration names is the one in the cloud."""
    ground = facts.numbers["ground"]
    said = settings["ground_z_m"]
    if said is None:
        if ground["found_by"] == "lowest point":
            yield findings.note(
                path, f"no ground: the lowest point, at {ground['z_m']:.2f} m, stands for it"
            )
        return
    apart = ground["z_m"] - said
    if abs(apart) <= 0.5:
        return
    level = findings.error if abs(apart) > 3.0 else findings.warning
    yield level(
        path,
        f"ground at {ground['z_m']:.2f} m ({ground['found_by']}) and `ground_z_m: {said:g}`",
        "the same height in the coordinates of the cloud",
        "Leave the key out, so that the ground is found, or correct it.",
        f"ground_z_m: {ground['z_m']:.2f}",
    )


def steps(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Coordinates are finer than the polygons that are made of them."""
    step, size = facts.numbers["step_m"], settings["polygons"]["voxel_size_m"]
    if "polygons" not in settings["reconstructions"] or not isinstance(size, float):
        return
    if step <= 0.5 * size + 1e-9:
        return
    level = findings.error if step > size + 1e-9 else findings.warning
    yield level(
        path,
        f"coordinates rounded to {step:g} m and polygons of {size:g} m",
        "coordinates at most half as coarse as the polygons",
        "Export with a finer scale (LAS: 0.001), or make larger polygons.",
        f"polygons:\n  voxel_size_m: {max(2 * step, 0.05):g}",
    )


def spacing(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Polygons hold some points each, and are no larger than they need be."""
    numbers, section = facts.numbers, settings["polygons"]
    apart, size = numbers["spacing_m"], section["voxel_size_m"]
    if "polygons" not in settings["reconstructions"] or not np.isfinite(apart):
        return
    fit = polygon_sizes.fitting(apart, numbers["fourth_neighbour_m"], section["leaf_size_m"])
    if size == polygon_sizes.AUTO:
        said = f"polygons of {100 * fit['voxel_size_m']:g} cm fit the points"
        if apart > 0.5 * fit["voxel_size_m"]:
            said += (
                f", which are {100 * apart:.1f} cm apart: too sparse for leaves of "
                f"{100 * section['leaf_size_m']:g} cm, whose area is known to its order of "
                "magnitude alone"
            )
        yield findings.note(path, said)
    elif apart > max(0.5 * size, numbers["step_m"]):
        yield findings.warning(
            path,
            f"points {100 * apart:.1f} cm apart and polygons of {100 * size:g} cm",
            "polygons at least twice as large as the distance of the points",
            "Most polygons would be made of one point or two, and their area means little; "
            f"{100 * fit['voxel_size_m']:g} cm fits.",
            "polygons:\n  voxel_size_m: auto",
        )


def reflectance(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Leaf and wood can be told by the attribute that is to tell them."""
    method = settings["classify"]["method"]
    values = facts.cloud.attributes.get("Reflectance")
    if method == "auto":
        if values is None or not is_decibel(values):
            yield findings.note(path, "no reflectance in dB: leaf and wood are told by shape")
            return
        method = "reflectance"
    if method not in ("reflectance", "mixture"):
        return
    geometry = "classify:\n  method: geometry"
    if values is None:
        there = ", ".join(sorted(facts.cloud.attributes)) or "none"
        said = "".join(f" {note}" for note in facts.source.notes if "Reflectance" in note)
        yield findings.error(
            path,
            f"no attribute 'Reflectance' (there are: {there})",
            f"calibrated reflectance, by which `classify.method: {method}` tells leaf from wood",
            "Export it from the scanner's software as an extra dimension, or tell them by shape."
            + said,
            geometry,
        )
        return
    known = facts.numbers["attributes"]["Reflectance"]
    if not is_decibel(values):
        yield findings.error(
            path,
            f"Reflectance from {known['least']:g} to {known['most']:g}, median {known['median']:g}",
            "decibels, in which leaves are at about -8 and bark at about -3",
            "Export reflectance in dB, or tell leaf from wood by shape.",
            geometry,
        )
        return
    threshold = settings["classify"]["threshold_db"]
    if method == "reflectance" and not known["least"] < threshold < known["most"]:
        yield findings.warning(
            path,
            f"all reflectances {'above' if known['least'] >= threshold else 'below'} the "
            f"threshold of {threshold:g} dB ({known['least']:.1f} to {known['most']:.1f})",
            "leaves below it and wood above",
            "Find the threshold in the data, or tell leaf from wood by shape.",
            "classify:\n  method: mixture",
        )


def duplicates(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """Points are there once."""
    twice, step = facts.numbers["duplicates"], facts.numbers["step_m"]
    if twice <= MANY_DUPLICATES * len(facts.cloud):
        return
    said = f"{twice:,} of {len(facts.cloud):,} points at exactly the place of another"
    if step >= ROUNDED_M:
        yield findings.note(path, f"{said}, coordinates being rounded to {step:g} m")
        return
    yield findings.warning(
        path, said, "each point once", "They count once. Was a scan merged twice?"
    )


def left_out(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """What was not taken is counted."""
    total = facts.source.in_file
    for reason, n in facts.source.left_out.items():
        if n:
            yield findings.note(path, f"{n:,} of {total:,} records left out: {reason}")
    for note in facts.source.notes:
        yield findings.note(path, note)


def trees(facts: CloudFacts, settings: dict, path: str | Path) -> Iterator[Finding]:
    """One tree is meant."""
    tree = settings["tree"]
    if len(facts.stems) < 2 or tree["at"] is not None or tree["id"] is not None:
        return
    yield findings.warning(
        path,
        f"{len(facts.stems)} {facts.numbers['trees_found_by']}",
        "one tree, or the choice of one",
        "All are taken for one plant. Choose one by its number or a place near its stem; its "
        "neighbours then stay as shade.",
        "tree:\n  id: 1",
    )
