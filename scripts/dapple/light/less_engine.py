"""Light at sensors by LESS 3, which runs in a process of its own on files of its own."""

import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import xarray as xr

from dapple import less3
from dapple.formats import netcdf, tables
from dapple.light import less_files
from dapple.light.less_files import LessRays
from dapple.light.light_datasets import dataset
from dapple.progress import followed
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import Scene
from dapple.sky.sky_radiance import FLUXES
from dapple.streams import stream_seed

PARTS = ["par", "direct", "sky", "scattered", "standard_error"]


def series(
    scenes: Sequence[Scene],
    sky: xr.Dataset,
    optics: Optics,
    sensors: pd.DataFrame,
    *,
    bands: int,
    rays: LessRays,
    aperture_m: float,
) -> xr.Dataset:
    """Light at all sensors and times, the mean over the scenes.

    Parameters
    ----------
    scenes : sequence of Scene
        One for each placement of the leaves.
    sky : xarray.Dataset
        Sun and sky at the times that are simulated.
    optics : Optics
        In the bands of the sky.
    sensors : DataFrame
        `sensor`, `x_m`, `y_m`, `z_m` in the local frame.
    bands : int
        Groups of like bands, 1 to 3; as many as there are or more: all.
    rays : LessRays
    aperture_m : float
        Diameter of the sensors' receiving discs [m].

    Returns
    -------
    xarray.Dataset
        As `light_datasets.dataset`.

    Raises
    ------
    InputError
        LESS 3 is not installed, or does not know the leaf angles of voxels.
    """
    less3.check("light.engine: less")
    sky, optics = in_groups(sky, optics, bands)
    parts = []
    for placement, scene in enumerate(followed(scenes, "placements of the leaves by LESS")):
        with tempfile.TemporaryDirectory(prefix="dapple-less-") as folder:
            own = replace(rays, seed=stream_seed(rays.seed, placement))
            less_files.write(Path(folder), scene, optics, sky, sensors, own, aperture_m)
            parts.append(simulate(Path(folder)))
    mean = {name: np.mean([part[name] for part in parts], axis=0) for name in PARTS}
    if len(parts) > 1:
        spread = np.std([part["par"] for part in parts], axis=0, ddof=1)
        mean["standard_error"] = spread / np.sqrt(len(parts))
    return dataset(list(sensors["sensor"]), netcdf.times(sky), **mean)


def simulate(folder: Path) -> dict[str, np.ndarray]:
    """Run LESS 3 on a folder that `less_files.write` made.

    Returns
    -------
    dict of str to (n_sensors, t) float64
        `par`, its parts `direct`, `sky`, `scattered`, and its `standard_error`, in the unit of the
        folder's light. What LESS prints is printed.
    """
    print(less3.run(folder / less_files.RUNNER.name, folder, makes="light.csv"))
    table = tables.read(folder / "light.csv")
    n_sensors = len(tables.read(folder / "sensors.csv"))
    return {name: table[name].to_numpy().reshape(-1, n_sensors).T for name in PARTS}


def in_groups(sky: xr.Dataset, optics: Optics, bands: int) -> tuple[xr.Dataset, Optics]:
    """Sky and optics in so many groups of like bands, in the order of their wavelengths."""
    if bands >= len(optics):
        return sky, optics
    beam, diffuse = (sky[name].transpose("time", "band").to_numpy() for name in FLUXES)
    optics, group = group_bands(optics, beam, diffuse, bands)
    order = np.argsort(optics.wavelength_nm, kind="stable")
    grouped = {
        name: (("time", "band"), group_flux(values, group, bands)[:, order])
        for name, values in zip(FLUXES, (beam, diffuse), strict=True)
    }
    return sky.drop_dims("band").assign(grouped), optics.each(lambda values: values[order])
