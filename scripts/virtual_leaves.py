"""Place virtual leaf polygons along real wood."""

from dapple.formats import meshes
from dapple.virtual.leaves import along_wood
from dapple.workflow import options, run


def main(snakemake):
    wood = meshes.read_ply(snakemake.input.wood)
    leaves = along_wood(wood, **options(snakemake.params))
    print(f"{leaves.n_elements} leaf polygons, {leaves.area_m2:.2f} m²")
    meshes.write_ply(snakemake.output.leaves, leaves)


if __name__ == "__main__":
    run(main, snakemake)
