"""One look at all input of a run, before anything is computed: what is there, and what is wrong."""

from pathlib import Path
from typing import Any

from dapple import findings
from dapple.check import abilities, cloud_facts, cloud_findings, places, shots_check
from dapple.cloud import selection, trees
from dapple.errors import InputError
from dapple.findings import Finding
from dapple.formats import clouds

COLUMNS = (
    *("sensor_column", "x_column", "y_column", "z_column", "decimal"),
    *("heights", "tilt_deg", "azimuth_deg"),
)
"""Keys of `sensors` that say how its table is read."""


def inspect(
    settings: dict[str, Any],
    *,
    cloud: str | Path = "",
    positions: str | Path = "",
    sensors: str | Path = "",
) -> dict[str, Any]:
    """Look at the files of a run.

    Parameters
    ----------
    settings : dict
        Sections of the configuration by name, as `Settings.model_dump` gives them.
    cloud, positions, sensors : path
        Files; empty where the run reads none.

    Returns
    -------
    dict
        `experiment`, `cloud`, `misses`, `sensors`, `can` and `findings` (rows of `Finding`), as far
        as there are files. A file that cannot be read is a finding, and no reason to stop looking.
    """
    found: list[Finding] = []
    check: dict[str, Any] = {"experiment": settings["experiment"]}
    facts = _cloud(cloud, settings, found) if cloud else None
    if facts is not None:
        check["cloud"] = {"path": str(cloud), **facts.numbers}
        check["misses"] = shots_check.misses(facts, settings)
        check["can"] = abilities.of(facts, settings)
        found += cloud_findings.judge(facts, settings, cloud)
        found += shots_check.judge(facts, settings, cloud, positions)
        found += _choice(facts, settings)
        if sensors:
            origin_m = settings["registration"]["origin_m"]
            columns = {k: v for k, v in settings["sensors"].items() if k in COLUMNS}
            check["sensors"], wrong = places.judge_sensors(facts, sensors, origin_m, columns)
            found += wrong
    check["findings"] = findings.rows(found)
    return check


def stop_at_errors(settings: dict[str, Any], **files: str | Path) -> None:
    """Look at the files of a run, say what may be wrong, and stop at what is, in one message.

    Raises
    ------
    InputError
        What was found wrong, all of it.
    """
    found = [Finding(**row) for row in inspect(settings, **files)["findings"]]
    findings.say(one for one in found if one.level == "warning")
    findings.stop(found)


def _cloud(
    path: str | Path, settings: dict[str, Any], found: list[Finding]
) -> cloud_facts.CloudFacts | None:
    """The facts of a cloud; None, and a finding, where it cannot be read."""
    section = settings["cloud"]
    try:
        cloud, source = selection.take(
            *clouds.read_with_source(path), path, unit=section["unit"], up=section["up"]
        )
    except InputError as mistake:
        found.append(findings.of(mistake))
        return None
    return cloud_facts.gather(cloud, source, ground_z_m=settings["ground_z_m"])


def _choice(facts: cloud_facts.CloudFacts, settings: dict[str, Any]) -> list[Finding]:
    """The tree that is named exists."""
    tree = settings["tree"]
    if tree["id"] is None and tree["at"] is None:
        return []
    try:
        trees.choose(facts.stems, facts.cloud.origin_m, at_m=tree["at"], number=tree["id"])
    except InputError as mistake:
        return [findings.of(mistake)]
    return []
