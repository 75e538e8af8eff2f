"""Do tests notice? Small faults are put into the code, one at a time, and its tests are run.

    PYTHONPATH=scripts .venv/bin/python tools/mutants.py [--count 100] [--seed 1] [--packages …]

A fault swaps an operator, turns a comparison round, or changes a number or a truth value. Faults
are drawn over all places of the packages where one is possible; left out are messages, annotations
and decorators. The tests of a fault are those of tests/unit and tests/physics that import its
module, then those that import a module that imports it, the quickest first and no slow ones. Each
is run once without a fault before it is used: one that fails then tells nothing, and ends the run.
Time is that of processors, so that a machine with other work chooses the same tests. Writes every
fault to `--output` as it is judged; `why` of a row that stands there already is kept.
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
import signal
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

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
FAULT = ["module", "line", "fault"]
# Seconds of a processor for the tests of one fault, as they took without it, and for one file.
BUDGET_S, SLOW_S = 45, 25
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
def tests_of(module: str) -> tuple[list[Path], list[Path]]:
    """Test files that import a module, and those that import a module that does."""

    def tests(name: str) -> set[Path]:
        return {p for part in ("unit", "physics") for p in importing(name, tests_in(part))}

    def tests_in(part: str) -> Iterator[Path]:
        return ROOT.glob(f"tests/{part}/test_*.py")

    own = tests(module)
    users = importing(module, SCRIPTS.rglob("*.py"))
    names = {".".join(path.relative_to(SCRIPTS).with_suffix("").parts) for path in users}
    return sorted(own), sorted(set().union(*map(tests, names)) - own)


@cache
def without_fault_s(test: Path) -> float:
    """Processor seconds of a test file as the code stands; without end if it is slow."""
    begin = processor_s()
    if code := exit_code((test,), None, SLOW_S):
        sys.exit(f"{test.relative_to(ROOT)} ends with {code} without any fault: mend it first")
    taken = processor_s() - begin
    return np.inf if code is None or taken > SLOW_S else taken


def processor_s() -> float:
    """Processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


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


def run(tests: tuple[Path, ...], tree: Tree | None, limit_s: int) -> None:
    """Run tests, with another tree of one module if told; the exit code says whether they pass."""
    resource.setrlimit(resource.RLIMIT_CPU, (limit_s, limit_s + 1))
    with tempfile.TemporaryDirectory() as folder:
        if tree:
            sys.meta_path.insert(0, tree)
            if "njit" in tree.path.read_text():  # what was compiled before knows of no fault
                os.environ["NUMBA_CACHE_DIR"] = folder
                numba.config.reload_config()
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        options = ["-x", "-q", "-n", "0", "-p", "no:cacheprovider", f"--basetemp={folder}/tests"]
        sys.exit(int(pytest.main([*options, *map(str, tests)])))


def exit_code(tests: tuple[Path, ...], tree: Tree | None, limit_s: float) -> int | None:
    """How tests end in a child of this process; None if they are far from it at the limit."""
    child = multiprocessing.get_context("fork").Process(
        target=run, args=(tests, tree, int(limit_s))
    )
    child.start()
    child.join(WAIT * limit_s)
    alive = child.is_alive()
    child.kill()
    child.join()
    return None if alive or child.exitcode == -signal.SIGXCPU else child.exitcode


def noticed(module: str, tree: Tree) -> bool:
    """Whether a test of a module fails, or finds no end."""
    left_s = float(BUDGET_S)
    for some in tests_of(module):
        taken = []
        for test in sorted(some, key=without_fault_s):
            if without_fault_s(test) > left_s:
                break
            taken.append(test)
            left_s -= without_fault_s(test)
        limit_s = 30 + 2 * sum(map(without_fault_s, taken))
        if taken and exit_code(tuple(taken), tree, limit_s) != 0:
            return True
    return False


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
        found = noticed(module, Tree(module, path, trees[path]))
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
