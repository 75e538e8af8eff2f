"""Maps of PAR on the ground."""

from dapple.figures import ground_map, style
from dapple.formats import meshes, netcdf
from dapple.structure.stem import stem_position
from dapple.workflow import run


def main(snakemake):
    data = netcdf.read(snakemake.input.map)
    sun = data[["sun_zenith_deg", "sun_azimuth_deg"]].to_dataframe()
    stem = stem_position(meshes.read_ply(snakemake.input.wood))
    figure = ground_map.draw(data["par_umol_m2_s"], stem_m=tuple(stem[:2]), sun=sun)
    style.save(figure, snakemake.output.figure)


if __name__ == "__main__":
    run(main, snakemake)
