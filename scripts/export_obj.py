"""Write leaves and wood as OBJ in the axis order of another program."""

from dapple.formats import meshes
from dapple.workflow import run


def main(snakemake):
    for kind in ("leaves", "wood"):
        mesh = meshes.read_ply(snakemake.input[kind])
        meshes.write_obj(snakemake.output[kind], mesh, axes=snakemake.wildcards.axes)


if __name__ == "__main__":
    run(main, snakemake)
