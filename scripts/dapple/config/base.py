"""What all sections of the configuration are made of."""

from __future__ import annotations

from datetime import datetime
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field

Positive = Annotated[float, Gt(0)]
NotNegative = Annotated[float, Ge(0)]
Share = Annotated[float, Ge(0), Le(1)]
Count = Annotated[int, Ge(1)]
# YAML reads a time with seconds as a time, one without as text.
Moment = Annotated[
    str, BeforeValidator(lambda value: str(value) if isinstance(value, datetime) else value)
]
LeafAngles = Literal[
    "spherical", "planophile", "erectophile", "plagiophile", "extremophile", "uniform"
]

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

    model_config = ConfigDict(extra="forbid", frozen=True, validate_default=True)
