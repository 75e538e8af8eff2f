"""How virtual leaves are placed on the published apple tree, chosen on the fitting half alone.

    PYTHONPATH=scripts python benchmarks/leaves.py [--folder results/apple] [--placements 3]

Needs the wood, the sensors and the records that a run of config/apple.yaml has read. For every
longest shoot and thinness of wood the frame and the clock are fitted again on the fitting sensors;
the table tells the correlation with those sensors' records, and reads no others.
"""

import argparse
import itertools
import sys
from pathlib import Path

import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.config.settings import validate
from dapple.formats import json, meshes
from dapple.registration import shading
from dapple.scene import sensors
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.radiation_series import broadband
from dapple.sky.sky_radiance import sky_dataset
from dapple.sky.sun import Site
from dapple.stats import measured
from dapple.streams import stream_seed
from dapple.virtual.leaves import along_wood

MAX_DISTANCE_M = (0.2, 0.3, 0.4, 0.5)
THIN_WOOD_M2 = (0.0005, 0.001, 0.002)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("results/apple"))
    parser.add_argument("--placements", type=int, default=3)
    parser.add_argument("--clock", type=float, default=300.0, help="largest clock offset, s")
    options = parser.parse_args()
    settings = validate(yaml.safe_load((options.folder / "config.yaml").read_text()))
    fitting = json.read(options.folder / "registration/registration.json")["fitting_sensors"]
    wood = meshes.read_ply(options.folder / "structure/polygons/wood.ply")
    data = Path(settings.data_dir)
    table = sensors.read(
        data / settings.sensors.path, settings.registration.origin_m, **settings.sensors.table()
    )
    path = data / settings.measured.path
    records = measured.read(path, sensors=table, **settings.measured.table()).table
    records = records[records["sensor"].isin(fitting)]
    site = Site(**settings.site.model_dump(exclude={"timezone"}))
    columns = settings.radiation.broadband()

    def sky_at(times):
        path = data / settings.radiation.path
        radiation = broadband(times, site, path=path, **columns)
        return sky_dataset(times, site, radiation.values, model="perez")

    print("max_distance_m  thin_wood_m2  r_fit  east_m  north_m  clock_s", flush=True)
    rows = []
    for max_distance_m, thin_wood_m2 in itertools.product(MAX_DISTANCE_M, THIN_WOOD_M2):
        placing = settings.leaves.model_dump(exclude={"placements"})
        placing |= {"max_distance_m": max_distance_m, "thin_wood_m2": thin_wood_m2}
        leaves = [
            along_wood(wood, **placing, seed=stream_seed(11, k)) for k in range(options.placements)
        ]
        found = shading.register(
            [Scene(of_kinds(leaf=one, wood=wood), None, settings.ground_z_m) for one in leaves],
            table,
            records,
            sky_at=sky_at,
            max_shift_m=settings.registration.max_shift_m,
            sun_diameter_deg=settings.light.sun_diameter_deg,
            aperture_m=settings.light.aperture_m,
            max_clock_offset_s=options.clock,
            # all records that are given fit: the last time alone reports, and nothing reads it
            split_by="time",
            fit_share=0.99,
            variant=f"{settings.light.variant}_ad_mono",
            seed=3,
        )
        row = [found[key] for key in ("r_fit", "east_m", "north_m", "clock_offset_s")]
        rows.append([max_distance_m, thin_wood_m2, *row])
        print("{:14g}  {:12g}  {:.4f}  {:6.3f}  {:7.3f}  {:7g}".format(*rows[-1]), flush=True)
    best = pd.DataFrame(rows).sort_values(2).iloc[-1]
    print(f"highest on the fitting half: max_distance_m {best[0]:g}, thin_wood_m2 {best[1]:g}")


if __name__ == "__main__":
    main()
