"""Run Helios' inversion of leaf area in an environment of its own: `python ... IN OUT`.

IN (npz): grid (`low`, `shape`, `size`), scanners (`scanner`, (k, 3)), and of every return, or a
far point where a shot has none: `scan`, `xyz`, `sphere` (range, elevation, azimuth), `pulse`,
`number`, `count`, `is_miss`. OUT (npz): `density` (nx, ny, nz) leaf area density [m² m⁻³], `cpu_s`.
"""

import sys
import time

import numpy as np
from pyhelios import Context, LiDARCloud

LABELS = ["timestamp", "target_index", "target_count", "is_miss"]
G_SPHERICAL, MIN_HITS, ELEMENT_M = 0.5, 1, 0.0


def main(given, out):
    data = dict(np.load(given))
    shape, size = data["shape"], float(data["size"])
    facts = np.stack([data[name] for name in ("pulse", "number", "count", "is_miss")], axis=1)
    begin = time.process_time()
    with Context() as context, LiDARCloud() as cloud:
        cloud.disableMessages()
        for scan, scanner in enumerate(data["scanner"]):
            # The raster of angles is not used where misses are given.
            number = cloud.addScan(scanner.tolist(), 1000, (0, 3.14), 1000, (0, 6.28), 0.0, 0.0)
            own = data["scan"] == scan
            cloud.addHitPointsWithData(
                number, data["xyz"][own], data["sphere"][own], LABELS, facts[own]
            )
        extent = shape * size
        cloud.addGrid((data["low"] + extent / 2).tolist(), extent.tolist(), shape.tolist())
        cloud.calculateHitGridCell()
        cloud.calculateLeafArea(context, MIN_HITS, ELEMENT_M, G_SPHERICAL)
        cells = range(cloud.getGridCellCount())
        density = np.array([cloud.getCellLeafAreaDensity(k) for k in cells])
    seconds = time.process_time() - begin
    np.savez(out, density=density.reshape(shape[::-1]).T, cpu_s=seconds)


main(*sys.argv[1:])
