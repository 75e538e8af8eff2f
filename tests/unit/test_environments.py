"""Every rule names an environment that holds what its script imports, in the lock's versions."""

import ast
import re
import sys
from functools import cache

import pytest
import yaml
from packaging.specifiers import SpecifierSet
from packaging.version import Version

from dapple.code_use import SCRIPTS

ROOT = SCRIPTS.parent
PACKAGES = {
    "CSF": "cloth-simulation-filter",
    "lazrs": "lazrs-python",
    "matplotlib": "matplotlib-base",
    "mitsuba": "mitsuba libllvm19",
    "netCDF4": "netcdf4",
    "rpy2": "rpy2 r-base",
    "skimage": "scikit-image",
    "sklearn": "scikit-learn",
    "xarray": "xarray netcdf4",
    "yaml": "pyyaml",
    "annotated_types": "pydantic",
    "pydantic_core": "pydantic",
}
"""Packages of conda that bring a module, where they are not called like it."""
PROGRAMS = {
    "pdal.py": "pdal",
    "cloud/cloudcompare.py": "cloudcompare",
    "less3.py": "less3d",
}
"""Programs that modules of dapple run."""
OPTIONAL = {"cloudComPy"}
"""Used where it can be imported; on no registry."""
RULE = re.compile(
    r'^ *rule(?: (\w+))?:.*?^ +conda:\s+"[^"]*?(\w+)\.yaml".*?^ +script:\s+"[^"]*?(\w+)\.py"',
    re.DOTALL | re.MULTILINE,
)


@cache
def imports(path):
    """Modules that a file imports, dapple's own as files and others by their first name."""
    own, foreign = set(), set()
    for node in ast.walk(ast.parse(path.read_text())):
        names = []
        if isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        for name in names:
            if (file := SCRIPTS / f"{name.replace('.', '/')}.py").is_file():
                own.add(file)
            elif not name.startswith("dapple"):
                foreign.add(name.split(".")[0])
    return own, foreign - sys.stdlib_module_names


def needs(script):
    """Packages of conda without which a script would not run."""
    files, waiting, packages = set(), [script], {"python"}
    while waiting:
        own, foreign = imports(waiting.pop())
        waiting += own - files
        files |= own
        for module in foreign - OPTIONAL:
            packages.update(PACKAGES.get(module, module).split())
    for file in files:
        if program := PROGRAMS.get(str(file.relative_to(SCRIPTS / "dapple"))):
            packages.add(program)
        for code in file.parent.glob(f"{file.stem}*.R"):
            packages |= {f"r-{name}" for name in re.findall(r"(\w+)::", code.read_text())}
    return packages


def environment(name):
    """Packages of an environment with their pins."""
    entries = yaml.safe_load((ROOT / f"envs/{name}.yaml").read_text())["dependencies"]
    plain = [one for one in entries if isinstance(one, str)]
    plain += [one for pip in entries if isinstance(pip, dict) for one in pip["pip"]]
    found = (re.fullmatch(r"([\w.-]+)(?:={1,2}([^;]*))?(?:;.*)?", one) for one in plain)
    return dict(one.groups() for one in found)


RULES = [
    found
    for path in sorted((ROOT / "rules").rglob("*.smk"))
    for found in RULE.findall(path.read_text())
]
# One rule draws all figures of the page, each by a module that its row names.
FIGURES = [
    ("figure", "dapple", f"dapple/figures/{name}")
    for name in re.findall(r'"drawn_by": "(\w+)"', (ROOT / "rules/figures.smk").read_text())
]
ENVIRONMENTS = sorted(path.stem for path in (ROOT / "envs").glob("*.yaml"))


def test_every_rule_with_a_script_is_looked_at():
    text = "".join(path.read_text() for path in (ROOT / "rules").rglob("*.smk"))
    assert len(RULES) == len(re.findall(r"^ +script:", text, re.MULTILINE)) > 60
    assert len(RULES) == len(re.findall(r"^ +conda:", text, re.MULTILINE))
    assert len(FIGURES) > 5


@pytest.mark.parametrize(("rule", "name", "script"), RULES + FIGURES, ids=lambda value: value)
def test_a_rule_s_environment_holds_what_its_script_imports(rule, name, script):
    missing = needs(SCRIPTS / f"{script}.py") - environment(name).keys()
    assert not missing, f"envs/{name}.yaml lacks {', '.join(sorted(missing))} for rule {rule}"


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_an_environment_holds_nothing_that_no_rule_needs(name):
    scripts = {script for _, env, script in RULES + FIGURES if env == name}
    assert scripts, f"no rule names envs/{name}.yaml"
    needed = set().union(*(needs(SCRIPTS / f"{script}.py") for script in scripts))
    assert environment(name).keys() - needed <= {"pip", "drjit", "llvm-tools"}


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_pins_follow_the_lock_file(name):
    lines = re.findall(
        r"^([\w.-]+)==([\w.]+)(.*)", (ROOT / "requirements.lock").read_text(), re.MULTILINE
    )
    locked = {package: version for package, version, when in lines if ">= '3.12'" not in when}
    for package, pin in environment(name).items():
        if pin and package in locked:
            assert Version(locked[package]) in SpecifierSet(f"=={pin}.*"), package
