"""Do tests notice? Small faults are put into the code, one at a time, and its tests are run.

    make coverage
    PYTHONPATH=scripts .venv/bin/python tools/mutants.py [--count 100] [--seed 1] [--packages …]

A fault swaps an operator, turns a comparison round, or changes a number or a truth value. Faults
are drawn over all places of the packages where one is possible; left out are messages, annotations
and decorators. The tests of a fault are those of tests/unit and tests/physics that `make coverage`
saw run its line. Compiled code runs where no line is seen, and constants are read but once: there
it is those of test files that import the module, or a module that imports it. The quickest come
first, as long as time is left.
Writes every fault to `--output` as it is judged; `why` of a row that stands there already is kept.
"""

import argparse
import ast
import importlib
import importlib.abc
import importlib.util
import multiprocessing
import os
import re
import resource
import sys
import tempfile
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

import coverage
import numba
import numpy as np
import pandas as pd
import pytest

ROOT = Path(__file__).parents[1]
SCRIPTS = ROOT / "scripts"
PACKAGES = ("structure", "light", "sky", "optics", "stats")
SWAPS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult, ast.Lt: ast.GtE,
    ast.LtE: ast.Gt, ast.Gt: ast.LtE, ast.GtE: ast.Lt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.In: ast.NotIn, ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.And: ast.Or, ast.Or: ast.And,
}  # fmt: skip
MESSAGE = re.compile(r"raise |log\.|\w*Error\(|warnings\.")
PARTS = ("tests/unit", "tests/physics")
FAULT = ["module", "line", "fault"]
TIMES = ROOT / ".coverage-tests.xml"
BUDGET_S = 40  # for the tests of one fault, as they took when coverage was found
WAIT = 30  # seconds of the clock for one of a processor: what waits for nothing ends too
AHEAD = ("scipy.optimize", "xarray", "pyarrow.parquet", "matplotlib.figure")


def places(node: ast.AST, line: Any = None) -> Iterator[tuple]:
    """Where a fault can be put: owner, its field, place in a list, what stands there then, line."""
    line = node if isinstance(node, ast.expr | ast.stmt) else line
    if isinstance(node, ast.Raise | ast.Call) and MESSAGE.match(ast.unparse(node)):
        return
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list"):
            continue
        for k, one in enumerate(value) if isinstance(value, list) else [(None, value)]:
            if other := SWAPS.get(type(one)):
                yield node, name, k, other(), line
            if isinstance(one, ast.Constant) and isinstance(one.value, bool | int | float):
                changed = not one.value if isinstance(one.value, bool) else one.value + 1
                yield node, name, k, ast.copy_location(ast.Constant(changed), one), line
            elif isinstance(one, ast.AST):
                yield from places(one, line)


def put(owner: ast.AST, name: str, k: int | None, new: ast.AST) -> ast.AST:
    """Exchange a node, and return the one that was there."""
    old = getattr(owner, name) if k is None else getattr(owner, name)[k]
    if k is None:
        setattr(owner, name, new)
    else:
        getattr(owner, name)[k] = new
    return old


def importing(module: str, paths: Iterator[Path]) -> list[Path]:
    """Those files that import a module by name."""
    package, _, name = module.rpartition(".")
    imports = re.compile(
        rf"^\s*(from {package} import [^\n]*\b{name}\b|(from|import) {module}\b)", re.MULTILINE
    )
    return [path for path in paths if imports.search(path.read_text())]


@cache
def seconds() -> dict[str, float]:
    """How long every test took that passed when coverage was found, by its name for pytest [s]."""
    if not TIMES.exists():
        sys.exit(f"{TIMES.name} is missing: run `make coverage` first")
    found = {}
    for case in ElementTree.parse(TIMES).iter("testcase"):
        if not len(case):  # neither failed nor left out
            file = case.attrib["classname"].replace(".", "/") + ".py"
            found[f"{file}::{case.attrib['name']}"] = float(case.attrib["time"])
    return {name: s for name, s in found.items() if name.startswith(PARTS)}


@cache
def tests_by_line(path: Path) -> dict[int, list[str]]:
    """Tests that ran each line of a file, by their name for pytest and a part of theirs."""
    data = coverage.CoverageData(str(ROOT / ".coverage"))
    data.read()
    return data.contexts_by_lineno(str(path))


@cache
def tests_by_import(module: str) -> frozenset[str]:
    """Tests of files that import a module, or a module that imports it."""
    users = importing(module, SCRIPTS.rglob("*.py"))
    names = {".".join(path.relative_to(SCRIPTS).with_suffix("").parts) for path in users}
    files = {
        str(file.relative_to(ROOT))
        for name in names | {module}
        for part in PARTS
        for file in importing(name, (ROOT / part).glob("test_*.py"))
    }
    return frozenset(name for name in seconds() if name.split("::")[0] in files)


def tests_of(module: str, path: Path, lines: range, is_seen: bool) -> list[str]:
    """Tests of a fault, the quickest first, as many as there is time for."""
    by_line = tests_by_line(path)
    names = {one.split("|")[0] for line in lines for one in by_line.get(line, [])}
    if not is_seen:
        names |= tests_by_import(module)
    ordered = sorted(names & seconds().keys(), key=lambda name: (seconds()[name], name))
    spent = np.cumsum([seconds()[name] for name in ordered])
    return ordered[: int(np.searchsorted(spent, BUDGET_S, side="right"))]


class Tree(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Gives a module another tree than that of its file."""

    def __init__(self, module: str, path: Path, tree: ast.Module) -> None:
        self.module, self.path, self.tree = module, path, tree

    def find_spec(self, name, path=None, target=None):
        if name == self.module:
            return importlib.util.spec_from_file_location(name, self.path, loader=self)
        return None

    def exec_module(self, module) -> None:
        exec(compile(self.tree, self.path, "exec"), module.__dict__)


def run(tests: list[str], tree: Tree, limit_s: int) -> None:
    """Run tests with another tree of one module; the exit code says whether they pass."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 1))
    with tempfile.TemporaryDirectory() as folder:
        sys.meta_path.insert(0, tree)
        if "njit" in tree.path.read_text():  # what was compiled before knows of no fault
            os.environ["NUMBA_CACHE_DIR"] = folder
            numba.config.reload_config()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", f"--basetemp={folder}/tests"]
        sys.exit(int(pytest.main([*options, *tests])))


def is_noticed(tests: list[str], tree: Tree) -> bool:
    """Whether one of the tests fails, or finds no end, in a child of this process."""
    limit_s = 60 + 3 * int(sum(seconds()[name] for name in tests))
    child = multiprocessing.get_context("fork").Process(target=run, args=(tests, tree, limit_s))
    child.start()
    child.join(WAIT * limit_s)
    child.kill()
    child.join()
    if child.exitcode in (pytest.ExitCode.USAGE_ERROR, pytest.ExitCode.NO_TESTS_COLLECTED):
        sys.exit(f"pytest does not know {tests}: run `make coverage` anew")
    return child.exitcode != 0


def seen(tree: ast.Module) -> set[int]:
    """Lines of functions that do not run compiled."""
    found: set[int] = set()
    functions = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
    for node in functions:
        if not any("jit" in ast.unparse(one) for one in node.decorator_list):
            found |= set(range(node.body[0].lineno, (node.end_lineno or node.lineno) + 1))
    return found


def main() -> None:
    """Draw faults, run tests, tell."""
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--count", type=int, default=100)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--packages", nargs="+", default=PACKAGES)
    options.add_argument("--output", type=Path, default=ROOT / "docs" / "data" / "mutants.csv")
    asked = options.parse_args()
    files = [path for one in asked.packages for path in (SCRIPTS / "dapple" / one).rglob("*.py")]
    trees = {path: ast.parse(path.read_text()) for path in sorted(files)}
    everywhere = [(path, *place) for path, tree in trees.items() for place in places(tree)]
    drawn = np.random.default_rng(asked.seed).permutation(len(everywhere))[: asked.count]
    known = reasons(asked.output) if asked.output.exists() else pd.Series(dtype=object)
    for library in AHEAD:  # so that no child spends time on it
        importlib.import_module(library)
    rows = []
    for number in drawn:
        path, owner, name, k, new, line = everywhere[number]
        module = ".".join(path.relative_to(SCRIPTS).with_suffix("").parts)
        before = ast.unparse(line).splitlines()[0]
        old = put(owner, name, k, new)
        lines = range(line.lineno, line.end_lineno + 1)
        tests = tests_of(module, path, lines, line.lineno in seen(trees[path]))
        found = bool(tests) and is_noticed(tests, Tree(module, path, trees[path]))
        after = ast.unparse(line).splitlines()[0]
        put(owner, name, k, old)
        why = "" if found else known.get((module, before, after), "")
        rows.append(dict(zip(FAULT, (module, before, after), strict=True), noticed=found, why=why))
        print(f"{'noticed' if found else 'PASSED '} {module}: {before} -> {after}", flush=True)
        pd.DataFrame(rows).to_csv(asked.output, index=False)
    died = sum(row["noticed"] for row in rows)
    print(f"{died} of {len(rows)} noticed, of {len(everywhere)} places where a fault is possible")


def reasons(path: Path) -> pd.Series:
    """Why no test notices a fault, as a person wrote it into an earlier table, by fault."""
    table = pd.read_csv(path, keep_default_na=False).drop_duplicates(FAULT)
    return table.set_index(FAULT)["why"]


if __name__ == "__main__":
    main()
