"""Read real wood polygons (OBJ in LESS axes) into the local frame."""

from dapple.formats import meshes
from dapple.workflow import run


def main(snakemake):
    wood = meshes.read_obj(snakemake.input.obj, axes="less")
    print(f"{wood.n_elements} polygons, {wood.area_m2:.2f} m²")
    meshes.write_ply(snakemake.output.wood, wood)


if __name__ == "__main__":
    run(main, snakemake)
