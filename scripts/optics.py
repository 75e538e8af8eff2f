"""Spectra of leaf, bark and ground in the bands of PAR."""

from dapple.formats import netcdf
from dapple.optics import surfaces
from dapple.workflow import options, run


def main(snakemake):
    netcdf.write_optics(snakemake.output.optics, surfaces.scene_optics(**options(snakemake.params)))


if __name__ == "__main__":
    run(main, snakemake)
