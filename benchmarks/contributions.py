"""What penumbra, clumping, diffuse light and scattering each add on the published apple tree.

    PYTHONPATH=scripts python benchmarks/contributions.py [--folder results/apple] [--step 1]

Needs a finished run of config/apple.yaml. Every row leaves one thing out of the full model and is
compared with the records that the registration has not seen.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple import steps
from dapple.config.settings import Settings, validate
from dapple.formats import json, meshes, tables
from dapple.light import light_datasets, series
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_optics, traced
from dapple.sky.open_sky import open_sky_par
from dapple.sky.radiation_series import broadband
from dapple.sky.sky_radiance import sky_dataset
from dapple.sky.sun import Site
from dapple.stats import measured, measures
from dapple.stats.pairs import pair
from dapple.streams import stream_seed
from dapple.times import time_range
from dapple.virtual.leaves import along_wood

RAYS = {"paths": 2048, "sky_rays": 4096, "max_shadow_rays": 4096}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("results/apple"))
    parser.add_argument("--step", type=float, default=1.0, help="minutes between times")
    parser.add_argument("--out", type=Path, default=Path("results/apple/contributions.csv"))
    options = parser.parse_args()
    run = Run(options.folder, options.step)
    full = run.placements(run.leaves)
    isotropic = run.sky_at(model="isotropic")
    clear = run.sky_at(kind="clear_sky")
    rows = {
        "full model": run.score(full),
        "one placement of the leaves": run.score(full[:1]),
        "a point for the sun": run.score(run.placements(run.leaves, sun="point")),
        "leaves not clumped on shoots": run.score(run.placements(run.unclumped())),
        "an isotropic sky": run.score(run.placements(run.leaves, sky=isotropic)),
        "diffuse share of the clear-sky model": run.score(
            run.placements(run.leaves, sky=run.with_diffuse_share_of(clear))
        ),
        "no scattered light": run.score(full, parts=("direct", "sky")),
        "no diffuse light at all": run.score(full, parts=("direct",)),
        "no tree": run.score(None),
    }
    table = pd.DataFrame(rows).T.rename_axis("model").reset_index()
    options.out.parent.mkdir(parents=True, exist_ok=True)
    table.to_csv(options.out, index=False, float_format="%.4g")
    print(table.to_string(index=False, float_format=lambda value: f"{value:.3f}"))


class Run:
    """The files of a finished run, and light computed anew from them."""

    def __init__(self, folder: Path, step_min: float):
        self.settings: Settings = validate(yaml.safe_load((folder / "config.yaml").read_text()))
        self.registration = json.read(folder / "registration/registration.json")
        light = self.settings.light.model_dump(include={"sun_diameter_deg", "aperture_m"})
        self.tracing = Tracing(**RAYS, **light)
        self.optics = scene_optics.read(folder / "sky/optics.nc")
        table = tables.read(folder / "sky/sensors.csv")
        path = Path(self.settings.data_dir) / self.settings.measured.path
        records = measured.read(path, sensors=table, **self.settings.measured.table()).table
        self.records = records[~records["sensor"].isin(self.registration["fitting_sensors"])]
        self.sensors = table[table["sensor"].isin(self.records["sensor"])].reset_index(drop=True)
        times = time_range(**dict(self.settings.time) | {"step_min": step_min})
        self.times = times - pd.Timedelta(seconds=self.registration["clock_offset_s"])
        self.wood = meshes.read_ply(folder / "structure/polygons/wood.ply")
        paths = sorted((folder / "structure/polygons").glob("leaves_*.ply"))
        self.leaves = [meshes.read_ply(path) for path in paths]
        self.sky = self.sky_at()

    def sky_at(self, model: str = "perez", kind: str = "table"):
        columns = self.settings.radiation.broadband() | {"kind": kind}
        site = Site(**self.settings.site.model_dump(exclude={"timezone"}))
        path = Path(self.settings.data_dir) / self.settings.radiation.path
        return sky_dataset(
            self.times,
            site,
            broadband(self.times, site, path=path, **columns).values,
            model=model,
        )

    def with_diffuse_share_of(self, other):
        """The same total light on the level, split into beam and diffuse as in another sky."""
        changed = self.sky.copy()
        total = open_sky_par(self.sky)
        share = other["diffuse_horizontal_umol_m2_s"].sum("band") / open_sky_par(other)
        own_diffuse = self.sky["diffuse_horizontal_umol_m2_s"].sum("band")
        own_beam = total - own_diffuse
        changed["diffuse_horizontal_umol_m2_s"] = (
            self.sky["diffuse_horizontal_umol_m2_s"] * share * total / own_diffuse
        )
        changed["beam_normal_umol_m2_s"] = (
            self.sky["beam_normal_umol_m2_s"] * (1 - share) * total / own_beam
        )
        return changed

    def unclumped(self):
        """As many leaves with as much area, each on a shoot of its own."""
        placing = self.settings.leaves.model_dump(exclude={"placements"})
        placing |= {"leaves_per_shoot": 1}
        n = range(len(self.leaves))
        return [along_wood(self.wood, **placing, seed=stream_seed(7, k)) for k in n]

    def placements(self, leaves, sky=None, sun="disc") -> list[series.Light]:
        """Light under every placement of leaves."""
        sky = self.sky if sky is None else sky
        points_m = self.sensors[["x_m", "y_m", "z_m"]].to_numpy()
        model = Model(sun=sun, sky_patches=577, bands=len(self.optics))
        result = []
        for number, one in enumerate(leaves):
            meshes = {"leaf": one, "wood": self.wood}
            scene = traced.load(steps.scene(meshes, ground_z_m=self.settings.ground_z_m))
            of_sun, of_paths = (stream_seed(which, number) for which in (1, 2))
            sunlit = steps.sun(scene, points_m, sky, model, self.tracing, seed=of_sun)
            paths = steps.paths(scene, points_m, model, self.tracing, seed=of_paths)
            result.append(steps.products(sunlit, paths, sky, self.optics, model, self.tracing))
        return result

    def score(self, placements, parts=("direct", "sky", "scattered")) -> dict[str, float]:
        """r, RMSE and bias on the reporting records."""
        open_sky = open_sky_par(self.sky)
        if placements is None:
            par = np.broadcast_to(open_sky.to_numpy(), (len(self.sensors), len(self.times)))
        else:
            par = np.mean([sum(getattr(p, part) for part in parts) for p in placements], axis=0)
        zero = np.zeros_like(par)
        dataset = light_datasets.dataset(
            list(self.sensors["sensor"]), self.times, par=par, direct=zero, sky=zero,
            scattered=zero, standard_error=zero,
        )  # fmt: skip
        offset_s = self.registration["clock_offset_s"]
        table = pair(dataset, self.records, reconstruction="polygons", clock_offset_s=offset_s)
        difference = (table["simulated"] - table["measured"]).to_numpy()
        r = measures.pearson(table["measured"].to_numpy(), table["simulated"].to_numpy())
        rmse = float(np.sqrt((difference**2).mean()))
        return {"n": len(table), "r": r, "rmse": rmse, "bias": float(difference.mean())}


if __name__ == "__main__":
    main()
