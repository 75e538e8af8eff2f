"""Spectra of leaf, bark and ground in the bands of PAR."""

from dapple.scene import scene_optics
from dapple.workflow import options, run


def main(snakemake):
    scene_optics.write(
        snakemake.output.optics, scene_optics.from_spectra(**options(snakemake.params))
    )


if __name__ == "__main__":
    run(main, snakemake)
