"""Read a real point cloud, and its shots where misses are recorded or can be rebuilt."""

import pandas as pd

from dapple.cloud.ingest import shots_from_scan
from dapple.cloud.lattice import ScanFrame
from dapple.cloud.ordered import shots_from_ptx
from dapple.formats import clouds, shots
from dapple.frames import to_local
from dapple.workflow import run


def main(snakemake):
    params, path = snakemake.params, snakemake.input.cloud
    cloud = clouds.read(path)
    for attribute in params.required:
        clouds.require(cloud, attribute, path)
    print(f"{path}: {len(cloud)} points, origin {cloud.origin_m.tolist()}")
    clouds.write(snakemake.output.points, cloud)
    match params.shots:
        case "recorded":
            fired, facts = shots_from_ptx(path, origin_m=cloud.origin_m)
        case "scan_frame":
            position_m = _scan_position(snakemake.input.positions, cloud)
            frame = ScanFrame(**params.scan_frame)
            fired, facts = shots_from_scan(cloud, position_m, frame, source=path)
        case "none":
            return
    print(facts)
    shots.write(snakemake.output.shots, fired, {"scans": facts})


def _scan_position(path, cloud):
    """The scanner stands at the cloud's own zero where no table says otherwise."""
    world_m = pd.read_csv(path)[["x", "y", "z"]].to_numpy()[0] if path else [0.0, 0.0, 0.0]
    return to_local(world_m, cloud.origin_m)


if __name__ == "__main__":
    run(main, snakemake)
