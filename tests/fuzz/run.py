"""Hand every reader broken files: each is read or refused with a message, soon, in little memory.

Usage: PYTHONPATH=scripts python -m tests.fuzz.run [--count 20000] [--seed 1] [--keep FOLDER]
[--table FILE]
Prints how many were read and refused and every kind of fault with the number that makes it again;
exits 1 where there is one. The table has a row for every sound file and seed; rows of other seeds
that it has stay.
"""

import argparse
import json
import os
import selectors
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from dataclasses import dataclass, field
from pathlib import Path

import pandas as pd
from tests.fuzz import seeds, worker

ROOT = Path(__file__).parents[2]
HANG_S = 10.0
"""Of processor time, which a busy machine does not stretch; asleep, a reader has `ASLEEP_S`."""
ASLEEP_S = 120.0


@dataclass
class Result:
    """Counts of outcomes by name of the sound file, and faults with the numbers that make them."""

    counts: dict[str, Counter] = field(default_factory=lambda: defaultdict(Counter))
    faults: dict[tuple[str, str], list[int]] = field(default_factory=lambda: defaultdict(list))

    def add(self, name: str, number: int, said: str) -> None:
        if said in ("read", "refused"):
            self.counts[name][said] += 1
        else:
            self.counts[name]["fault"] += 1
            self.faults[name, said.split(": ")[0]].append(number)


def run(count: int, seed: int, folder: Path, names: list[str]) -> Result:
    """Read `count` mutated files in child processes, a new one after each crash or hang."""
    result, number = Result(), 0
    while number < count:
        number = _batch(number, count, seed, folder, names, result)
    return result


def _batch(first: int, last: int, seed: int, folder: Path, names: list[str], result: Result) -> int:
    """Follow one child; the number from which the next one goes on."""
    paths = {"PYTHONPATH": f"{ROOT / 'scripts'}:{ROOT}", "MALLOC_ARENA_MAX": "2"}
    command = [sys.executable, "-m", "tests.fuzz.worker", folder, seed, first, last]
    with subprocess.Popen(
        list(map(str, command)), stdout=subprocess.PIPE, env=os.environ | paths, cwd=ROOT
    ) as child:
        reader, open_number = selectors.DefaultSelector(), -1
        assert child.stdout is not None
        reader.register(child.stdout, selectors.EVENT_READ)
        rest, since, used_s = b"", time.monotonic(), 0.0
        while True:
            if not reader.select(1.0):
                busy_s = _processor_s(child.pid) - used_s
                if (busy_s < HANG_S or open_number < 0) and time.monotonic() - since < ASLEEP_S:
                    continue
                child.kill()
                if open_number < 0:
                    raise RuntimeError("the child that reads files did not start")
                result.add(names[open_number % len(names)], open_number, f"no end in {HANG_S} s")
                return open_number + 1
            piece = os.read(child.stdout.fileno(), 1 << 16)
            if not piece:
                break
            since, used_s = time.monotonic(), _processor_s(child.pid)
            *lines, rest = (rest + piece).split(b"\n")
            for answer in map(json.loads, lines):
                open_number = answer["number"] if "said" not in answer else -1
                if "said" in answer:
                    done = answer["number"]
                    result.add(names[done % len(names)], done, answer["said"])
                    first = done + 1
    if open_number >= 0:
        said = f"the process ended with {child.returncode}"
        result.add(names[open_number % len(names)], open_number, said)
        return open_number + 1
    if first < last and child.returncode:
        raise RuntimeError(f"the child that reads files ended with {child.returncode}")
    return first


def _put_down(result: Result, seed: int, path: Path) -> None:
    """The counts of a run into the table of all runs."""
    rows = [
        {"seed": seed, "file": name} | {what: counts[what] for what in ("read", "refused", "fault")}
        for name, counts in result.counts.items()
    ]
    table = pd.DataFrame(rows)
    if path.exists():
        table = pd.concat([pd.read_csv(path).query("seed != @seed"), table])
    table.sort_values(["seed", "file"]).to_csv(path, index=False)


def _processor_s(pid: int) -> float:
    """Seconds of processor time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def main() -> int:
    arguments = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    arguments.add_argument("--count", type=int, default=20_000)
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--keep", type=Path, help="folder for a file of every kind of fault")
    arguments.add_argument("--table", type=Path, help="for the counts")
    given = arguments.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        sound = seeds.make(Path(folder))
        contents = [one.path.read_bytes() for one in sound]
        result = run(given.count, given.seed, Path(folder), [one.path.name for one in sound])
    for name, counts in result.counts.items():
        print(f"{name:20s} " + ", ".join(f"{n} {what}" for what, n in sorted(counts.items())))
    if given.table:
        _put_down(result, given.seed, given.table)
    total = sum(result.counts.values(), Counter())
    print("in all: " + ", ".join(f"{n} {what}" for what, n in sorted(total.items())))
    for k, ((name, said), numbers) in enumerate(sorted(result.faults.items())):
        print(f"FAULT {name}: {said} ({len(numbers)} times, first number {numbers[0]})")
        if given.keep:
            given.keep.mkdir(parents=True, exist_ok=True)
            which = numbers[0] % len(sound)
            data = worker.mutated(sound[which], contents[which], given.seed, numbers[0])
            (given.keep / f"{k:03d}_{name}").write_bytes(data)
    return int(bool(result.faults))


if __name__ == "__main__":
    sys.exit(main())
