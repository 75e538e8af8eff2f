"""Call functions written in R: one file, one function, plain tables in and out."""

import logging
import os
import threading
from pathlib import Path
from typing import Any

import pandas as pd

from dapple.errors import InputError

REMEDY = (
    "Debian: apt-get install r-base-core r-cran-boot r-cran-lme4; "
    "conda: the packages r-base, r-boot and r-lme4."
)

LIMIT_S = 3600.0
"""Time that a function gets: many times what a fit or thousands of replicates take [s]."""

log = logging.getLogger(__name__)


def call(
    r_file: str | Path,
    function: str,
    *arguments: Any,
    packages: tuple[str, ...] = (),
    limit_s: float = LIMIT_S,
) -> pd.DataFrame:
    """Run one function of an R file.

    Parameters
    ----------
    r_file : str or Path
        R source that defines `function`; it is read into an environment of its own.
    function : str
        Name of the function.
    *arguments : DataFrame, int, float, bool or str
        Passed by position; a DataFrame becomes a `data.frame`.
    packages : tuple of str
        R packages that the function needs.
    limit_s : float
        R ends the function after this time [s].

    Returns
    -------
    DataFrame
        What the function returned, which has to be a `data.frame`.

    Raises
    ------
    InputError
        R or one of the packages is missing, or the R function stopped with an error or took too
        long.
    RuntimeError
        Called outside the main thread: R keeps one stack and crashes on another.
    """
    if threading.current_thread() is not threading.main_thread():
        raise RuntimeError("R runs in the main thread only: call it from a process of its own")
    robjects = _start()
    from rpy2.rinterface_lib.embedded import RRuntimeError
    from rpy2.robjects import default_converter, pandas2ri
    from rpy2.robjects.conversion import localconverter

    _require(robjects, packages)
    environment = robjects.r("new.env()")
    # R itself cannot open a file whose path its locale cannot spell.
    source = robjects.r["parse"](text=Path(r_file).read_text(encoding="utf-8"))
    robjects.r["eval"](source, environment)
    with localconverter(default_converter + pandas2ri.converter):
        try:
            robjects.r["setTimeLimit"](elapsed=limit_s)
            result = environment[function](*map(_plain, arguments))
        except RRuntimeError as error:
            raise InputError(
                f"{Path(r_file).name}: {function}()",
                f"an error in R ({str(error).strip()})",
                "records that the model can be fitted to",
                "Look at the records: enough sensors, finite numbers, values that vary.",
            ) from error
        finally:
            robjects.r["setTimeLimit"]()
    if not isinstance(result, pd.DataFrame):
        raise TypeError(f"{function}() returned {type(result).__name__}, not a data.frame")
    return result


def _plain(argument: Any) -> Any:
    """A table loses its index, which R would turn into row names; the rest stays as it is."""
    return argument.reset_index(drop=True) if isinstance(argument, pd.DataFrame) else argument


def _start():
    """Import rpy2, which starts R in this process, and send R's messages to the log."""
    # The compiled interface exists only where rpy2 was built against this R; ABI always works.
    os.environ.setdefault("RPY2_CFFI_MODE", "ABI")
    library_path = os.environ.get("LD_LIBRARY_PATH")
    try:
        from rpy2 import robjects
        from rpy2.rinterface_lib import callbacks
    except (ImportError, OSError, ValueError, RuntimeError) as error:
        raise InputError(
            "statistics", f"no R that starts ({error})", "R 4.2 or newer on the PATH", REMEDY
        ) from error
    # R puts the system's libraries first, with which a program started later may not work: a Python
    # of another build would load the system's.
    os.environ.pop("LD_LIBRARY_PATH", None)
    if library_path is not None:
        os.environ["LD_LIBRARY_PATH"] = library_path
    callbacks.consolewrite_warnerror = lambda text: log.warning("R: %s", text.strip())
    callbacks.consolewrite_print = lambda text: log.info("R: %s", text.rstrip())
    robjects.r("options(warn = 1)")  # at once: R would keep warnings back until some later call
    return robjects


def _require(robjects, packages: tuple[str, ...]) -> None:
    """Stop with one message that names every R package that is missing."""
    installed = robjects.r("function(name) requireNamespace(name, quietly = TRUE)")
    missing = [name for name in packages if not installed(name)[0]]
    if missing:
        raise InputError(
            "statistics", f"R without {', '.join(missing)}", f"R with {', '.join(packages)}", REMEDY
        )
