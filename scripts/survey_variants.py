"""What makes shadow: the same stands with other leaves, crowns, beams and rules for voxels."""

import dataclasses

import numpy as np
import pandas as pd

from dapple.formats import tables
from dapple.progress import followed
from dapple.streams import stream_seed
from dapple.survey import correction, designs, hemisphere, shadow
from dapple.survey.hemisphere_scanner import Hemisphere
from dapple.survey.voxel_status import Reach, attribute
from dapple.virtual import stands
from dapple.virtual.box_grids import voxels_per_cell
from dapple.virtual.stand_species import SPECIES
from dapple.workflow import options, run

LARGE = {"leaf_length_min_m": 0.14, "leaf_length_max_m": 0.22}
RIEGL = {  # as a VZ-400i: a narrow beam, a sensitive detector, several returns
    "beam_divergence_mrad": 0.35,
    "exit_aperture_m": 0.007,
    "min_energy": 0.05,
    "max_returns": 4,
}
SMALL = {"leaf_length_min_m": 0.06, "leaf_length_max_m": 0.10}
FINEST_DEG = 0.1
"""Finest azimuth step: finer ones cost most."""
VARIANTS = {  # changes of the stand, of the scanner, and any face
    "as in the survey": ({}, {}, False),
    "any face counts": ({}, {}, True),
    "thin beam": ({}, {"beam_divergence_mrad": 0.0, "exit_aperture_m": 0.0, "sub_rays": 1}, False),
    "twice the divergence": ({}, {"beam_divergence_mrad": 8.8}, False),
    "half of the energy": ({}, {"min_energy": 0.05}, False),
    "VZ-400i, four returns": ({}, RIEGL, False),
    "VZ-400i, first return": ({}, RIEGL | {"max_returns": 1}, False),
    "leaves of 14 to 22 cm": (LARGE, {}, False),
    "leaves of 6 to 10 cm": (SMALL, {}, False),
    "400 clumps": ({"n_clumps": 400}, {}, False),
    "60 clumps": ({"n_clumps": 60}, {}, False),
    "crowns from 14 m": ({"crown_base_m": 14.0}, {}, False),
    "crowns of 2.3 m radius": ({"crown_radius_m": 2.3}, {}, False),
    "half of the leaves": ({"leaf_area_index": 2.4}, {}, False),
}


def main(snakemake):
    settings = options(snakemake.params)
    rows = []
    for species, stand_settings in settings["stands"].items():
        variants = followed(list(VARIANTS.items()), f"variants of {species}")
        for name, (tree, beam, any_face) in variants:
            if tree and tree.items() <= SPECIES[species].items():
                continue  # that is what the species is like
            stand = stands.grow(species, **stand_settings | tree)
            rows += [
                {"stand": species, "variant": name} | row
                for row in scanned(stand, settings, beam, any_face)
            ]
    tables.write(snakemake.output.variants, pd.DataFrame(rows))


def scanned(stand, settings, beam, any_face):
    """Shadow, and regression of well covered cells, of the designs with one and five scans."""
    size_m = settings["voxel_size_m"]
    scanner = Hemisphere(**settings["scanner"])
    steps_deg = tuple(step for step in scanner.azimuth_steps_deg if step >= FINEST_DEG - 1e-9)
    scanner = dataclasses.replace(scanner, azimuth_steps_deg=steps_deg, **beam)
    filled = sum(stands.area_in_voxels(stand, part, size_m) for part in ("leaves", "wood")) > 0
    per_edge = voxels_per_cell(settings["cell_size_m"], size_m)
    truth = shadow.in_cells(filled, per_edge)
    world = hemisphere.world_of(stand)
    for design in ("single", "diamond"):
        places_m = designs.positions(design, stand.size_m, settings["height_m"])
        reach = Reach.empty(filled.shape, size_m, any_face)
        for number, place_m in enumerate(places_m):
            seed = stream_seed(settings["seed"], design, number)
            for beams in hemisphere.scan(world, stand, place_m, scanner, len(places_m), seed):
                reach.add(beams)
        flags = reach.joined()
        for bit, n_beams in enumerate(scanner.n_beams(len(places_m))):
            found = attribute(*flags, bit)
            contact, coverage = correction.contact_frequency(found, per_edge)
            well = (coverage > 0.8) & (truth > 0)
            slope, r2, n = correction.regression(truth[well], contact[well])
            yield (
                {"design": design, "n_beams": n_beams, "filled_voxels": int(np.sum(filled))}
                | shadow.relative_shadow(found, filled)
                | {"slope_above_80": slope, "r2_above_80": r2, "n_above_80": n}
            )


if __name__ == "__main__":
    run(main, snakemake)
