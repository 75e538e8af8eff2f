"""Run LESS 3 in a process of its own, anew where it waits for ever."""

import subprocess
import sys
import tempfile
import time
from importlib.util import find_spec
from pathlib import Path

import psutil

from dapple.errors import InputError
from dapple.programs import ProgramError, check_made, failure

IDLE_LIMIT_S = 60.0
"""A process that has done nothing for so long waits for ever [s]."""
ATTEMPTS = 5
STEP_S = 1.0
"""Longest time between two looks at a process [s]."""


def check(key: str) -> None:
    """Refuse a setting (`key: value`) that needs LESS 3 where it is not installed."""
    if find_spec("less") is None:
        raise InputError(
            key,
            "no LESS 3 in this environment",
            "the Python package less3d, version 3.0.0",
            "It has wheels for Linux and Windows on x86-64 with Python 3.10 to 3.13: "
            "`pip install less3d==3.0.0` there, or choose another value.",
        )


def run(script: Path, folder: Path, *, makes: str = "", idle_limit_s: float = IDLE_LIMIT_S) -> str:
    """Run a script that uses LESS 3 on a folder, and return what it printed.

    Parameters
    ----------
    script : Path
        Python, run with `folder` as its argument. What it writes must not depend on what an
        earlier attempt left.
    folder : Path
    makes : str
        File in the folder that the script leaves.
    idle_limit_s : float
        See Notes [s].

    Raises
    ------
    ProgramError
        The exit code is not zero, there is no such file, or each of `ATTEMPTS` attempts waited for
        ever.

    Notes
    -----
    LESS 3.0.0 renders in threads and waits for their word that a pass is done. Once in many
    thousand passes, more often on a busy machine, the word comes just before it begins to wait:
    then it waits without end and without work. Such a process is ended and begun anew.
    """
    command = [sys.executable, str(script), str(folder)]
    for _ in range(ATTEMPTS):
        with tempfile.TemporaryFile("w+") as said:
            process = subprocess.Popen(
                command, stdin=subprocess.DEVNULL, stdout=said, stderr=subprocess.STDOUT
            )
            try:
                code = _end(process, idle_limit_s)
            finally:
                process.kill()
                process.wait()
            said.seek(0)
            text = said.read()
        if code == 0:
            check_made(command, [folder / makes] if makes else [], text)
            return text
        if code is not None:
            raise failure(command, f"exit code {code}", text)
    raise ProgramError(
        " ".join(command),
        f"{ATTEMPTS} attempts that did nothing for {idle_limit_s:g} s",
        "a run of LESS 3 that ends",
        "Run it again when the machine is less busy.",
    )


def _end(process: subprocess.Popen[bytes], idle_limit_s: float) -> int | None:
    """Exit code of a process, or None where it has stopped working."""
    seen = psutil.Process(process.pid)
    used, changed = 0.0, time.monotonic()
    while True:
        try:
            return process.wait(min(STEP_S, idle_limit_s / 4))
        except subprocess.TimeoutExpired:
            now, spent = time.monotonic(), sum(seen.cpu_times()[:2])
        if spent > used:
            used, changed = spent, now
        elif now - changed > idle_limit_s:
            return None
