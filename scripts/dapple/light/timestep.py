"""Light at sensors at one time, by Mitsuba's own path tracers: the reference engine.

A sensor's reading is an integral over the hemisphere above its plane of radiance times the sensor's
response, with the cosine irradiance; each radiance comes from Mitsuba's `path`
or `volpath` integrator, asked along rays that start at the sensor:

* direct: rays to points of the sun's disc, no scattering. While they are traced every direction
  of the sky has the sun's radiance, so that a ray that gets out brings just that;
* sky: rays drawn as often as light from there counts, no scattering;
* scattered: rays drawn alike, light that comes straight from the sky left out. What
  scatters is lit by the sky and by parallel light: penumbras do not change its mean.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce

import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.frames import across, direction_from_angles
from dapple.optics import sensor_response
from dapple.optics.responses import COSINE, Response
from dapple.scene import patterns
from dapple.scene.render_scene import RenderScene
from dapple.streams import stream_seed

POINT_SINE = 1e-4
"""Of the radius of a sun that is taken for a point: a disc too small to tell."""
LIFT_M = 1e-3
"""A sensor that lies on the ground is lifted by this much, so that its rays leave the ground."""


@dataclass(frozen=True)
class Rays:
    """How many rays each sensor gets; standard errors come from the replicates.

    Attributes
    ----------
    replicates : int
        Independent repetitions, at least 2.
    direct, sky, scattered : int
        Rays per replicate for each part of the light.
    max_depth : int
        Longest path in segments: 2 is light scattered once.
    roulette_depth : int
        From this depth on weak paths are ended by chance (Mitsuba's `rr_depth`).
    """

    replicates: int
    direct: int
    sky: int
    scattered: int
    max_depth: int
    roulette_depth: int = 2

    def __post_init__(self) -> None:
        if self.replicates < 2 or min(self.direct, self.sky, self.scattered) < 1:
            raise InputError(
                "light.timestep",
                f"{self.replicates} replicates of {self.direct}, {self.sky}, {self.scattered} rays",
                "at least 2 replicates with rays for each part",
                "Without replicates there is no standard error.",
            )


def timestep(
    scene: RenderScene,
    sensors_m: np.ndarray,
    *,
    sun_zenith_deg: float,
    sun_azimuth_deg: float,
    beam_normal: np.ndarray,
    diffuse_horizontal: np.ndarray,
    sky: Callable[[np.ndarray, np.ndarray], np.ndarray],
    sun_diameter_deg: float,
    rays: Rays,
    seed: int,
    aperture_m: float = 0.0,
    response: Response = COSINE,
    facing: np.ndarray | None = None,
) -> dict[str, np.ndarray]:
    """What sensors read under one sun and one sky.

    Parameters
    ----------
    scene : RenderScene
        From `mitsuba_scene.build`; its sun and sky are set.
    sensors_m : (n, 3) array
        Local frame [m]; not below the ground.
    sun_zenith_deg, sun_azimuth_deg : float
        Azimuth clockwise from north [deg]. From zenith 90 on there is no direct light.
    beam_normal : (b,) array
        Irradiance of the sun on a plane that faces it, per band.
    diffuse_horizontal : (b,) array
        Irradiance of the open sky on the level, per band, in the same unit.
    sky : callable
        Relative radiance as a function of zenith and azimuth [deg].
    sun_diameter_deg : float
        Angular diameter of the sun's disc; 0 is a point [deg].
    rays : Rays
    seed : int
    aperture_m : float
        Diameter of the sensors' entrance; 0 is a point [m].
    response : Response
        Of the sensors.
    facing : (n, 3) array or None
        Unit normals of the sensors; None: they are level and look up.

    Returns
    -------
    dict of str to array
        `direct`, `sky`, `scattered`, `total`, `standard_error`: (n, b) in the unit of the input;
        `par`, `par_standard_error`: (n,), sums over the bands.

    Raises
    ------
    InputError
        A sensor lies below the ground.
    """
    beam, diffuse = (np.asarray(x, dtype=np.float64) for x in (beam_normal, diffuse_horizontal))
    # plugins and types belong to a variant: another one may have been set since the scene was built
    engine.load(scene.variant)
    sensors = _checked(np.asarray(sensors_m, dtype=np.float64), scene.ground_z_m)
    upright = np.tile([0.0, 0.0, 1.0], (len(sensors), 1)) if facing is None else facing
    axes = np.concatenate([across(upright), upright[:, None]], axis=1)
    towards_sun = direction_from_angles(sun_zenith_deg, sun_azimuth_deg)
    if sun_zenith_deg >= 90.0:
        beam, towards_sun = np.zeros_like(beam), np.array([0.0, 0.0, 1.0])
    dark = np.zeros((len(sensors), rays.replicates, 3))
    parts = {"direct": dark, "sky": dark, "scattered": dark}
    if beam.any() or diffuse.any():
        if beam.any():
            sine = max(np.sin(np.radians(0.5 * sun_diameter_deg)), POINT_SINE)
            scene.set_even_sky(beam / (np.pi * sine**2))
            parts["direct"] = _direct(
                scene, sensors, axes, towards_sun, sine, rays, aperture_m, response, seed
            )
        scene.set_sun(towards_sun, beam)
        scene.set_sky(sky, diffuse)
        for part in ("sky", "scattered") if diffuse.any() else ("scattered",):
            parts[part] = _hemisphere(scene, sensors, axes, part, rays, aperture_m, response, seed)
    return _summary(parts, scene.n_bands)


def _checked(sensors: np.ndarray, ground_z_m: float) -> np.ndarray:
    lowest = sensors[:, 2].min(initial=np.inf)
    if lowest < ground_z_m:
        raise InputError(
            "sensors",
            f"a sensor at z = {lowest:.3f} m",
            f"none below the ground at {ground_z_m:.3f} m",
            "Lower the ground or check the sensors' heights and origin.",
        )
    lifted = sensors.copy()
    lifted[:, 2] = np.maximum(lifted[:, 2], ground_z_m + LIFT_M)
    return lifted


def _direct(
    scene: RenderScene,
    sensors: np.ndarray,
    axes: np.ndarray,
    towards_sun: np.ndarray,
    sine: float,
    rays: Rays,
    aperture_m: float,
    response: Response,
    seed: int,
) -> np.ndarray:
    """(n, replicates, 3) reading by rays to points of the sun's disc, its radius a sine."""
    seed = stream_seed(seed, "direct")
    square = patterns.shifted(rays.direct, 4, (len(sensors), rays.replicates), seed)
    start = _starts(sensors, axes, square[..., 2:], aperture_m)
    # even in the disc as it is seen from below: the cosine with its axis weighs solid angle
    flat = sine * patterns.disc(square[..., :2])
    axial = np.sqrt(1.0 - (flat**2).sum(axis=-1, keepdims=True))
    way = flat @ across(towards_sun) + axial * towards_sun
    cosine = np.einsum("srki,si->srk", way, axes[:, 2])[..., None]
    weight = np.pi * sine**2 / axial * sensor_response.value(response, cosine)
    integrator = {"type": scene.integrator, "max_depth": 1}
    radiance = _radiance(scene, integrator, start, way, way[..., 2] > 0.0, seed)
    return (radiance * weight).mean(axis=2)


def _hemisphere(
    scene: RenderScene,
    sensors: np.ndarray,
    axes: np.ndarray,
    part: str,
    rays: Rays,
    aperture_m: float,
    response: Response,
    seed: int,
) -> np.ndarray:
    """(n, replicates, 3) reading of the sky or of scattered light."""
    seed = stream_seed(seed, part)
    integrator = {"type": scene.integrator, "max_depth": 1}
    if part == "scattered":
        integrator |= {
            "max_depth": rays.max_depth,
            "rr_depth": rays.roulette_depth,
            "hide_emitters": True,
        }
    n_rays = rays.sky if part == "sky" else rays.scattered
    square = patterns.shifted(n_rays, 4, (len(sensors), rays.replicates), seed)
    start = _starts(sensors, axes, square[..., 2:], aperture_m)
    flat = patterns.disc(square[..., :2])
    x, y, squared_radius = flat[..., 0], flat[..., 1], (flat**2).sum(axis=-1)
    way = np.stack(sensor_response.directions(response, x, y, squared_radius), axis=-1)
    way = np.einsum("srkj,sji->srki", way, axes)
    seen = np.ones(way.shape[:-1], dtype=bool)
    radiance = _radiance(scene, integrator, start, way, seen, seed)
    return sensor_response.integral_sr(response) * radiance.mean(axis=2)


def _radiance(
    scene: RenderScene,
    integrator: dict,
    start: np.ndarray,
    way: np.ndarray,
    active: np.ndarray,
    seed: int,
) -> np.ndarray:
    """Radiance (n, replicates, rays, 3) that arrives along rays, from a Mitsuba integrator."""
    mi = scene.mi
    tracer, sampler = mi.load_dict(integrator), mi.load_dict({"type": "independent"})
    # Ray by ray: a wide entrance may lie across the border of the medium.
    inside = scene.in_medium(start)
    radiance = np.zeros(way.shape)
    for medium, chosen in ((None, ~inside), (scene.medium, inside)):
        if not chosen.any():
            continue
        origins, ways = (
            np.ascontiguousarray(values[chosen].T, dtype=np.float32) for values in (start, way)
        )
        ray = mi.RayDifferential3f(mi.Point3f(origins), mi.Vector3f(ways))
        sampler.seed(seed, origins.shape[1])
        mask = mi.Bool(active[chosen])
        colour, _, _ = tracer.sample(scene.scene, sampler, ray, medium, mask)
        radiance[chosen] = np.array(colour & mask).T
    return radiance


def _starts(
    sensors: np.ndarray, axes: np.ndarray, square: np.ndarray, aperture_m: float
) -> np.ndarray:
    """(n, replicates, rays, 3) points on the sensors' entrances, (n, 3, 3) whose axes these are."""
    flat = 0.5 * aperture_m * patterns.disc(square)
    return sensors[:, None, None] + np.einsum("srkj,sji->srki", flat, axes[:, :2])


def _summary(parts: dict[str, np.ndarray], n_bands: int) -> dict[str, np.ndarray]:
    """Means over replicates per sensor and band, and the standard errors of the totals."""
    parts = {name: values[..., :n_bands] for name, values in parts.items()}
    total = reduce(np.add, parts.values())
    root = np.sqrt(total.shape[1])
    par = total.sum(axis=-1)
    return {
        **{name: values.mean(axis=1) for name, values in parts.items()},
        "total": total.mean(axis=1),
        "standard_error": total.std(axis=1, ddof=1) / root,
        "par": par.mean(axis=1),
        "par_standard_error": par.std(axis=1, ddof=1) / root,
    }
