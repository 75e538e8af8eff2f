"""Benchmarks are run by hand: that they still start, on today's configuration, is held here."""

import ast
import importlib
import inspect
import runpy
import sys
from pathlib import Path

import pytest

from dapple.cloud.clean import clean
from dapple.config.settings import Settings
from dapple.sky.sun import Site
from dapple.virtual.leaves import along_wood
from dapple.virtual.plants import apple_tree

BENCHMARKS = sorted((Path(__file__).parents[2] / "benchmarks").glob("*.py"))
PROGRAMS = [path for path in BENCHMARKS if "ArgumentParser(" in path.read_text()]
TAKES = {"site": Site, "leaves": along_wood, "plant": apple_tree, "clean": clean}
"""Who takes which section of a configuration, key by key."""
BESIDES = {"placements"}  # of leaves: how often they are placed


def named(paths):
    return pytest.mark.parametrize("path", paths, ids=lambda path: path.stem)


@named(BENCHMARKS)
def test_every_name_that_a_benchmark_imports_of_dapple_is_there(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("dapple"):
            module = importlib.import_module(node.module)
            for alias in node.names:
                if not hasattr(module, alias.name):
                    importlib.import_module(f"{node.module}.{alias.name}")


@named(PROGRAMS)
def test_a_benchmark_starts_and_says_what_it_takes(path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(path.parent)
    monkeypatch.setattr(sys, "argv", [str(path), "--help"])
    with pytest.raises(SystemExit) as left:
        runpy.run_path(str(path), run_name="__main__")
    assert left.value.code == 0
    assert capsys.readouterr().out.startswith("usage: ")


@named(BENCHMARKS)
def test_sections_that_a_benchmark_hands_on_have_no_key_that_is_not_taken(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Attribute)):
            continue
        section = node.func.value.attr if isinstance(node.func.value, ast.Attribute) else ""
        if node.func.attr == "model_dump" and section in TAKES:
            left_out = {word.arg: ast.literal_eval(word.value) for word in node.keywords}
            keys = getattr(Settings(), section).model_dump(**left_out)
            taken = set(inspect.signature(TAKES[section]).parameters) | BESIDES
            assert set(keys) <= taken, node.lineno
