"""What pydantic finds wrong with a single value or key, in words that help."""

from __future__ import annotations

import difflib
import re

from pydantic import BaseModel, ValidationError

from dapple.errors import InputError

ALTERNATIVE = re.compile(r"constrained-|literal\[")
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
    # Of a key that takes a number or a word pydantic also says which of them failed.
    parts = [str(part) for part in first["loc"]]
    key = ".".join(part for part in parts if not ALTERNATIVE.match(part))
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
        _expected(first["msg"]),
        REMEDIES.get(first["type"], "See config/README.md for the meaning and range of every key."),
    )


def _expected(message: str) -> str:
    """What pydantic wants, as in `expected …`."""
    message = message.removeprefix("Value error, ").removeprefix("Input should be ")
    return re.sub(r"^\w+ should ", "to ", message)


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
