"""Predict the shots of positions from what the other positions show of a tree."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from dapple import steps
from dapple.formats import clouds, meshes, shots, tables
from dapple.progress import followed
from dapple.structure.voxel_sizes import size_of
from dapple.virtual.left_out import seen_from
from dapple.workflow import evenly, options, run


@dataclass(frozen=True)
class Scan:
    """Classified points, and shots of some positions and of all others."""

    path: str
    cloud: clouds.Cloud

    def fired(self, positions: list[int], *, others: bool = False) -> Iterator[shots.Shots]:
        for chunk in shots.iterate(self.path):
            yield shots.select(chunk, np.isin(chunk.scan, positions) ^ others)


def main(snakemake):
    inputs, settings = snakemake.input, options(snakemake.params)
    name, n_left_out = snakemake.wildcards.reconstruction, settings.pop("positions")
    making = {key: settings.pop(key) for key in ("polygons", "surfels", "voxels", "points")}
    scan = Scan(inputs.shots, clouds.read(inputs.classes))
    positions = sorted({int(p) for chunk in scan.fired([], others=True) for p in set(chunk.scan)})
    truth = None
    if name == "truth":
        truth = {kind: meshes.read_ply(inputs[kind]) for kind in ("leaf", "wood")}, None
    tables_found = []
    for k in followed(evenly(len(positions), n_left_out), "scan positions left out"):
        left_out = [positions[k]]
        is_new = truth is None and len(positions) > 1
        made = truth or rebuilt(name, scan, left_out if is_new else [], **making)
        found = steps.rescan(*made, scan.fired(left_out), scan.cloud, **settings)
        found.insert(0, "position", positions[k])
        found.insert(1, "left_out", is_new)
        print(f"position {positions[k]}: {found['right_share'][0]:.1%} of shots right")
        tables_found.append(found)
    table = pd.concat(tables_found, ignore_index=True)
    table.insert(0, "reconstruction", name)
    tables.write(snakemake.output.table, table)


def rebuilt(name: str, scan: Scan, without: list[int], *, polygons, surfels, voxels, points):
    """Meshes and voxels of a reconstruction that has not seen some positions."""
    others = lambda: scan.fired(without, others=True)  # noqa: E731
    cloud = seen_from(others(), scan.cloud, **points) if without else scan.cloud
    made: dict[str, Any] = steps.polygons(cloud, **polygons)
    if name == "surfels":
        made["leaf"], _ = steps.surfels(cloud, others(), **surfels)
    if not name.startswith("voxels_"):
        return made, None
    kinds = steps.return_kinds(scan.cloud, points["majority_voxel_m"])
    density = steps.voxels(others(), cloud, size_of(name), kinds=kinds, **voxels)
    return {"wood": made["wood"]}, density


if __name__ == "__main__":
    run(main, snakemake)
