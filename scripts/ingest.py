"""Read a real point cloud, and its shots where misses are recorded or can be rebuilt."""

import pandas as pd

from dapple.cloud import ordered, selection
from dapple.cloud.ingest import shots_from_scan
from dapple.cloud.lattice import ScanFrame
from dapple.formats import clouds, json, shots
from dapple.frames import to_local
from dapple.workflow import run


def main(snakemake):
    params, path = snakemake.params, snakemake.input.cloud
    cloud, source = selection.take(
        *clouds.read_with_source(path), path, unit=params.unit, up=params.up
    )
    for attribute in params.required:
        clouds.require(cloud, attribute, path, source.notes)
    print(f"{path}: {len(cloud)} points, origin {cloud.origin_m.tolist()}")
    print(*(f"left out: {n:,} points, {why}" for why, n in source.left_out.items()), sep="\n")
    print(*source.notes, sep="\n")
    clouds.write(snakemake.output.points, cloud)
    json.write(snakemake.output.frame, {"origin_m": cloud.origin_m, "crs": source.crs})
    facts = {"scans": []}
    match params.shots:
        case "recorded":
            fired = _recorded(path, cloud.origin_m, facts)
            shots.write_chunks(snakemake.output.shots, fired, facts)
        case "scan_frame":
            position_m = _scan_position(snakemake.input.positions, cloud)
            frame = ScanFrame(**params.scan_frame)
            fired, facts = shots_from_scan(cloud, position_m, frame, source=path)
            shots.write(snakemake.output.shots, fired, {"scans": facts})
        case "none":
            return
    print(facts)


def _recorded(path, origin_m, facts):
    """The shots of every scan, in pieces; facts of the scans are noted on the way."""
    for fired, fact in ordered.shots_from_file(path, origin_m):
        facts["scans"].append(fact)
        yield from shots.parts(fired)


def _scan_position(path, cloud):
    """The scanner stands at the cloud's own zero where no table says otherwise."""
    world_m = pd.read_csv(path)[["x", "y", "z"]].to_numpy()[0] if path else [0.0, 0.0, 0.0]
    return to_local(world_m, cloud.origin_m)


if __name__ == "__main__":
    run(main, snakemake)
