"""The published apple tree: its sensors, records, skies and scenes, for the benchmarks."""

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple import steps
from dapple.config.settings import Settings, validate
from dapple.formats import json, meshes
from dapple.light import light_datasets, series
from dapple.light.light_model import Model, Tracing
from dapple.scene import scene_files, scene_optics, sensors, traced
from dapple.scene.surfaces import Scene
from dapple.sky.radiation_series import broadband
from dapple.sky.sky_radiance import scaled, sky_dataset
from dapple.sky.sun import Site
from dapple.stats import measured, measures
from dapple.stats.pairs import pair
from dapple.streams import stream_seed
from dapple.times import time_range

RAYS = {"paths": 2048, "sky_rays": 4096, "max_shadow_rays": 4096, "tolerance": 0.005}


@dataclass
class Run:
    """The files of a finished run of config/apple.yaml, and light computed anew from them.

    Attributes
    ----------
    folder : Path
        The results.
    step_min : float
        Minutes between times.
    """

    folder: Path
    step_min: float = 1.0

    @cached_property
    def settings(self) -> Settings:
        return validate(yaml.safe_load((self.folder / "config.yaml").read_text()))

    @cached_property
    def registration(self) -> dict:
        return json.read(self.folder / "registration/registration.json")

    @cached_property
    def optics(self) -> scene_optics.Optics:
        return scene_optics.read(self.folder / "sky/optics.nc")

    @cached_property
    def sensors(self) -> pd.DataFrame:
        """Sensors with records, in the frame whose origin the configuration guesses."""
        path = Path(self.settings.data_dir) / self.settings.sensors.path
        origin_m = self.settings.registration.origin_m
        table = sensors.read(path, origin_m, **self.settings.sensors.table())
        return table[table["sensor"].isin(self.records["sensor"])].reset_index(drop=True)

    @cached_property
    def records(self) -> pd.DataFrame:
        path = Path(self.settings.data_dir) / self.settings.measured.path
        return measured.read(path, **self.settings.measured.table()).table

    @cached_property
    def times(self) -> pd.DatetimeIndex:
        return time_range(**dict(self.settings.time) | {"step_min": self.step_min})

    @cached_property
    def wood(self) -> meshes.Mesh:
        return meshes.read_ply(self.folder / "structure/polygons/wood.ply")

    def scenes(self, reconstruction: str) -> list[Scene]:
        """One scene for each placement of leaves, or that of the voxels."""
        folder = self.folder / "structure" / reconstruction
        leaves = sorted(folder.glob("leaves_*.ply")) or [folder / "voxels.nc"]
        wood = self.folder / "structure/polygons/wood.ply"
        return scene_files.read(leaves, wood, scene_files.around(self.settings.ground_z_m))

    def sky(
        self,
        times: pd.DatetimeIndex | None = None,
        *,
        model: str = "perez",
        kind: str = "table",
        gain: float = 1.0,
    ) -> xr.Dataset:
        """Sun and sky, by default at the times of the run."""
        times = self.times if times is None else times
        columns = self.settings.radiation.broadband() | {"kind": kind}
        site = Site(**self.settings.site.model_dump(exclude={"timezone", "crs"}))
        path = Path(self.settings.data_dir) / self.settings.radiation.path
        radiation = broadband(times, site, path=path, **columns).values
        return scaled(sky_dataset(times, site, radiation, model=model), gain)

    def light(
        self,
        scenes: Sequence[traced.TracedScene],
        sky: xr.Dataset,
        shift_m: tuple[float, float],
        *,
        sun: str = "disc",
        entrance_m: float | None = None,
    ) -> list[series.Light]:
        """Light at all sensors under every placement, the tree moved by a shift."""
        points_m = self.sensors[["x_m", "y_m", "z_m"]].to_numpy() - [*shift_m, 0.0]
        own, model = self.settings.light, Model(sun=sun, sky_patches=577, bands=len(self.optics))
        tracing = Tracing(
            **RAYS,
            sun_diameter_deg=own.sun_diameter_deg,
            sun_kernel_deg=own.transport.sun_kernel_deg,
            aperture_m=own.entrance_m if entrance_m is None else entrance_m,
        )
        result = []
        for number, scene in enumerate(scenes):
            of_sun, of_paths = (stream_seed(which, number) for which in (1, 2))
            sunlit = steps.sun(scene, points_m, sky, model, tracing, seed=of_sun)
            paths = steps.paths(scene, points_m, model, tracing, seed=of_paths)
            result.append(steps.products(sunlit, paths, sky, self.optics, model, tracing))
        return result

    def score(self, par: np.ndarray, chosen: Sequence[str]) -> dict[str, float]:
        """r, RMSE and bias of light (sensor, time) on the records of chosen sensors."""
        zero = np.zeros_like(par)
        dataset = light_datasets.dataset(
            list(self.sensors["sensor"]), self.times, par=par, direct=zero, sky=zero,
            scattered=zero, standard_error=zero,
        )  # fmt: skip
        records = self.records[self.records["sensor"].isin(chosen)]
        table = pair(dataset.sel(sensor=list(chosen)), records, reconstruction="")
        difference = (table["simulated"] - table["measured"]).to_numpy()
        r = measures.pearson(table["measured"].to_numpy(), table["simulated"].to_numpy())
        rmse = float(np.sqrt((difference**2).mean()))
        return {"n": len(table), "r": r, "rmse": rmse, "bias": float(difference.mean())}
