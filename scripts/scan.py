"""Scan a tree with the virtual terrestrial scanner."""

from dapple.formats import clouds, meshes, shots
from dapple.virtual import scanner
from dapple.workflow import options, run


def main(snakemake):
    plant = {
        "leaf": meshes.read_ply(snakemake.input.leaves),
        "wood": meshes.read_ply(snakemake.input.wood),
    }
    settings = options(snakemake.params)
    positions_m = scanner.positions_around(
        plant["wood"],
        n=settings.pop("positions"),
        radius_m=settings.pop("radius_m"),
        height_m=settings.pop("height_m"),
    )
    shots.write_chunks(snakemake.output.shots, scanner.scan_chunks(plant, positions_m, **settings))
    fired = shots.read(snakemake.output.shots)
    print(f"{len(fired)} shots, {(fired.n_returns == 0).mean():.1%} of them misses")
    clouds.write(snakemake.output.points, scanner.to_cloud(fired))


if __name__ == "__main__":
    from snakemake.script import snakemake

    run(main, snakemake)
