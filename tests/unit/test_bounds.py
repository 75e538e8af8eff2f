"""Every key of the configuration, in every section: values at its bounds and beyond them."""

import json
import math

import pytest

from dapple.config import docs
from dapple.config.settings import validate
from dapple.errors import InputError

SCHEMA = json.loads(docs.schema())
MAY_BE_NAN = {"chlorophyll.user.nodata"}


def every_key(section=SCHEMA, prefix=""):
    """Every key with what the schema says of it."""
    for name, key in section["properties"].items():
        if "$ref" in key:
            yield from every_key(
                SCHEMA["$defs"][key["$ref"].rsplit("/", 1)[-1]], f"{prefix}{name}."
            )
        else:
            yield f"{prefix}{name}", key


def alternatives(key):
    return key.get("anyOf", [key])


def numeric(key):
    return [one for one in alternatives(key) if one.get("type") in ("number", "integer")]


def beyond(key):
    """Numbers just outside what a key allows."""
    for one in numeric(key):
        least = 1 if one["type"] == "integer" else 1e-6
        yield from (one[name] - least for name in ("minimum",) if name in one)
        yield from (one[name] + least for name in ("maximum",) if name in one)
        yield from (one[name] for name in ("exclusiveMinimum", "exclusiveMaximum") if name in one)


def at(key):
    """Numbers just inside."""
    for one in numeric(key):
        least = 1 if one["type"] == "integer" else 1e-12
        yield from (one[name] for name in ("minimum", "maximum") if name in one)
        yield from (one[name] + least for name in ("exclusiveMinimum",) if name in one)
        yield from (one[name] - least for name in ("exclusiveMaximum",) if name in one)


def wrong(key):
    """Values of another kind."""
    kinds = {one.get("type") for one in alternatives(key)}
    if kinds & {"number", "integer"}:
        yield from (math.inf, -math.inf, math.nan, True, "many", [], {})
    elif kinds == {"boolean"}:
        yield from (2, "perhaps", [], {})
    elif "enum" in key:
        yield from ("no such word", 3, [], {})
    elif kinds == {"string"}:
        yield from (3, 3.5, True, [], {})
    elif kinds >= {"array"}:
        yield from (3, "one", {}, math.nan)


def nested(name, value):
    for part in reversed(name.split(".")):
        value = {part: value}
    return value


SECTIONS = sorted({name.split(".")[0] for name, _ in every_key()})


def of_section(section, values):
    return [
        (name, value)
        for name, key in every_key()
        if name.split(".")[0] == section
        for value in values(key)
        if not (name in MAY_BE_NAN and isinstance(value, float) and not math.isfinite(value))
    ]


def said_of(name, value):
    """What is wrong with how a value is answered; empty where nothing is."""
    try:
        validate(nested(name, value), "mine.yaml")
    except InputError as error:
        told = f"{error.where} {error.found} {error.remedy}"
        helps = name.split(".")[0] in told
        return "" if helps and error.expected and error.remedy else f"{name}: {error}"
    return f"{name}: {value} is taken"


@pytest.mark.parametrize("section", SECTIONS)
def test_a_value_beyond_its_bound_or_of_another_kind_is_named_with_what_to_do(section):
    tried = of_section(section, lambda key: [*beyond(key), *wrong(key)])
    assert not [said for name, value in tried if (said := said_of(name, value))]


@pytest.mark.parametrize("section", SECTIONS)
def test_a_value_at_its_bound_is_taken_or_refused_for_a_reason_that_is_told(section):
    said = [said_of(name, value) for name, value in of_section(section, at)]
    assert not [one for one in said if one and not one.endswith("is taken")]


def test_there_are_thousands_of_such_values_in_every_section():
    refused = {one: of_section(one, lambda key: [*beyond(key), *wrong(key)]) for one in SECTIONS}
    assert all(refused.values())
    assert sum(map(len, refused.values())) > 2500
