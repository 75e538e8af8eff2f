"""How LESS 3's time grows with the number of turbid voxels: why those of 0.2 m have no day there.

    python benchmarks/less_voxels.py RUN [--results results] [--counts N ...] [--output FILE]

Of the voxels of a finished RUN with leaves in them, those nearest to their middle are kept, more at
each row, and one sensor is computed at one time: LESS' processor time to build the scene, and that
of the run. The last column is the exponent with which building grows from the row before.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from less3 import by_less  # noqa: E402

from dapple.formats import netcdf, tables  # noqa: E402
from dapple.scene import scene_files, scene_optics  # noqa: E402
from dapple.scene.surfaces import Scene  # noqa: E402
from dapple.structure.voxel_data import DENSITY  # noqa: E402


def nearest(voxels: xr.Dataset, count: int | None) -> tuple[xr.Dataset, int]:
    """Voxels of which only some have leaves, those nearest to their middle; how many these are."""
    data = voxels.transpose("x", "y", "z")
    density = np.nan_to_num(data[DENSITY].to_numpy())
    place = np.argwhere(density > 0)
    away = np.linalg.norm(place - place.mean(axis=0), axis=1)
    kept = place[np.argsort(away, kind="stable")[:count]]
    some = np.zeros_like(density)
    some[tuple(kept.T)] = density[tuple(kept.T)]
    return data.assign({DENSITY: (tuple("xyz"), some)}), len(kept)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--counts", type=int, nargs="+", default=[250, 500, 1000, 2000])
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data/less_voxels.csv")
    options = parser.parse_args()
    folder = options.results / options.run
    sky, optics = netcdf.read(folder / "sky/sky.nc"), scene_optics.read(folder / "sky/optics.nc")
    sky = sky.isel(time=[sky.sizes["time"] // 2])
    sensor = tables.read(folder / "sky/sensors.csv").iloc[[0]]
    leaves, wood = folder / "structure/voxels_0.2/voxels.nc", folder / "structure/polygons/wood.ply"
    scene = scene_files.read([str(leaves)], str(wood))[0]
    assert scene.voxels is not None
    all_voxels = nearest(scene.voxels, None)[1]
    rows: list[dict[str, float]] = []
    for count in options.counts:
        voxels, kept = nearest(scene.voxels, count)
        part = Scene(scene.surfaces, voxels, scene.ground_z_m)
        *_, build, simulate = by_less(part, sky, optics, sensor)
        row = {"voxels": kept, "of": all_voxels, "build_cpu_s": build[0], "run_cpu_s": simulate[0]}
        if rows:
            former = rows[-1]
            steeper = np.log(build[0] / former["build_cpu_s"]) / np.log(kept / former["voxels"])
            row["exponent"] = float(steeper)
        rows.append(row)
        print(row, flush=True)
    tables.write(options.output, pd.DataFrame(rows))


if __name__ == "__main__":
    main()
