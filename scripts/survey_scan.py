"""Scan a stand by one design: voxels hit and passed at every density, and plant area density."""

import time

from dapple.formats import voxel_grids
from dapple.progress import followed
from dapple.streams import stream_seed
from dapple.structure.voxel_sums import Grid
from dapple.structure.voxels import plant_area_density
from dapple.survey import designs, grid_files, hemisphere
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.survey.voxel_status import Reach
from dapple.virtual import stands
from dapple.virtual.box_grids import grid_shape
from dapple.workflow import options, run


def main(snakemake):
    settings = options(snakemake.params)
    stand = stands.grow(snakemake.wildcards.stand, **settings["stand"])
    scanner = Hemisphere(**settings["scanner"])
    positions_m = designs.positions(
        snakemake.wildcards.design, stand.size_m, settings["height_m"], settings["positions_m"]
    )
    shape = grid_shape(stand.size_m, settings["voxel_size_m"])
    cells = Grid(
        (0.0, 0.0, 0.0),
        grid_shape(stand.size_m, settings["cell_size_m"]),
        settings["cell_size_m"],
    )
    reach = Reach.empty(shape, settings["voxel_size_m"])
    bit = scanner.azimuth_steps_deg.index(settings["density_step_deg"])
    begun = time.perf_counter()

    def shots():
        world = hemisphere.world_of(stand)
        for number, position_m in enumerate(followed(positions_m, "scan positions")):
            seed = stream_seed(settings["seed"], snakemake.wildcards.design, number)
            for beams in hemisphere.scan(world, stand, position_m, scanner, len(positions_m), seed):
                reach.add(beams)
                if (beams.bits >> bit & 1).any():
                    yield beams.shots(bit, number + 1)

    density = plant_area_density(shots(), cells, contact_voxel_m=0.0)
    hit, passed = reach.joined()
    seconds = time.perf_counter() - begun
    n_beams = scanner.n_beams(len(positions_m))
    print(f"{max(n_beams)} beams of {scanner.sub_rays} rays in {seconds:.1f} s")
    grid_files.write(
        snakemake.output.reach,
        {"hit": hit, "passed": passed},
        n_beams=n_beams,
        voxel_size_m=settings["voxel_size_m"],
    )
    voxel_grids.write(snakemake.output.cells, density)


if __name__ == "__main__":
    run(main, snakemake)
