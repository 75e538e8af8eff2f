"""Write the default configuration, its schema and its documentation from the typed settings."""

import json
from collections.abc import Iterator
from pathlib import Path

import yaml
from annotated_types import Ge, Gt, Le, MinLen
from pydantic.fields import FieldInfo

from dapple.config.base import OneOf, Section
from dapple.config.settings import Settings
from dapple.formats.atomic import atomic

CONFIG = Path(__file__).parents[3] / "config"
MEND = "make docs"
SCHEMA = "# yaml-language-server: $schema=schema.json"
"""By this first line editors complete and check the keys of a file in `config/`."""


def default_yaml() -> str:
    """The default configuration as commented YAML."""
    lines = [
        SCHEMA,
        "# The default run: a virtual apple tree, scanned, rebuilt and lit.",
        f"# Every key with unit, range and source: config/README.md. Made by `{MEND}`.",
        "",
    ]
    return "\n".join([*lines, *_yaml_lines(Settings(), 0)]) + "\n"


def _yaml_lines(section: Section, depth: int) -> Iterator[str]:
    indent = "  " * depth
    for key, field in type(section).model_fields.items():
        value = getattr(section, key)
        if isinstance(value, Section):
            if depth == 0:
                yield ""
                yield f"# {_summary(value)}"
            yield f"{indent}{key}:"
            yield from _yaml_lines(value, depth + 1)
        else:
            yield f"{indent}{key}: {_scalar(value)}  # {field.description}"


def _scalar(value: object) -> str:
    plain = list(value) if isinstance(value, tuple) else value
    dumped = yaml.safe_dump(plain, default_flow_style=True, width=10_000, allow_unicode=True)
    return dumped.removesuffix("\n").removesuffix("\n...")


def _summary(section: Section) -> str:
    return (type(section).__doc__ or "").strip().splitlines()[0]


def schema() -> str:
    """The JSON schema of the configuration."""
    return json.dumps(Settings.model_json_schema(), indent=1, ensure_ascii=False) + "\n"


def readme() -> str:
    """The documentation of every key as Markdown."""
    rows = [
        "# Configuration",
        "",
        "A run merges `config/config.yaml` (the defaults below) with the file given as",
        "`--configfile` and with `--config key=value`. A file needs only the keys that differ. The",
        "merged configuration is written to `results/{experiment}/config.yaml`. Units are part of",
        "the names.",
        "",
        "Editors with a YAML language server complete and check keys in a file here that begins",
        f"with `{SCHEMA}`.",
        "",
        "This page, `config.yaml` and `schema.json` are made from `scripts/dapple/config/` by",
        f"`{MEND}`.",
        "",
    ]
    return "\n".join([*rows, *_tables(Settings(), "", "General")]) + "\n"


def _tables(section: Section, prefix: str, title: str) -> Iterator[str]:
    """One table for a section, then those of the sections in it."""
    fields = type(section).model_fields
    yield f"## {title}"
    yield ""
    yield (type(section).__doc__ or "").strip()
    yield ""
    plain = [key for key in fields if not isinstance(getattr(section, key), Section)]
    if plain:
        yield "| key | default | range | meaning | source |"
        yield "|---|---|---|---|---|"
    for key in plain:
        field, value = fields[key], _scalar(getattr(section, key)).replace("|", "\\|")
        told = field.json_schema_extra
        source = told.get("source", "") if isinstance(told, dict) else ""
        yield f"| `{prefix}{key}` | `{value}` | {_range(field)} | {field.description} | {source} |"
    yield ""
    for key in fields:
        if isinstance(value := getattr(section, key), Section):
            yield from _tables(value, f"{prefix}{key}.", f"`{prefix}{key}`")


def _range(field: FieldInfo) -> str:
    """The allowed values of a key, in words."""
    signs = {Ge: ("ge", "≥"), Gt: ("gt", ">"), Le: ("le", "≤")}
    limits = [
        f"{signs[type(limit)][1]} {getattr(limit, signs[type(limit)][0])}"
        for limit in field.metadata
        if type(limit) in signs
    ]
    if any(isinstance(limit, MinLen) for limit in field.metadata):
        limits.append("not empty")
    named = [one.names for one in field.metadata if isinstance(one, OneOf)]
    choices = named[0] if named else getattr(field.annotation, "__args__", ())
    if not limits and choices and all(isinstance(choice, str | int) for choice in choices):
        return ", ".join(f"`{choice}`" for choice in choices)
    return ", ".join(limits)


def pages() -> dict[str, str]:
    """File name to content, of everything that is made here."""
    return {"config.yaml": default_yaml(), "schema.json": schema(), "README.md": readme()}


if __name__ == "__main__":
    for name, text in pages().items():
        with atomic(CONFIG / name) as partial:
            partial.write_text(text)
