"""What Snakemake's rules and scripts need: code dependencies, logs, and errors that read well."""

import ast
import resource
import sys
import traceback
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from functools import cache
from pathlib import Path
from typing import Any

from dapple.errors import InputError

SCRIPTS = Path(__file__).parent.parent


def code_of(script: Path) -> tuple[str, ...]:
    """List the modules of dapple that a script imports, directly or through others.

    As inputs of its rule they make an edit rerun what depends on it, and nothing else.
    """
    found: set[Path] = set()
    waiting = [script]
    while waiting:
        for module in _imports(waiting.pop()):
            if module not in found:
                found.add(module)
                waiting.append(module)
    r_code = {beside for module in found for beside in module.parent.glob(f"{module.stem}*.R")}
    return tuple(sorted(short(path) for path in found | r_code))


def short(path: Path) -> str:
    """A path, relative to the working directory where it lies in it.

    A folder that moves is then not taken for other code.
    """
    here = Path.cwd()
    return str(path.relative_to(here) if path.is_relative_to(here) else path)


@cache
def _imports(source: Path) -> list[Path]:
    """The files behind the `dapple` imports of one Python file."""
    names: list[str] = []
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names += [alias.name for alias in node.names]
    paths = (
        SCRIPTS / f"{name.replace('.', '/')}.py" for name in names if name.startswith("dapple")
    )
    return [path for path in paths if path.is_file()]


def run(main: Callable[[Any], None], snakemake: Any) -> None:
    """Run the main function of a script with its output in the rule's log.

    A mistake of the user's (`InputError`) is one message on the terminal; everything else is a
    traceback in the log and on the terminal. Both end the job.
    """
    with Path(snakemake.log[0]).open("w", buffering=1) as log:
        try:
            with redirect_stdout(log), redirect_stderr(log):
                main(snakemake)
        except InputError as error:
            message = f"dapple: {error}"
            log.write(f"{traceback.format_exc()}\n{message}\n")
            sys.exit(message)
        except Exception:
            log.write(traceback.format_exc())
            raise


def peak_rss_mb() -> float:
    """Most memory that this process has held at a time [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def options(params: Any) -> dict[str, Any]:
    """The named parameters of a rule, to be passed on as keyword arguments."""
    return dict(params.items())
