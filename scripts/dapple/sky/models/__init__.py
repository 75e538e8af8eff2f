"""How skies spread their light: one file a model, which the configuration calls by its name.

Each file has

`COEFFICIENTS`
    names of the k numbers that describe a sky, which may be none;
`coefficients(conditions)`
    these numbers (t, k) at t times, from `dapple.sky.conditions.Conditions`;
`radiance(coefficients, ways)`
    relative radiance (t, d...) in directions, from `dapple.sky.conditions.Ways`.

No import here needs numpy: the configuration takes the names of the models from this module.
"""

from importlib import import_module
from pathlib import Path
from types import ModuleType

from dapple.errors import InputError

NAMES = tuple(sorted(path.stem for path in Path(__file__).parent.glob("[a-z]*.py")))


def find(name: str) -> ModuleType:
    """A model by its name.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in NAMES:
        raise InputError("sky model", f"{name!r}", f"one of {', '.join(NAMES)}", "Choose one.")
    return import_module(f"{__name__}.{name}")
