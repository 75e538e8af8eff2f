"""Scan a tree with the virtual terrestrial scanner."""

from dapple.formats import clouds, meshes, shots
from dapple.structure.stem import stem_position
from dapple.virtual import scanner
from dapple.workflow import options, run


def main(snakemake):
    plant = {
        "leaf": meshes.read_ply(snakemake.input.leaves),
        "wood": meshes.read_ply(snakemake.input.wood),
    }
    settings = options(snakemake.params)
    centre_m = stem_position(plant["wood"])
    centre_m[2] = settings["ground_z_m"]
    positions_m = scanner.positions_around(
        centre_m,
        n=settings.pop("positions"),
        radius_m=settings.pop("radius_m"),
        height_m=settings.pop("height_m"),
    )
    fired = scanner.scan_chunks(plant, positions_m, **settings)
    n_shots = shots.write_chunks(snakemake.output.shots, fired)
    scanned = shots.read(snakemake.output.shots)
    print(f"{n_shots} shots, {(scanned.n_returns == 0).mean():.1%} of them misses")
    clouds.write(snakemake.output.points, shots.to_cloud(scanned))


if __name__ == "__main__":
    run(main, snakemake)
