"""Every default has one home: what the configuration says, no function says again."""

import ast
import re
import subprocess
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np
import pytest

from dapple.config.base import Section
from dapple.config.settings import Settings
from dapple.optics import default_spectra
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

DAPPLE = Path(__file__).parents[2] / "scripts/dapple"
HOUSES = ("advice", "light", "optics", "registration", "scene")


def keys(section, prefix=""):
    """Values of all keys by their last name."""
    found = defaultdict(dict)
    for name in type(section).model_fields:
        value = getattr(section, name)
        if isinstance(value, Section):
            for last, values in keys(value, f"{prefix}{name}.").items():
                found[last] |= values
        else:
            found[name][f"{prefix}{name}"] = value
    return found


def defaults(path):
    """Literal defaults of parameters and of fields, by the name of function or class."""
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.FunctionDef):
            own = node.args.posonlyargs + node.args.args
            pairs = list(zip(own[::-1], node.args.defaults[::-1], strict=False))
            pairs += zip(node.args.kwonlyargs, node.args.kw_defaults, strict=True)
            pairs = [(argument.arg, value) for argument, value in pairs]
        elif isinstance(node, ast.ClassDef):
            fields = [part for part in node.body if isinstance(part, ast.AnnAssign)]
            pairs = [(field.target.id, field.value) for field in fields]
        else:
            continue
        for name, value in pairs:
            if isinstance(value, ast.Constant | ast.Tuple | ast.UnaryOp):
                yield node.name, name, ast.literal_eval(value)


@pytest.mark.parametrize("house", HOUSES)
def test_no_function_has_a_default_that_the_configuration_has_too(house):
    configured = keys(Settings(experiment="homes"))
    twice = [
        f"{path.relative_to(DAPPLE)}: {where}({name}={value})"
        for path in sorted((DAPPLE / house).glob("*.py"))
        for where, name, value in defaults(path)
        if not isinstance(value, bool | str | None) and np.any(value)
        if any(value == other for other in configured.get(name, {}).values())
    ]
    assert twice == []


def test_the_configuration_is_read_without_numpy():
    """Snakemake reads it in an environment of its own, where defaults still have their homes."""
    code = "import sys; sys.modules['numpy'] = None; import dapple.config.settings as s; "
    code += "print(s.Settings(experiment='x').radiation.sky)"
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=DAPPLE.parent, capture_output=True, text=True, check=True
    )
    assert done.stdout == "perez\n"


def decimals(path):
    """All numbers with a decimal point in a file, in their order."""
    return " ".join(f"{float(text):g}" for text in re.findall(r"\d+\.\d+", path.read_text()))


@pytest.mark.parametrize("surface", ["BARK", "MEADOW", "CONIFER_BARK", "LITTER"])
def test_a_spectrum_is_written_once(surface):
    numbers = " ".join(f"{value:g}" for value in getattr(default_spectra, surface)["reflectance"])
    homes = [path.name for path in DAPPLE.rglob("*.py") if numbers in decimals(path)]
    assert homes == ["default_spectra.py"]


def test_the_diameter_of_the_sun_is_written_once():
    homes = [
        path.name for path in DAPPLE.rglob("*.py") if str(SUN_DIAMETER_DEG) in path.read_text()
    ]
    assert homes == ["solar_disc.py"]
