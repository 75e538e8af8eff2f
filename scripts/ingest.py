"""Read a real point cloud, and its shots where misses are recorded or can be rebuilt."""

from pathlib import Path

from dapple.check import inspection
from dapple.cloud import selection, shot_sources
from dapple.config.settings import validate
from dapple.formats import clouds, json, shots
from dapple.workflow import run


def main(snakemake):
    params, path = snakemake.params, snakemake.input.cloud
    _look_at_all_input(snakemake)
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
    if params.shots != "none":
        fired, moving = shot_sources.open_shots(
            path,
            cloud,
            source,
            how=params.shots,
            positions=snakemake.input.positions,
            scan_frame=params.scan_frame,
            up=params.up,
        )
        facts = {"scans": []}
        pieces = _pieces(fired, facts)
        shots.write_chunks(snakemake.output.shots, pieces, facts, moving=moving)
        print(facts)


def _look_at_all_input(snakemake):
    """Stop at what is wrong in any file of the run, before its first long job.

    The configuration is no parameter of the rule: an edit of what the points do not depend on
    leaves them as they are.
    """
    settings = validate(snakemake.config, "configuration")
    sensors = settings.sensors.path if settings.sensors.kind == "table" else ""
    inspection.stop_at_errors(
        settings.model_dump(mode="json"),
        cloud=snakemake.input.cloud,
        positions=snakemake.input.positions,
        sensors=Path(settings.data_dir) / sensors if sensors else "",
    )


def _pieces(fired, facts):
    """Shots in pieces; facts of the scans are noted on the way."""
    for of_scan, fact in fired:
        facts["scans"].append(fact)
        yield from shots.parts(of_scan)


if __name__ == "__main__":
    run(main, snakemake)
