"""Run Eradiate on a canopy of discs in an environment of its own: `python ... IN OUT`.

IN (npz): files of discs and places (`discs`, `places`), edges of the box that is repeated sideways
(`size`), how often it is set around itself (`padding`), `leaf_reflectance`, `leaf_transmittance`,
`ground_reflectance`, `sun_zenith`, `view_zenith` in the plane of the sun [deg], `samples` of a view
in each of `sets` independent sets. OUT (npz): `brf` (sets, views), `build_cpu_s`, `cpu_s`.
"""

import sys
import time

import eradiate
import numpy as np
from eradiate import unit_registry as unit
from eradiate.rng import SeedState
from eradiate.scenes.biosphere import DiscreteCanopy


def uniform(value):
    return {"type": "uniform", "value": float(value)}


def experiment(given):
    cell = given["size"]
    canopy = DiscreteCanopy.leaf_cloud_from_files(
        size=cell * unit.m,
        leaf_cloud_dicts=[
            {
                "sub_id": "discs",
                "instance_filename": str(given["places"]),
                "leaf_cloud_filename": str(given["discs"]),
                "leaf_reflectance": uniform(given["leaf_reflectance"]),
                "leaf_transmittance": uniform(given["leaf_transmittance"]),
            }
        ],
    )
    east, north = (float(length) / 2 for length in cell[:2])
    target = {"xmin": -east, "xmax": east, "ymin": -north, "ymax": north, "z": float(cell[2])}
    view = {
        "type": "mdistant",
        "construct": "hplane",
        "zeniths": given["view_zenith"] * unit.deg,
        "azimuth": 0.0 * unit.deg,
        "target": {"type": "rectangle"} | target,
        "srf": {"type": "delta", "wavelengths": 850.0},
    }
    sun = {"type": "directional", "zenith": float(given["sun_zenith"]) * unit.deg}
    return eradiate.experiments.CanopyExperiment(
        surface={"type": "lambertian", "reflectance": uniform(given["ground_reflectance"])},
        canopy=canopy.padded_copy(int(given["padding"])),
        illumination=sun | {"azimuth": 0.0 * unit.deg, "irradiance": uniform(1.0)},
        measures=view,
    )


def main(given, out):
    data = dict(np.load(given))
    eradiate.set_mode("mono_single")
    begin = time.process_time()
    run = experiment(data)
    run.init()
    built = time.process_time()
    brf = []
    for seed in range(int(data["sets"])):
        run.process(spp=int(data["samples"]), seed_state=SeedState(seed))
        run.postprocess()
        brf.append(run.results["measure"].brf.values.squeeze())
    end = time.process_time()
    np.savez(out, brf=np.array(brf), build_cpu_s=built - begin, cpu_s=end - built)


main(*sys.argv[1:])
