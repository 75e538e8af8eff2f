"""Other programs on the shots that dapple takes, in turns: `make peers`.

    python benchmarks/peers.py RUN [--results results] [--output docs/data/peers.csv]

OccPy (voxels that shots hit, pass, or never reach) follows the shots of a finished RUN and is
compared with `dapple.survey.voxel_status`; Helios (leaf area density, beams weighted alike) takes
two million shots through a crown of known density, one return each, and is compared with
`dapple.structure.voxels` and with the truth. Each program has an environment of its own in
`.peers/`, made here from wheels; where one cannot be had, a message says so and the others run.

Every pair runs in turns, `REPEATS` times; times are the least, processor time of all threads,
without starting Python and reading the shots. dapple's compiled code is loaded before.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.formats import shots as shot_files  # noqa: E402
from dapple.formats import tables  # noqa: E402
from dapple.formats.shots import Shots  # noqa: E402
from dapple.structure.voxel_sums import Grid  # noqa: E402
from dapple.structure.voxels import plant_area_density  # noqa: E402
from dapple.survey import voxel_status  # noqa: E402
from dapple.survey.hemisphere import Beams  # noqa: E402

REPEATS = 2
PROGRAMS = Path(__file__).parent / "peer_programs"
ENVIRONMENTS = ROOT / ".peers"
FAR_M = 1000.0
"""Where Helios is told that a shot without a return ended."""

CROWN_M, CROWN_RADIUS_M = np.array([10.0, 10.0, 6.0]), 5.0
"""Centre and radius of the turbid crown: 1 m² of leaves a m³, spherical angles."""
CROWN_SHOTS = 2_000_000
HELIOS_SIZES_M = 0.2
"""Smallest voxels of the crown: smaller ones are met by too few shots to tell anything."""


@dataclass(frozen=True)
class Peer:
    """A program, its wheel, and the script that runs it."""

    name: str
    wheel: str
    also: tuple[str, ...]
    script: str
    needs_all: bool = False
    """False: its wheels ask for viewers that nothing here needs, and only those named are taken."""

    @property
    def python(self) -> Path:
        return ENVIRONMENTS / self.name / "bin/python"

    def install(self) -> str:
        """Make the environment where there is none; the reason why it cannot be had, or ''."""
        if self.python.is_file():
            return ""
        uv = str(Path(sys.executable).with_name("uv"))
        made = subprocess.run(
            [uv, "venv", "-q", "--python", sys.executable, str(ENVIRONMENTS / self.name)],
            capture_output=True, text=True,
        )  # fmt: skip
        if made.returncode == 0:
            alone = [] if self.needs_all else ["--no-deps"]
            made = subprocess.run(
                [
                    uv, "pip", "install", "-q", "--python", str(self.python), *alone,
                    "--only-binary", ":all:", self.wheel, *self.also,
                ],
                capture_output=True, text=True,
            )  # fmt: skip
        return made.stderr.strip() if made.returncode else ""

    def run(self, given: dict) -> dict[str, np.ndarray]:
        """What the script makes of these arrays."""
        with tempfile.TemporaryDirectory() as folder:
            into, out = Path(folder, "in.npz"), Path(folder, "out.npz")
            np.savez(into, **given)
            subprocess.run(
                [str(self.python), str(PROGRAMS / self.script), str(into), str(out)],
                check=True,
                stdout=subprocess.DEVNULL,
            )
            return dict(np.load(out))


OCCPY = Peer("occpy", "occpy-ls==0.3.0", ("numpy==2.4.6",), "occpy_classes.py")
HELIOS = Peer(
    "helios", "pyhelios3d==0.1.38", ("numpy==2.4.6", "pyyaml==6.0.4"), "helios_leaf_area.py"
)


def in_turns(ours: Callable, theirs: Callable[[], dict]) -> tuple[object, dict, float, float]:
    """Both results, and the least processor times [s]."""
    ours()  # compiles
    own, other = [], []
    for _ in range(REPEATS):
        begin = time.process_time()
        result = ours()
        own.append(time.process_time() - begin)
        found = theirs()
        other.append(float(found["cpu_s"]))
    return result, found, min(own), min(other)


def numbers(shots: Shots) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Of every return its shot and its place among the shot's returns from 0; shots without one."""
    shot = shots.shot_of_return
    return shot, np.arange(len(shot)) - shots.first[shot], np.flatnonzero(shots.n_returns == 0)


def beams(shots: Shots, corner_m: np.ndarray) -> list[Beams]:
    """Shots of each scan position as the traversal of voxels takes them."""
    most = max(int(shots.n_returns.max()), 1)
    shot, place, _ = numbers(shots)
    range_m = np.full((len(shots), most), np.inf)
    range_m[shot, place] = shots.range_m
    found = []
    for scan in np.unique(shots.scan):
        own = shots.scan == scan
        origin = shots.origin_m[np.argmax(own)] - corner_m
        bits = np.ones(int(own.sum()), np.uint16)
        found.append(Beams(origin, shots.direction[own], range_m[own], bits))
    return found


def classes(shots: Shots, grid: Grid) -> np.ndarray:
    """Hit, passed or unseen, by dapple (nx, ny, nz)."""
    reach = voxel_status.Reach.empty(grid.shape, grid.size_m, any_face=True)
    for some in beams(shots, grid.corner_m):
        reach.add(some)
    return voxel_status.attribute(*reach.joined(), 0)


def with_occpy(shots: Shots, grid: Grid) -> dict[str, float | str]:
    """A row: the same voxels in the same classes?"""
    shot, place, miss = numbers(shots)
    given = {
        "low": grid.corner_m,
        "high": grid.corner_m + np.multiply(grid.shape, grid.size_m),
        "shape": grid.shape,
        "size": grid.size_m,
        "xyz": shots.return_xyz_m,
        "origin": shots.origin_m[shot],
        "pulse": shot.astype(float),
        "number": place + 1,
        "count": shots.n_returns[shot],
        "miss_origin": shots.origin_m[miss],
        "miss_direction": shots.direction[miss],
        "miss_pulse": miss.astype(float),
    }
    ours, found, own_s, other_s = in_turns(lambda: classes(shots, grid), lambda: OCCPY.run(given))
    theirs = np.where(
        found["hit"] > 0,
        voxel_status.HIT,
        np.where(found["passed"] > 0, voxel_status.PASSED, voxel_status.UNSEEN),
    )
    differ = ours != theirs
    return {
        "peer": "OccPy 0.3.0",
        "what": "voxels hit, passed, never reached",
        "shots": len(shots),
        "voxels": ours.size,
        "dapple_cpu_s": own_s,
        "peer_cpu_s": other_s,
        "agreement": 1.0 - differ.mean(),
        "differ": int(differ.sum()),
        "differ_hit": int((differ & (ours == voxel_status.HIT)).sum()),
        "peer_missed_returns": int(found["n_missed"]),
    }


def turbid_crown(rng: np.random.Generator) -> Shots:
    """Shots of eight scanners, one return each: free paths through a turbid medium."""
    side = CROWN_SHOTS // 8
    angle = np.arange(8) * np.pi / 4
    scanner = CROWN_M + 9.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], 1)
    scanner[:, 2] = 1.6
    azimuth, sine = 2 * np.pi * rng.random(8 * side), rng.uniform(-0.6, 0.99, 8 * side)
    cosine = np.sqrt(1 - sine**2)
    direction = np.stack([cosine * np.cos(azimuth), cosine * np.sin(azimuth), sine], axis=1)
    origin = np.repeat(scanner, side, axis=0)
    to_centre = CROWN_M - origin
    along = (direction * to_centre).sum(axis=1)
    half = np.sqrt(np.maximum(CROWN_RADIUS_M**2 - (to_centre**2).sum(axis=1) + along**2, 0))
    # The extinction of 1 m² m⁻³ is G = 0.5 m⁻¹.
    range_m = np.maximum(along - half, 0) + rng.exponential(2.0, len(along))
    met = (range_m < along + half) & (half > 0)
    blank = np.zeros(np.count_nonzero(met), np.float32)
    scan = np.repeat(np.arange(8, dtype=np.uint16), side)
    first = np.concatenate([[0], np.cumsum(met)])
    return Shots(origin, direction, scan, first, range_m[met], blank, blank, np.zeros(3))


def with_helios(shots: Shots, grid: Grid) -> dict[str, float | str]:
    """A row: leaf area density of a crown in which it is 1 m² m⁻³ everywhere."""
    shot, place, miss = numbers(shots)
    pulse = np.concatenate([shot, miss])
    xyz = np.concatenate([shots.return_xyz_m, shots.origin_m[miss] + FAR_M * shots.direction[miss]])
    order = np.argsort(pulse, kind="stable")
    pulse, xyz = pulse[order], xyz[order]
    number = np.concatenate([place, np.zeros(len(miss), int)])[order]
    away = shots.direction[pulse]
    sphere = [
        np.linalg.norm(xyz - shots.origin_m[pulse], axis=1),
        np.arcsin(away[:, 2]),
        np.arctan2(away[:, 0], away[:, 1]) % (2 * np.pi),
    ]
    given = {
        "low": grid.corner_m,
        "shape": grid.shape,
        "size": grid.size_m,
        "scanner": shots.origin_m[np.unique(shots.scan, return_index=True)[1]],
        "scan": shots.scan[pulse],
        "xyz": xyz,
        "sphere": np.stack(sphere, axis=1),
        "pulse": pulse,
        "number": number,
        "count": np.maximum(shots.n_returns[pulse], 1),
        "is_miss": shots.n_returns[pulse] == 0,
    }
    ours, found, own_s, other_s = in_turns(
        lambda: plant_area_density(shots, grid), lambda: HELIOS.run(given)
    )
    axes = (ours[axis].to_numpy() for axis in "xyz")
    away_m = np.linalg.norm(np.stack(np.meshgrid(*axes, indexing="ij"), -1) - CROWN_M, axis=-1)
    inside = away_m + grid.size_m * np.sqrt(3) / 2 < CROWN_RADIUS_M
    own = ours["pad_transmittance_m2_m3"].to_numpy()
    inside &= np.isfinite(own)  # where a beam came
    own, other = own[inside], found["density"][inside]
    return {
        "peer": "Helios 0.1.38",
        "what": "leaf area density by transmittance",
        "shots": len(shots),
        "voxels": grid.n_voxels,
        "dapple_cpu_s": own_s,
        "peer_cpu_s": other_s,
        "agreement": np.corrcoef(own, other)[0, 1],
        "dapple_bias": own.mean() - 1.0,
        "peer_bias": other.mean() - 1.0,
        "dapple_rmse": np.sqrt(np.mean((own - 1.0) ** 2)),
        "peer_rmse": np.sqrt(np.mean((other - 1.0) ** 2)),
    }


def rows(shots: Shots, sizes_m: list[float]) -> Iterator[dict]:
    """Every program that can be had, at every voxel size."""
    # The scanners are inside: OccPy loses 3 % of the returns of beams that come from outside.
    hit = shots.return_xyz_m
    hit = hit[np.linalg.norm(hit[:, :2], axis=1) < np.linalg.norm(shots.origin_m[0, :2])]
    seen = np.concatenate([hit, np.unique(shots.origin_m, axis=0)])
    box = np.stack([seen.min(axis=0), seen.max(axis=0) + 0.5])
    turbid = turbid_crown(np.random.default_rng(1))
    around_crown = np.array([CROWN_M - CROWN_RADIUS_M, CROWN_M + CROWN_RADIUS_M])
    for peer in (OCCPY, HELIOS):
        if reason := peer.install():
            print(f"peers: {peer.name} is left out, its wheels cannot be had: {reason}")
            continue
        for size_m in sizes_m:
            if peer is OCCPY:
                found = with_occpy(shots, Grid.around(box, size_m))
            elif size_m >= HELIOS_SIZES_M:
                found = with_helios(turbid, Grid.around(around_crown, size_m))
            else:
                continue
            yield {"voxel_size_m": size_m} | found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--sizes", type=float, nargs="+", default=[1.0, 0.2, 0.1])
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data/peers.csv")
    options = parser.parse_args()
    shots = shot_files.read(options.results / options.run / "scan/shots.parquet")
    found = pd.DataFrame(rows(shots, options.sizes))
    if found.empty:
        sys.exit("peers: no program could be had; nothing was compared")
    found.insert(0, "run", options.run)
    found["ratio"] = found["peer_cpu_s"] / found["dapple_cpu_s"]
    print(found.to_string(index=False))
    tables.write(options.output, found)


if __name__ == "__main__":
    main()
