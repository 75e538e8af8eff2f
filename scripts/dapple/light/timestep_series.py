"""The per-timestep engine over a whole day."""

from collections.abc import Callable, Iterable
from functools import cached_property

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats import netcdf
from dapple.light.light_datasets import dataset
from dapple.light.timestep import Rays, timestep
from dapple.optics.responses import COSINE, Response
from dapple.scene import mitsuba_scene
from dapple.scene.facing import facing_of
from dapple.scene.render_scene import RenderScene
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import Scene
from dapple.sky.sky_radiance import in_directions
from dapple.streams import stream_seed


class Reference:
    """Mitsuba's integrators on one reconstruction, its scenes built when first needed.

    Parameters
    ----------
    scenes : list of Scene
        One for each placement of the leaves; light is their mean.
    sky : xarray.Dataset
        Sun and sky at all times.
    optics : Optics
        In the bands of the sky.
    bands : int
        Groups of bands that are traced together, 1 to 3.
    sun_diameter_deg : float
        Of the solar disc [deg].
    aperture_m : float
        Diameter of the sensors' receiving discs [m].
    response : Response
        Of the sensors.
    replicates, direct_rays, sky_rays, scattered_rays, max_depth : int
        See `Rays`.
    """

    def __init__(
        self,
        scenes: list[Scene],
        sky: xr.Dataset,
        optics: Optics,
        *,
        bands: int,
        sun_diameter_deg: float,
        replicates: int,
        direct_rays: int,
        sky_rays: int,
        scattered_rays: int,
        max_depth: int,
        aperture_m: float,
        response: Response = COSINE,
        variant: str,
        seed: int,
    ):
        self.scenes, self.sky, self.n_bands, self.seed = scenes, sky, bands, seed
        self.rays = Rays(replicates, direct_rays, sky_rays, scattered_rays, max_depth)
        self.beam = sky["beam_normal_umol_m2_s"].transpose("time", "band").to_numpy()
        self.diffuse = sky["diffuse_horizontal_umol_m2_s"].transpose("time", "band").to_numpy()
        self.optics, self.group = group_bands(optics, self.beam, self.diffuse, bands)
        self.sun_diameter_deg, self.aperture_m = sun_diameter_deg, aperture_m
        self.response = response
        self.variant = variant

    @cached_property
    def rendered(self) -> list[RenderScene]:
        """The scenes as Mitsuba has them."""
        return [
            mitsuba_scene.build(scene, self.optics, variant=self.variant) for scene in self.scenes
        ]

    def _radiance(self, index: int) -> Callable[[np.ndarray, np.ndarray], np.ndarray]:
        """Relative radiance of the sky at one time, of zenith and azimuth."""
        at_time = self.sky.isel(time=[index])
        return lambda zenith_deg, azimuth_deg: in_directions(at_time, zenith_deg, azimuth_deg)[0]

    def at(self, index: int, sensors: pd.DataFrame) -> xr.Dataset:
        """Light of one time as a dataset with a single time."""
        sensors_m = sensors[["x_m", "y_m", "z_m"]].to_numpy()
        parts = [
            timestep(
                scene,
                sensors_m,
                sun_zenith_deg=float(self.sky["sun_zenith_deg"][index]),
                sun_azimuth_deg=float(self.sky["sun_azimuth_deg"][index]),
                beam_normal=group_flux(self.beam[index], self.group, self.n_bands),
                diffuse_horizontal=group_flux(self.diffuse[index], self.group, self.n_bands),
                sky=self._radiance(index),
                sun_diameter_deg=self.sun_diameter_deg,
                rays=self.rays,
                aperture_m=self.aperture_m,
                response=self.response,
                facing=facing_of(sensors),
                seed=stream_seed(self.seed, placement, index),
            )
            for placement, scene in enumerate(self.rendered)
        ]
        mean = {
            name: np.mean([part[name].sum(axis=1) for part in parts], axis=0)[:, None]
            for name in ("total", "direct", "sky", "scattered")
        }
        return dataset(
            list(sensors["sensor"]),
            netcdf.times(self.sky)[index : index + 1],
            par=mean.pop("total"),
            standard_error=_standard_error(parts)[:, None],
            **mean,
        )


def joined(parts: Iterable[xr.Dataset]) -> xr.Dataset:
    """Light of some times after that of others, as one series."""
    return xr.concat(
        list(parts), "time", data_vars="minimal", coords="minimal", combine_attrs="drop_conflicts"
    )


def _standard_error(parts: list[dict[str, np.ndarray]]) -> np.ndarray:
    """Of the mean over placements; of the rays alone where there is one placement."""
    if len(parts) == 1:
        return parts[0]["par_standard_error"]
    return np.std([part["par"] for part in parts], axis=0, ddof=1) / np.sqrt(len(parts))
