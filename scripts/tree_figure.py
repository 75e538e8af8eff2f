"""The reconstructed tree from the side and from above, with the sensors."""

from dapple.figures import style, tree
from dapple.formats import tables
from dapple.scene import scene_files
from dapple.workflow import run


def main(snakemake):
    scene = scene_files.read([snakemake.input.leaves], snakemake.input.wood)[0]
    sensors = tables.read(snakemake.input.sensors)
    style.save(tree.draw(scene, sensors=sensors), snakemake.output.figure)


if __name__ == "__main__":
    run(main, snakemake)
