"""The per-timestep engine over a whole day, one cached file a timestep."""

import hashlib
from collections.abc import Sequence
from functools import cached_property
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from dapple.formats import netcdf
from dapple.light.series import dataset
from dapple.light.timestep import Effort, timestep
from dapple.scene import mitsuba_scene
from dapple.scene.render_scene import RenderScene
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import Scene
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
    replicates, direct_rays, sky_rays, scattered_rays, max_depth : int
        See `Effort`.
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
        variant: str,
        seed: int,
    ):
        self.scenes, self.sky, self.n_bands, self.seed = scenes, sky, bands, seed
        self.effort = Effort(replicates, direct_rays, sky_rays, scattered_rays, max_depth)
        self.beam = sky["beam_normal_umol_m2_s"].transpose("time", "band").to_numpy()
        self.diffuse = sky["diffuse_horizontal_umol_m2_s"].transpose("time", "band").to_numpy()
        self.optics, self.group = group_bands(optics, self.beam, self.diffuse, bands)
        self.sun_diameter_deg, self.aperture_m = sun_diameter_deg, aperture_m
        self.variant = variant

    @property
    def settings(self) -> tuple:
        """What a timestep depends on besides geometry, spectra and sky."""
        return (self.effort, self.n_bands, self.sun_diameter_deg, self.aperture_m, self.seed)

    @cached_property
    def rendered(self) -> list[RenderScene]:
        """The scenes as Mitsuba has them."""
        return [
            mitsuba_scene.build(
                scene,
                self.optics,
                variant=self.variant,
                sun_diameter_deg=self.sun_diameter_deg,
            )
            for scene in self.scenes
        ]

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
                sky=self.sky["perez"][index].to_numpy(),
                effort=self.effort,
                aperture_m=self.aperture_m,
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


def _standard_error(parts: list[dict[str, np.ndarray]]) -> np.ndarray:
    """Of the mean over placements; of the rays alone where there is one placement."""
    if len(parts) == 1:
        return parts[0]["par_standard_error"]
    return np.std([part["par"] for part in parts], axis=0, ddof=1) / np.sqrt(len(parts))


def run_all(
    reference: Reference, sensors: pd.DataFrame, paths: Sequence[str], inputs: Sequence[str]
) -> int:
    """Compute the timesteps whose files are missing or were made from something else.

    Parameters
    ----------
    reference : Reference
        The engine.
    sensors : pandas.DataFrame
        In the local frame.
    paths : sequence of path
        One NetCDF file for each time of the sky.
    inputs : sequence of path
        Files of geometry, whose contents count for the digest that a timestep carries.

    Returns
    -------
    int
        How many were computed.
    """
    common = hashlib.sha256()
    for path in inputs:
        common.update(Path(path).read_bytes())
    common.update(sensors.to_csv().encode())
    common.update(repr(reference.settings).encode())
    for kind in (reference.optics.reflectance, reference.optics.transmittance):
        for name, values in kind.items():
            common.update(name.encode() + np.ascontiguousarray(values).tobytes())
    computed = 0
    for index, path in enumerate(paths):
        digest = common.copy()
        for _, variable in sorted(reference.sky.isel(time=index).data_vars.items()):
            digest.update(np.ascontiguousarray(variable).tobytes())
        if _is_current(Path(path), digest.hexdigest()):
            continue
        netcdf.write(path, reference.at(index, sensors).assign_attrs(inputs=digest.hexdigest()))
        computed += 1
        print(f"{path}: computed", flush=True)
    return computed


def _is_current(path: Path, digest: str) -> bool:
    return path.is_file() and netcdf.read(path).attrs.get("inputs") == digest
