"""Reads mutated files one after the other and tells of each; its parent watches and ends it.

Usage: python -m tests.fuzz.worker FOLDER SEED FIRST LAST
"""

import json
import os
import resource
import sys
import traceback
import warnings
from pathlib import Path

import numpy as np
from tests.fuzz import mutations, seeds

from dapple.errors import InputError

MORE_BYTES, TIMES_FILE = 500 << 20, 4
"""Memory that a reader may take beyond its file, and in multiples of it."""


def mutated(sound: seeds.Seed, data: bytes, seed: int, number: int) -> bytes:
    """The file of a number: the same wherever and whenever it is made."""
    return mutations.mutate(data, sound.is_text, np.random.default_rng([seed, number]))


def bound_memory(file_bytes: int) -> None:
    """Let this process take no more than a file of this size may cost."""
    now = int(Path("/proc/self/statm").read_text().split()[0]) * os.sysconf("SC_PAGE_SIZE")
    most = now + MORE_BYTES + TIMES_FILE * file_bytes
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))


def outcome(sound: seeds.Seed, path: Path) -> str:
    """`read`, `refused`, or what a user should never see, with where it came from."""
    try:
        sound.read(path)
    except InputError:
        return "refused"
    except BaseException as error:
        frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.name]
        ours = [frame for frame in frames if "/dapple/" in frame.filename] or frames[-1:]
        at = f"{Path(ours[-1].filename).name}:{ours[-1].lineno} {ours[-1].name}"
        return f"{type(error).__name__} at {at}: {str(error)[:200]}"
    return "read"


def main(folder: Path, seed: int, first: int, last: int) -> None:
    """Read the mutated files `first` to `last` - 1, and say each before and after."""
    warnings.simplefilter("ignore")
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)  # what libraries print is no answer
    os.dup2(1, 2)
    all_seeds = seeds.make(folder)
    contents = [sound.path.read_bytes() for sound in all_seeds]
    for sound in all_seeds:
        outcome(sound, sound.path)  # imports and pools of threads are not the file's fault
    for number in range(first, last):
        which = number % len(all_seeds)
        sound = all_seeds[which]
        data = mutated(sound, contents[which], seed, number)
        sound.path.write_bytes(data)
        bound_memory(len(data))
        print(json.dumps({"number": number}), file=answers)
        said = outcome(sound, sound.path)
        print(json.dumps({"number": number, "said": said}), file=answers)
        sound.path.write_bytes(contents[which])


if __name__ == "__main__":
    main(Path(sys.argv[1]), *map(int, sys.argv[2:5]))
