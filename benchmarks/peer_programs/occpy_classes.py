"""Run OccPy's voxel traversal in an environment of its own: `python occpy_classes.py IN OUT`.

IN (npz): grid (`low`, `high`, `shape`, `size`), returns (`xyz`, `origin`, `pulse`, `number`,
`count`), shots without one (`miss_origin`, `miss_direction`, `miss_pulse`). OUT (npz): `hit`,
`passed`, `hidden` (nx, ny, nz) counts of pulses, `n_missed` returns that its traversal did not
meet, as it says itself, `cpu_s`.
"""

import sys
import time

import numpy as np
from raytr import PyRaytracer


def columns(xyz):
    """x, y, z as the arrays that the program takes."""
    return [np.ascontiguousarray(column, np.float64) for column in xyz.T]


def main(given, out):
    data = dict(np.load(given))
    integer = {name: np.ascontiguousarray(data[name], np.int32) for name in ("number", "count")}
    begin = time.process_time()
    tracer = PyRaytracer()
    tracer.defineGrid(data["low"], data["high"], *data["shape"].tolist(), float(data["size"]))
    tracer.addPointData(
        *columns(data["xyz"]), *columns(data["origin"]), data["pulse"], *integer.values()
    )
    tracer.doRaytracing()
    n_missed = tracer.get_num_missing_returns()
    tracer.clearPulseDataset()
    tracer.addEmptyPulseData(
        *columns(data["miss_origin"]), *columns(data["miss_direction"]), data["miss_pulse"]
    )
    tracer.doRaytracingEmptyPulses()
    counts = {
        "hit": np.asarray(tracer.getNhit()),
        "passed": np.asarray(tracer.getNmiss()),
        "hidden": np.asarray(tracer.getNocc()),
    }
    np.savez(out, n_missed=n_missed, cpu_s=time.process_time() - begin, **counts)


main(*sys.argv[1:])
