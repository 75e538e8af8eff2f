"""Light of one scene as finely or as coarsely as a model says, and what it costs to compute."""

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import xarray as xr

from dapple.formats.netcdf import times
from dapple.light import series, transport, visibility
from dapple.light.series import Light
from dapple.light.visibility import Sunlit
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import GROUND
from dapple.scene.traced import TracedScene
from dapple.streams import stream_seed

FLUXES = ("beam_normal_umol_m2_s", "diffuse_horizontal_umol_m2_s")
PARTS = ("direct", "paths", "products")
"""Steps of the computation: shadow rays, counted paths, products with skies and spectra."""


@dataclass(frozen=True)
class Model:
    """How finely light is computed.

    Attributes
    ----------
    sun : {"disc", "point"}
    sky_patches : int
        Subdivision of the sky.
    sky : {"perez", "isotropic"}
        Whether the sky keeps the anisotropy that its dataset has.
    max_orders : int
        Most surfaces on a path of light.
    ground : {"lambertian", "black"}
    bands : int
        Groups of bands of like leaves, 1 to 3; the number of all bands or more: all.
    step_min : float
        Minutes between times at which the sun's disc is traced; in between its visible share is
        interpolated. Not above the step of the series: every time is traced.
    """

    sun: str = "disc"
    sky_patches: int = 2305
    sky: str = "perez"
    max_orders: int = 12
    ground: str = "lambertian"
    bands: int = 61
    step_min: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Names and values, for files."""
        return asdict(self)


@dataclass(frozen=True)
class Effort:
    """How many rays are traced, whatever the model.

    Attributes
    ----------
    paths, sky_rays : int
        Paths and straight rays to the sky of every sensor.
    shadow_tolerance : float
        Standard error of the sun's visible share at which shadow rays are enough.
    max_shadow_rays : int
        Most shadow rays of a sensor at a time.
    sun_diameter_deg, aperture_m, sun_kernel_deg : float
        As in `direct.sunlit` and `transport.sun_radiance`.
    """

    paths: int = 16_384
    sky_rays: int = 16_384
    shadow_tolerance: float = 0.004
    max_shadow_rays: int = 16_384
    sun_diameter_deg: float = 0.533
    aperture_m: float = 0.0
    sun_kernel_deg: float = 8.0


@dataclass(frozen=True)
class Cost:
    """Seconds on the clock and seconds of all processors together."""

    wall_s: float = 0.0
    cpu_s: float = 0.0

    def __add__(self, other: "Cost") -> "Cost":
        return Cost(self.wall_s + other.wall_s, self.cpu_s + other.cpu_s)

    def __mul__(self, factor: float) -> "Cost":
        return Cost(self.wall_s * factor, self.cpu_s * factor)


def spread(n: int, count: int) -> np.ndarray:
    """Indices of `count` of n things, evenly spread; all of them where there are fewer."""
    if count >= n:
        return np.arange(n)
    return np.unique(np.linspace(0, n - 1, count + 2)[1:-1].round().astype(int))


def least(costs: list[Cost]) -> Cost:
    """The least wall time and the least processor time of several runs of one thing."""
    return Cost(min(c.wall_s for c in costs), min(c.cpu_s for c in costs))


def timed(work: Callable[[], Any]) -> tuple[Any, Cost]:
    """Do some work and say what it cost."""
    wall, cpu = time.perf_counter(), time.process_time()
    found = work()
    return found, Cost(time.perf_counter() - wall, time.process_time() - cpu)


def simplified(sky: xr.Dataset, optics: Optics, model: Model) -> tuple[xr.Dataset, Optics]:
    """The sky and the optical properties that a model keeps.

    Parameters
    ----------
    sky : xarray.Dataset
        Sun and sky in b bands.
    optics : Optics
        In the same bands.
    model : Model
        Sky, ground and bands count.

    Returns
    -------
    sky, optics
        In fewer bands where the model groups them; the photon flux of all is the same.
    """
    if model.sky == "isotropic":
        sky = sky.assign(perez=xr.zeros_like(sky["perez"]))
    if model.ground == "black":
        optics = optics.with_black(GROUND)
    if model.bands < len(optics):
        flux = {name: sky[name].transpose("time", "band").to_numpy() for name in FLUXES}
        optics, group = group_bands(optics, *flux.values(), model.bands)
        sky = sky.drop_dims("band").assign(
            {
                name: (("time", "band"), group_flux(values, group, model.bands))
                for name, values in flux.items()
            }
        )
    return sky, optics


def sunlit(
    scene: TracedScene, sensors_m: np.ndarray, sky: xr.Dataset, model: Model, **options: Any
) -> Sunlit:
    """What sensors see of the sun at the times of a sky, traced as often as a model wants.

    Parameters
    ----------
    scene : TracedScene
    sensors_m : (n, 3) float64
        Local frame [m].
    sky : xarray.Dataset
        For its times and suns.
    model : Model
        Sun and time step count.
    **options
        Of `direct.sunlit`; the diameter of the sun is that of the disc.
    """
    minutes = (times(sky) - times(sky)[0]).total_seconds().to_numpy() / 60
    chosen = thinned(minutes, model.step_min)
    if model.sun == "point":
        options = options | {"sun_diameter_deg": 0.0}
    seen = visibility.sunlit(scene, sensors_m, series.towards_sun(sky)[chosen], **options)
    return interpolated(seen, minutes[chosen], minutes) if len(chosen) < len(minutes) else seen


def thinned(minutes: np.ndarray, step_min: float) -> np.ndarray:
    """Indices of times at least `step_min` apart, the first and the last among them."""
    chosen = [0]
    for index, minute in enumerate(minutes):
        if minute - minutes[chosen[-1]] >= step_min - 1e-6 and index:
            chosen.append(index)
    return np.unique([*chosen, len(minutes) - 1])


def interpolated(seen: Sunlit, known: np.ndarray, wanted: np.ndarray) -> Sunlit:
    """The share of the disc that is seen at more times, linear between those that are known.

    Parameters
    ----------
    seen : Sunlit
        At `known` times.
    known, wanted : (k,), (t,) float
        Times in one unit, ascending; those wanted lie within the known.
    """
    before = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, len(known) - 2)
    part = (wanted - known[before]) / (known[before + 1] - known[before])

    def between(values: np.ndarray) -> np.ndarray:
        return values[..., before] * (1 - part) + values[..., before + 1] * part

    return Sunlit(between(seen.share), between(seen.standard_error), seen.n_rays[:, before])


def light(
    scene: TracedScene,
    sensors_m: np.ndarray,
    sky: xr.Dataset,
    optics: Optics,
    model: Model,
    effort: Effort,
    *,
    seed: int,
) -> tuple[Light, dict[str, Cost]]:
    """Light of a scene by the transport engine, and the cost of each of its `PARTS`.

    The same seed gives models that share rays the same random numbers: what differs is the model.

    Parameters
    ----------
    scene : TracedScene
    sensors_m : (n, 3) float64
        Local frame [m].
    sky : xarray.Dataset
        Sun and sky at t times.
    optics : Optics
    model : Model
    effort : Effort
    seed : int
    """
    plain_sky, plain_optics = simplified(sky, optics, model)
    seen, direct_cost = timed(
        lambda: sunlit(
            scene,
            sensors_m,
            sky,
            model,
            tolerance=effort.shadow_tolerance,
            max_rays=effort.max_shadow_rays,
            seed=stream_seed(seed, "sun"),
            sun_diameter_deg=effort.sun_diameter_deg,
            aperture_m=effort.aperture_m,
        )
    )
    counted, paths_cost = timed(
        lambda: transport.collect(
            scene,
            sensors_m,
            n_paths=effort.paths,
            n_sky_rays=effort.sky_rays,
            n_patches=model.sky_patches,
            max_orders=model.max_orders,
            aperture_m=effort.aperture_m,
            seed=stream_seed(seed, "paths"),
        )
    )
    found, products_cost = timed(
        lambda: series.compute(
            seen, counted, plain_sky, plain_optics, sun_kernel_deg=effort.sun_kernel_deg
        )
    )
    return found, dict(zip(PARTS, (direct_cost, paths_cost, products_cost), strict=True))
