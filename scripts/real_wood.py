"""Read real polygons (OBJ in LESS axes), of wood or of leaves, into the local frame."""

from dapple.formats import meshes
from dapple.workflow import run


def main(snakemake):
    mesh = meshes.without_backs(meshes.read_obj(snakemake.input.obj, axes="less"))
    print(f"{mesh.n_elements} polygons, {mesh.area_m2:.2f} m²")
    meshes.write_ply(snakemake.output[0], mesh)


if __name__ == "__main__":
    run(main, snakemake)
