"""Do tests notice? Small faults are put into the code, one at a time, and its tests are run.

    PYTHONPATH=scripts .venv/bin/python tools/mutants.py [--count 60] [--seed 1] [--packages …]

A fault swaps an operator, turns a comparison round, or changes a number or a truth value. Faults
are drawn over all places of the packages where one is possible; left out are messages, annotations
and decorators. The tests of a fault are those of tests/unit and tests/physics that import its
module, or else a module that imports it; they have to pass without it. Prints every fault that they
let pass.
"""

import argparse
import ast
import importlib.abc
import importlib.util
import multiprocessing
import os
import re
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas  # noqa: F401  what every test imports, once for all
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
LIMIT_S, MOST_FILES = 300, 6  # for the tests of one fault; the shortest files are taken


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


def tests_of(module: str) -> list[str]:
    """Test files that import a module, or else a module that does."""
    package, _, name = module.rpartition(".")
    imports = re.compile(
        rf"^\s*(from {package} import [^\n]*\b{name}\b|(from|import) {module}\b)", re.MULTILINE
    )
    tests = (*ROOT.glob("tests/unit/test_*.py"), *ROOT.glob("tests/physics/test_*.py"))
    found = [path for path in tests if imports.search(path.read_text())]
    if found:
        return [str(path) for path in sorted(found, key=lambda path: path.stat().st_size)]
    users = [path for path in SCRIPTS.rglob("*.py") if imports.search(path.read_text())]
    names = {".".join(path.relative_to(SCRIPTS).with_suffix("").parts) for path in users}
    return sorted({test for user in names for test in tests_of(user)})


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


def run(tests: list[str], tree: Tree) -> None:
    """Run tests with the module's other tree; the exit code says whether they pass."""
    sys.meta_path.insert(0, tree)
    with tempfile.TemporaryDirectory() as cache:
        os.environ["NUMBA_CACHE_DIR"] = cache  # code that was compiled before knows of no fault
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        sys.exit(int(pytest.main(["-x", "-q", "-n", "0", "-p", "no:cacheprovider", *tests])))


def noticed(tests: list[str], tree: Tree) -> bool:
    """Whether tests fail, or find no end, in a child of this process."""
    child = multiprocessing.get_context("fork").Process(target=run, args=(tests, tree))
    child.start()
    child.join(LIMIT_S)
    child.kill()
    child.join()
    return child.exitcode != 0


def main() -> None:
    """Draw faults, run tests, tell."""
    options = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    options.add_argument("--count", type=int, default=60)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--packages", nargs="+", default=PACKAGES)
    asked = options.parse_args()
    files = [path for one in asked.packages for path in (SCRIPTS / "dapple" / one).rglob("*.py")]
    trees = {path: ast.parse(path.read_text()) for path in sorted(files)}
    everywhere = [(path, *place) for path, tree in trees.items() for place in places(tree)]
    drawn = np.random.default_rng(asked.seed).permutation(len(everywhere))[: asked.count]
    died = 0
    for number in sorted(drawn):
        path, owner, name, k, new, line = everywhere[number]
        module = ".".join(path.relative_to(SCRIPTS).with_suffix("").parts)
        before = ast.unparse(line).splitlines()[0]
        old = put(owner, name, k, new)
        tests = tests_of(module)[:MOST_FILES]
        found = bool(tests) and noticed(tests, Tree(module, path, trees[path]))
        died += found
        told = f"{module}:{line.lineno} {before} -> {ast.unparse(line).splitlines()[0]}"
        print(f"{'noticed' if found else 'PASSED '} {told}", flush=True)
        put(owner, name, k, old)
    print(f"{died} of {len(drawn)} noticed, of {len(everywhere)} places where a fault is possible")


if __name__ == "__main__":
    main()
