"""The house stays tidy: short files, nothing written twice, every key of the configuration read."""

import ast
import re
from collections import defaultdict
from functools import cache
from pathlib import Path

import pytest

from dapple.code_use import SCRIPTS
from dapple.config.base import Section
from dapple.config.settings import Settings

ROOT = SCRIPTS.parent
DAPPLE = SCRIPTS / "dapple"
MODULE_LINES, SCRIPT_LINES, EQUAL_LINES = 400, 100, 6
CODE = sorted([*SCRIPTS.rglob("*.py"), *ROOT.glob("benchmarks/*.py"), *ROOT.glob("tools/*.py")])


@cache
def text_of(path: Path) -> str:
    return path.read_text()


def name(path):
    return str(path.relative_to(ROOT))


def longer(paths, most):
    lengths = {name(path): text_of(path).count("\n") for path in paths}
    return {path: length for path, length in lengths.items() if length > most}


def test_no_module_is_longer_than_can_be_overlooked():
    assert longer(CODE, MODULE_LINES) == {}


def test_scripts_of_rules_only_move_files():
    assert longer(SCRIPTS.glob("*.py"), SCRIPT_LINES) == {}


def statements(path):
    """Lines that say or do something, with their numbers: no imports, descriptions, comments."""
    text, passed = text_of(path), set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import | ast.ImportFrom) or (
            isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        ):
            passed |= set(range(node.lineno, node.end_lineno + 1))
    for number, line in enumerate(text.splitlines(), start=1):
        line = line.strip()
        if line and number not in passed and not line.startswith("#"):
            yield number, line


def repeated(paths, n_lines):
    """Places that share so many lines one after the other."""
    places = defaultdict(list)
    for path in paths:
        lines = list(statements(path))
        for k in range(len(lines) - n_lines + 1):
            run = tuple(line for _, line in lines[k : k + n_lines])
            places[run].append(f"{name(path)}:{lines[k][0]}")
    return [at for at in places.values() if len(at) > 1]


def test_nothing_is_written_twice():
    assert repeated(CODE, EQUAL_LINES) == []


def test_what_is_written_twice_would_be_found(tmp_path, monkeypatch):
    monkeypatch.setattr(f"{__name__}.ROOT", tmp_path)
    lines = "".join(f"a{k} = {k}\n" for k in range(EQUAL_LINES))
    for file in ("one.py", "other.py"):
        (tmp_path / file).write_text(f"import {file[:3]}\n{lines}print({file[:3]!r})\n")
    found = repeated(sorted(tmp_path.glob("*.py")), EQUAL_LINES)
    assert found == [["one.py:2", "other.py:2"]]


def keys(section: type[Section], prefix: str = ""):
    """Every key with its full name."""
    for key, field in section.model_fields.items():
        kind = field.annotation
        if isinstance(kind, type) and issubclass(kind, Section):
            yield from keys(kind, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", key


@pytest.fixture(scope="module")
def words():
    """Words of rules and of code; of the configuration's own code, what it takes from itself."""
    texts = [text_of(path) for path in (ROOT / "Snakefile", *ROOT.glob("rules/**/*.smk"))]
    for path in SCRIPTS.rglob("*.py"):
        own = DAPPLE / "config" in path.parents
        texts += re.findall(r"self\.\w+", text_of(path)) if own else [text_of(path)]
    return {word for text in texts for word in re.findall(r"\w+", text)}


def test_every_key_of_the_configuration_is_read(words):
    assert [full for full, key in keys(Settings) if key not in words] == []
