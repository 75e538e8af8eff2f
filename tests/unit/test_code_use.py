"""Which files a script's results depend on: those of the names that it reaches, and no others."""

import pytest

from dapple import code_use


@pytest.fixture
def reached(tmp_path, monkeypatch):
    """The files, without suffix, that a script reaches in a package of these sources."""

    def write(script, **sources):
        monkeypatch.setattr(code_use, "SCRIPTS", tmp_path)
        code_use._read.cache_clear()
        (tmp_path / "dapple").mkdir()
        for name, text in sources.items():
            (tmp_path / f"dapple/{name}.py").write_text(text)
        (tmp_path / "rule.py").write_text(script)
        return {path.stem for path in code_use.files_of(tmp_path / "rule.py")}

    yield write
    code_use._read.cache_clear()


TWO = "from dapple import first, second\ndef a(): first.f()\ndef b(): second.f()\n"
LEAVES = {"first": "def f(): pass\n", "second": "def f(): pass\n"}


def test_a_function_brings_what_it_calls_and_not_what_its_neighbour_calls(reached):
    assert reached("from dapple.two import a\na()", two=TWO, **LEAVES) == {"two", "first"}


def test_the_same_through_the_name_of_the_module(reached):
    assert reached("from dapple import two\ntwo.b()", two=TWO, **LEAVES) == {"two", "second"}


def test_a_module_that_is_handed_on_counts_as_a_whole(reached):
    script = "from dapple import two\nvars(two)"
    assert reached(script, two=TWO, **LEAVES) == {"two", "first", "second"}


def test_a_name_that_cannot_be_found_brings_all_of_its_module(reached):
    script = "from dapple import two\ntwo.c()"
    assert reached(script, two=TWO, **LEAVES) == {"two", "first", "second"}


def test_tables_of_functions_bring_every_function(reached):
    table = TWO + "TABLE = {'a': a, 'b': b}\ndef pick(name): return TABLE[name]\n"
    assert reached("from dapple.two import pick\npick(1)", two=table, **LEAVES) == {
        "two",
        "first",
        "second",
    }


def test_what_is_imported_within_a_function_counts_with_it(reached):
    late = "".join(
        f"def {name}():\n    from dapple.{module} import f\n    return f\n"
        for name, module in (("a", "first"), ("b", "second"))
    )
    assert reached("from dapple.late import a\na()", late=late, **LEAVES) == {"late", "first"}


def test_a_name_that_is_passed_on_leads_to_where_it_is_from(reached):
    passed = "from dapple.first import f\n"
    assert reached("from dapple.passed import f\nf()", passed=passed, **LEAVES) == {
        "passed",
        "first",
    }


def test_statements_at_the_top_count_whatever_is_used(reached):
    eager = "from dapple import first\nfirst.f()\ndef a(): pass\n"
    assert reached("from dapple.eager import a\na()", eager=eager, **LEAVES) == {"eager", "first"}


def test_what_is_imported_under_a_condition_counts(reached):
    text = "try:\n    from dapple import first\nexcept ImportError:\n    pass\ndef a(): first.f()\n"
    assert reached("from dapple.some import a\na()", some=text, **LEAVES) == {"some", "first"}


def test_what_only_a_type_checker_imports_does_not_count(reached):
    text = (
        "from __future__ import annotations\nfrom typing import TYPE_CHECKING\n"
        "if TYPE_CHECKING:\n    from dapple.first import F\ndef a(x: F): pass\n"
    )
    assert reached("from dapple.typed import a\na()", typed=text, **LEAVES) == {"typed"}


def test_what_is_turned_off_is_not_followed(reached, tmp_path):
    reached("from dapple.two import a, b\na(b)", two=TWO, **LEAVES)
    found = code_use.files_of(tmp_path / "rule.py", unused=["second"])
    assert {path.stem for path in found} == {"two", "first"}


def test_a_parameter_is_not_the_neighbour_of_its_name(reached):
    text = "from dapple import first\ndef a(b, *, c=0):\n    return b.x, c\ndef b(): first.f()\n"
    assert reached("from dapple.some import a\na(1)", some=text, **LEAVES) == {"some"}


def test_all_modules_of_a_package_with_code_of_its_own_count(tmp_path, monkeypatch):
    monkeypatch.setattr(code_use, "SCRIPTS", tmp_path)
    package = tmp_path / "dapple/kinds"
    package.mkdir(parents=True)
    (package / "__init__.py").write_text("def find(name): return __import__(name)\n")
    (package / "one.py").write_text("def f(): pass\n")
    (tmp_path / "rule.py").write_text("from dapple import kinds\nkinds.find('one')\n")
    found = code_use.files_of(tmp_path / "rule.py")
    assert found == {package / "__init__.py", package / "one.py"}
