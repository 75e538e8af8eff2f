"""Which files of dapple a script's results depend on, told from its source.

A name counts, not a file: a script that calls one function of a module depends on the files which
that function needs, and not on those that its neighbours need. Where a name cannot be followed, all
of its module counts.
"""

import ast
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

SCRIPTS = Path(__file__).parent.parent
WHOLE, RUN = None, ""
"""Stand for every name of a module, those that it imports too, and for all that a script does."""
Use = tuple[str, str | None]


@dataclass(frozen=True)
class Source:
    """What a module defines, by name.

    Attributes
    ----------
    uses : dict of str to set
        For each name that is defined at the top: the names that its definition mentions, each with
        the attribute that is taken of it.
    imports : dict of str to tuple
        For each imported name: the file of dapple where it is from, and which name it has there.
    always : set
        What statements mention that run whatever is used.
    """

    uses: dict[str, set[Use]] = field(default_factory=dict)
    imports: dict[str, tuple[Path, str | None]] = field(default_factory=dict)
    always: set[Use] = field(default_factory=set)


def files_of(script: Path, unused: Sequence[str] = ()) -> set[Path]:
    """The modules that a script reaches, and the R code beside them; without the script itself.

    Parameters
    ----------
    script : Path
    unused : sequence of str
        Modules below dapple that are not followed, because a configuration turns them off.
    """
    cut = {_file(f"dapple.{name}") for name in unused}
    found: set[tuple[Path, str | None]] = {(script, RUN)}
    waiting = list(found)
    while waiting:
        new = {use for use in _mentioned(*waiting.pop()) if use[0] not in cut} - found
        found |= new
        waiting += new
    modules = {path for path, _ in found} - {script}
    return modules | {beside for path in modules for beside in path.parent.glob(f"{path.stem}*.R")}


def _mentioned(path: Path, name: str | None) -> Iterator[tuple[Path, str | None]]:
    """What a name of a module mentions, by file and name."""
    source = _read(path)
    if path.name == "__init__.py":
        # A package with code of its own finds its modules by itself: all of them count.
        yield from ((module, WHOLE) for module in path.parent.glob("[a-z]*.py"))
    if name in source.imports:
        yield source.imports[name]
        return
    if name in source.uses:
        mentioned = source.always | source.uses[name]
    else:
        mentioned = set().union(source.always, *source.uses.values())
        if name != RUN:
            yield from source.imports.values()
    for first, attribute in mentioned:
        if first in source.imports:
            file, there = source.imports[first]
            yield file, attribute if there is WHOLE else there
        elif first in source.uses:
            yield path, first


@cache
def _read(path: Path) -> Source:
    source = Source()
    for statement in _at_the_top(ast.parse(path.read_text(encoding="utf-8")).body):
        if isinstance(statement, ast.Import | ast.ImportFrom):
            source.imports.update(_imported(statement))
        elif names := _defined(statement):
            for name in names:
                source.uses.setdefault(name, set()).update(_uses(statement, source))
        else:
            source.always.update(_uses(statement, source))
    return source


def _at_the_top(statements: list[ast.stmt]) -> Iterator[ast.stmt]:
    """Statements of a module, those within conditions too; not those for type checkers alone."""
    for statement in statements:
        if isinstance(statement, ast.If):
            if ast.unparse(statement.test) != "TYPE_CHECKING":
                yield ast.Expr(statement.test)
                yield from _at_the_top(statement.body)
            yield from _at_the_top(statement.orelse)
        elif isinstance(statement, ast.Try):
            parts = (statement.body, *(h.body for h in statement.handlers), statement.orelse)
            yield from _at_the_top([one for part in (*parts, statement.finalbody) for one in part])
        else:
            yield statement


def _defined(statement: ast.stmt) -> list[str]:
    """The names that a statement defines, if it does nothing else."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        return [statement.name]
    targets = statement.targets if isinstance(statement, ast.Assign) else []
    if isinstance(statement, ast.AnnAssign):
        targets = [statement.target]
    names = [part for target in targets for part in getattr(target, "elts", [target])]
    if all(isinstance(name, ast.Name) for name in names):
        return [name.id for name in names]
    return []


def _uses(statement: ast.stmt, source: Source) -> set[Use]:
    """Names that a statement mentions; what it imports itself is added to the source's imports."""
    found: set[Use] = set()
    with_attribute = set()
    for node, parameters in _within(statement):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.value.id not in parameters:
                found.add((node.value.id, node.attr))
            with_attribute.add(node.value)
        elif isinstance(node, ast.Name) and node not in with_attribute:
            if node.id not in parameters:
                found.add((node.id, WHOLE))
        elif isinstance(node, ast.Import | ast.ImportFrom):
            # Known in this statement alone: a neighbour may call something else by that name.
            inside = {f"{name} {node.lineno}": of for name, of in _imported(node).items()}
            source.imports.update(inside)
            found |= {(name, WHOLE) for name in inside}
    return found


def _within(top: ast.AST) -> Iterator[tuple[ast.AST, frozenset[str]]]:
    """A node and all below it, each with the parameters that hide names of the module there."""
    waiting: list[tuple[ast.AST, frozenset[str]]] = [(top, frozenset())]
    while waiting:
        node, hidden = waiting.pop()
        yield node, hidden
        parts = list(ast.iter_child_nodes(node))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda):
            own = hidden | {arg.arg for arg in ast.walk(node.args) if isinstance(arg, ast.arg)}
            body = node.body if isinstance(node.body, list) else [node.body]
            waiting += [(part, own if part in body else hidden) for part in parts]
        else:
            waiting += [(part, hidden) for part in parts]


def _imported(node: ast.Import | ast.ImportFrom) -> dict[str, tuple[Path, str | None]]:
    """Names that an import makes known, if they are dapple's: file, and name in it."""
    found: dict[str, tuple[Path, str | None]] = {}
    if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
        for alias in node.names:
            known = alias.asname or alias.name
            if module := _file(f"{node.module}.{alias.name}"):
                found[known] = (module, WHOLE)
            elif module := _file(node.module):
                found[known] = (module, WHOLE if alias.name == "*" else alias.name)
    elif isinstance(node, ast.Import):
        for alias in node.names:
            if module := _file(alias.name):
                found[alias.asname or alias.name.split(".")[0]] = (module, WHOLE)
    return found


def _file(module: str) -> Path | None:
    if module.split(".")[0] != "dapple":
        return None
    path = SCRIPTS / module.replace(".", "/")
    package = path / "__init__.py"
    if package.is_file() and package.stat().st_size:
        return package
    return path.with_suffix(".py") if path.with_suffix(".py").is_file() else None
