"""Scan a stand from every candidate position, each with the coarsest density."""

import dataclasses

import numpy as np

from dapple.progress import followed
from dapple.streams import stream_seed
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
    scanner = dataclasses.replace(scanner, azimuth_steps_deg=(max(scanner.azimuth_steps_deg),))
    world = hemisphere.world_of(stand)
    places_m = designs.candidates(stand.size_m, settings["height_m"], settings["along"])
    places_m = [place for place in places_m if not hemisphere.is_inside_wood(world, place)]
    shape = grid_shape(stand.size_m, settings["voxel_size_m"])
    reach = Reach.empty(shape, settings["voxel_size_m"], dtype=np.uint32)
    for number, place_m in enumerate(followed(places_m, "places of a scanner")):
        seed = stream_seed(settings["seed"], "candidate", number)
        for beams in hemisphere.scan(world, stand, place_m, scanner, 1, seed):
            reach.add(beams, np.full(len(beams.range_m), 1 << number))
    hit, _ = reach.joined()
    print(f"{len(places_m)} places where a scanner can stand")
    grid_files.write(
        snakemake.output.reach,
        {"hit": hit},
        positions_m=np.ravel(places_m),
        zenith_step_deg=scanner.zenith_step_deg,
        azimuth_step_deg=scanner.azimuth_steps_deg[0],
    )


if __name__ == "__main__":
    run(main, snakemake)
