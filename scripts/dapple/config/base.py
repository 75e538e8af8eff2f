"""What all sections of the configuration are made of."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import date, datetime
from typing import Annotated, Any, Literal, TypeVar, get_args, get_origin

from annotated_types import Ge, Gt, Le, MinLen
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationInfo, field_validator
from pydantic_core import CoreSchema, core_schema

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Count = Annotated[int, Ge(1)]
Item = TypeVar("Item")
Some = Annotated[tuple[Item, ...], MinLen(1)]
"""A list that is not empty."""
Name = Annotated[str, MinLen(1)]
"""A word that is not empty."""


def _moment(value: Any) -> Any:
    """Text of a time in ISO 8601: YAML reads one with seconds as a time, a day alone as a date."""
    text = str(value) if isinstance(value, date) else value
    try:
        datetime.fromisoformat(text)
    except (TypeError, ValueError):
        raise ValueError("a time such as 2023-08-10 10:10 (ISO 8601)") from None
    return text


def _takes_a_number(annotation: Any) -> bool:
    inner = get_args(annotation)
    if get_origin(annotation) is Literal:
        return any(isinstance(one, int) for one in inner)
    return annotation in (int, float) or any(_takes_a_number(one) for one in inner)


Moment = Annotated[str, BeforeValidator(_moment)]
MomentOrNone = Annotated[
    str, BeforeValidator(lambda value: "" if value in ("", None) else _moment(value))
]
LeafAngles = Literal[
    "spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform"
]


class OneOf:
    """One of the names of a registry: a new entry there is a new choice here."""

    def __init__(self, names: Iterable[str]):
        self.names = list(names)

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> CoreSchema:
        return core_schema.literal_schema(self.names)


FREY = "Frey et al. 2025"
RIEGL = "after the RIEGL VZ-400i"
ZANDE = "Van der Zande et al. 2008"
LMS = "after the SICK LMS200"


def key(default: Any, text: str, source: str = "") -> Any:
    """A key: default, what it means, and where its value comes from."""
    return Field(
        default, description=text, json_schema_extra={"source": source} if source else None
    )


class Section(BaseModel):
    """A group of parameters; keys that are not parameters are errors."""

    model_config = ConfigDict(
        extra="forbid", frozen=True, validate_default=True, allow_inf_nan=False
    )

    @field_validator("*", mode="before")
    @classmethod
    def _no_truth_value_for_a_number(cls, value: Any, info: ValidationInfo) -> Any:
        """`yes` would be 1: refuse it where a number is asked for."""
        field = cls.model_fields[info.field_name or ""]
        if isinstance(value, bool) and _takes_a_number(field.annotation):
            raise ValueError("a number; YAML takes yes, no, on, off, true and false for no number")
        return value


class TimedTable(Section):
    """How a user's table tells time, numbers and what is missing."""

    path: str = key("", "text table, relative to data_dir")
    time_column: str = key("", "column of time stamps; empty: by its usual name")
    timezone: str = key(
        "", "zone of stamps without an offset: IANA name or +02:00; empty: as the file says"
    )
    time_format: str = key(
        "", "how stamps are written, as %d.%m.%Y %H:%M, `epoch` or `excel`; empty: as they show"
    )
    interval_label: Literal["", "instant", "start", "middle", "end"] = key(
        "", "what of its interval a stamp marks; empty: as the layout says, else a moment"
    )
    interval_min: NotNegative = key(0.0, "length of the intervals; 0: the step between rows")
    decimal: Literal["", ".", ","] = key("", "decimal sign; empty: as the cells show")
    missing: tuple[str | float, ...] = key(
        (), "flags of missing values, besides empty, NAN, -999, 9999 and the like"
    )
