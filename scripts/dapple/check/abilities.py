"""What every reconstruction and every study can do with the input, and what it lacks."""

from typing import Any

from dapple.check import shots_check
from dapple.check.cloud_facts import CloudFacts

AIRBORNE = "airborne"


def of(facts: CloudFacts, settings: dict[str, Any]) -> list[dict[str, Any]]:
    """One row a reconstruction or study: `what`, `able`, and `why`, in words."""
    state = shots_check.misses(facts, settings)
    spacing, points = facts.numbers["spacing_m"], facts.numbers["points"]
    dense = points >= 1000
    has_shots = state != shots_check.UNKNOWN
    shots = {
        shots_check.RECORDED: "shots that met nothing are recorded",
        shots_check.REBUILDABLE: "shots that met nothing can be rebuilt",
        shots_check.UNKNOWN: "shots that met nothing are not known: PTX, structured E57, ray "
        "clouds and shot tables keep them; scan positions or a scan frame rebuild them",
    }[state]
    sensors = settings["sensors"]["kind"] != "none"
    records = settings["measured"]["kind"] == "table"
    crs = facts.numbers["crs"]
    rows = [
        (
            "polygons",
            dense,
            f"points {100 * spacing:.1f} cm apart" if dense else f"{points} points: too few",
        ),
        (
            "surfels",
            dense,
            f"{shots}, and settle how open leaves are"
            if has_shots
            else "by the distance of points alone: shots that met nothing are not known",
        ),
        ("voxels", has_shots, shots),
        (
            "leaf and wood by reflectance",
            "Reflectance" in facts.cloud.attributes,
            "the points have reflectance"
            if "Reflectance" in facts.cloud.attributes
            else "no reflectance: leaf and wood are told by shape",
        ),
        (
            "light",
            sensors,
            "sensors are given" if sensors else "no sensors (`sensors.kind: none`)",
        ),
        (
            "comparison with records",
            sensors and records,
            "records are given" if records else "no records (`measured.kind: table`)",
        ),
        (
            "where to scan next",
            has_shots or facts.numbers["scanner"].startswith(AIRBORNE),
            shots if has_shots else "`survey: {canopy: …}` takes an airborne cloud",
        ),
        (
            "chlorophyll",
            bool(crs) and facts.numbers["scanner"].startswith(AIRBORNE),
            "an airborne cloud with a coordinate system; images are needed besides"
            if crs
            else "no coordinate system: images cannot be laid over it",
        ),
    ]
    return [{"what": what, "able": bool(able), "why": why} for what, able, why in rows]
