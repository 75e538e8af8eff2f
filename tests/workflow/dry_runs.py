"""Dry runs by the dozen: Snakemake is imported once, every run is a child of that process."""

import io
import multiprocessing
import os
import shutil
import sys
from collections.abc import Iterable, Sequence
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from tests.workflow.project import ENVIRONMENT, ROOT

LIMIT_S = 600
"""For all of them together; they take a minute or two."""


def many(runs: Iterable[tuple[Path, Sequence[str]]]) -> list[str]:
    """What Snakemake says when it is run in a folder with arguments, two at a time."""
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["snakemake.cli"])
    # Not an executor of concurrent.futures: with a process for each task it may wait for ever.
    with context.Pool(2, maxtasksperchild=1) as pool:
        return pool.starmap_async(_run, runs, chunksize=1).get(LIMIT_S)


def _run(folder: Path, arguments: Sequence[str]) -> str:
    from snakemake.cli import main

    os.chdir(folder)
    os.environ.clear()
    os.environ.update(ENVIRONMENT)
    # The copy's own dapple, not that of the tests.
    sys.path[:] = [path for path in sys.path if path != str(ROOT / "scripts")]
    said = io.StringIO()
    with redirect_stdout(said), redirect_stderr(said):
        try:
            main(list(arguments))
        except SystemExit as end:
            if end.code:
                raise AssertionError(said.getvalue()[-6000:]) from None
    return said.getvalue()


def pretend_finished(folder: Path, configfile: str) -> None:
    """Make a copy of the project look as after a run: all files are there, empty, up to date."""
    configured = ["--cores", "1", "--nocolor", "--configfile", configfile]
    (listed,) = many([(folder, ["--summary", *configured])])
    for line in listed.splitlines():
        path = line.split("\t")[0]
        if path.startswith("results/"):
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).touch()
    many([(folder, ["--touch", "--forceall", "--quiet", "all", *configured])])


def clone(folder: Path, to: Path) -> Path:
    """A copy, times and all."""
    shutil.copytree(folder, to, symlinks=True, copy_function=shutil.copy2)
    return to
