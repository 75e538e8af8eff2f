"""Keys of earlier versions, taken for what they are called now: old configurations still run."""

from __future__ import annotations

from typing import Any

from dapple.errors import InputError

STUDIES = ("survey", "chlorophyll", "stability")
"""Sections that had a switch `enabled`, now one key: `study`."""


def renewed(config: dict[str, Any], where: str) -> dict[str, Any]:
    """A configuration with today's keys.

    Raises
    ------
    InputError
        Two studies are switched on.
    """
    new, chosen = dict(config), []
    for study in STUDIES:
        section = config.get(study)
        if isinstance(section, dict) and isinstance(section.get("enabled"), bool):
            new[study] = {key: value for key, value in section.items() if key != "enabled"}
            chosen += [study] if section["enabled"] else []
    if len(chosen) > 1:
        raise InputError(
            where,
            " and ".join(f"`{study}.enabled: true`" for study in chosen),
            "one study in a run",
            f"Write `study: {chosen[0]}` instead of them.",
        )
    if chosen and config.get("study", "light") == "light":
        new["study"] = chosen[0]
    return new
