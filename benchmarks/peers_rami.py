"""HET01's reflectance factors by dapple and by Eradiate, in turns: a part of `make peers`.

    python benchmarks/peers_rami.py [DATA] [--output docs/data/peers_rami.csv]

DATA holds RAMI's discs, as in `rami.py`; without them nothing is compared. Both programs take the
same discs, sun, soil and eleven views. dapple repeats the cell without end and traces both bands at
once; Eradiate sets `PADDING` cells around it and traces a band at a time. Standard errors are those
of independent sets, and the ratio of times is that at equal ones: time goes with their square.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

import rami  # noqa: E402
from peers import Peer  # noqa: E402

from dapple.formats import tables  # noqa: E402
from dapple.frames import direction_from_angles  # noqa: E402
from dapple.light import brf  # noqa: E402

ERADIATE = Peer("eradiate", "eradiate[kernel]==1.2.0", ("numpy==2.4.6",), "eradiate_brf.py", True)
VIEW_ZENITH_DEG = np.arange(-75.0, 76.0, 15.0)
SETS = 32
PATHS, SAMPLES = 48_000, 128_000
"""Of a view, in all sets together: dapple's and Eradiate's."""
PADDING = 4
"""Cells of 100 m on each side: a view at 75 degrees leaves the 31 m of the canopy within 116 m."""
HEIGHT_M = 31.0


def ours(folder: Path) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """Reflectance factors and standard errors (views, cases), and processor times [s]."""
    begin = time.process_time()
    scene, _ = rami.load(folder, "llvm_ad_rgb")
    azimuth = np.where(VIEW_ZENITH_DEG < 0, 180.0, 0.0) + rami.SUN_AZIMUTH_DEG
    views = brf.over_cell(scene, -direction_from_angles(np.abs(VIEW_ZENITH_DEG), azimuth))
    sun = direction_from_angles(rami.SUN_ZENITH_DEG, rami.SUN_AZIMUTH_DEG)

    def received(n_paths: int) -> brf.Received:
        return brf.collect(scene, views, sun, n_paths=n_paths, max_orders=250, seed=1)

    received(SETS)  # compiles
    built = time.process_time()
    values, errors = brf.reflectance_factor(received(PATHS), rami.OPTICS)
    end = time.process_time()
    return values, errors, {"dapple_build_cpu_s": built - begin, "dapple_cpu_s": end - built}


def theirs(folder: Path, case: int) -> tuple[np.ndarray, np.ndarray, dict[str, float]]:
    """As `ours`, of one case, by Eradiate."""
    optics = rami.OPTICS
    size_m = rami.CELL_M[1] - rami.CELL_M[0]
    found = ERADIATE.run(
        {
            "discs": str(folder / "het01_UNI_sphere.def"),
            "places": str(folder / "het01_UNI_instances.def"),
            "size": np.append(size_m, HEIGHT_M),
            "padding": PADDING,
            "leaf_reflectance": optics.reflectance["leaf"][case],
            "leaf_transmittance": optics.transmittance["leaf"][case],
            "ground_reflectance": optics.reflectance["ground"][case],
            "sun_zenith": rami.SUN_ZENITH_DEG,
            "view_zenith": VIEW_ZENITH_DEG,
            "samples": SAMPLES // SETS,
            "sets": SETS,
        }
    )
    values = found["brf"].mean(axis=0)
    errors = found["brf"].std(axis=0, ddof=1) / np.sqrt(SETS)
    times = {"peer_build_cpu_s": float(found["build_cpu_s"]), "peer_cpu_s": float(found["cpu_s"])}
    return values, errors, times


def rows(folder: Path) -> pd.DataFrame:
    """A row a case."""
    found = []
    for case, name in enumerate(rami.CASES):
        values, errors, own_times = ours(folder)
        own, own_error = values[:, case], errors[:, case]
        other, other_error, other_times = theirs(folder, case)
        both = np.hypot(own_error, other_error)
        row = {
            "peer": "Eradiate 1.2.0",
            "case": name,
            "views": len(own),
            **own_times,
            **other_times,
            "dapple_error_rel": np.mean(own_error) / own.mean(),
            "peer_error_rel": np.mean(other_error) / own.mean(),
            "r": np.corrcoef(own, other)[0, 1],
            "bias_rel": other.mean() / own.mean() - 1.0,
            "bias_error_rel": np.sqrt(np.sum(both**2)) / len(own) / own.mean(),
            "largest_z": np.abs((other - own) / both).max(),
        }
        worse = row["peer_error_rel"] / row["dapple_error_rel"]
        row["ratio"] = row["peer_cpu_s"] / row["dapple_cpu_s"] * worse**2
        found.append(row)
    return pd.DataFrame(found)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("data", type=Path, nargs="?", default=ROOT / "../shared/data/rami")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data/peers_rami.csv")
    options = parser.parse_args()
    if not (options.data / "het01_UNI_sphere.def").is_file():
        print(f"peers: {options.data} holds no RAMI scene; Eradiate is left out")
        return
    if reason := ERADIATE.install():
        print(f"peers: {ERADIATE.name} is left out, its wheels cannot be had: {reason}")
        return
    found = rows(options.data.resolve())
    print(found.T.to_string())
    tables.write(options.output, found)


if __name__ == "__main__":
    main()
