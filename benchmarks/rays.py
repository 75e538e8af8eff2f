"""How many shadow rays a second the engine traces, and how many Mitsuba alone."""

import sys
import time
from pathlib import Path

import drjit as dr
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import crown

from dapple.frames import direction_from_angles
from dapple.light import rays_to_sky
from dapple.scene import patterns, traced
from dapple.scene.surfaces import Scene
from dapple.sky.open_sky import towards_sun
from dapple.sky.solar_disc import SUN_DIAMETER_DEG


def shadow_rays(scene: Scene, variant: str, n_sensors: int = 72, n_times: int = 100) -> dict:
    """Shadow rays a second of the engine, and of a bare loop over the same rays."""
    loaded = traced.load(scene, variant)
    mi = loaded.mi
    sensors, sky = crown.sensors(n_sensors), crown.sky(n_times)
    suns, n_rays = towards_sun(sky), 256
    trace = rays_to_sky.sun_rays(
        loaded, sensors, suns, sun_diameter_deg=SUN_DIAMETER_DEG, aperture_m=0.0, seed=1
    )
    pairs = np.arange(n_sensors * n_times)
    rays = len(pairs) * n_rays
    disc = patterns.disc(patterns.kronecker(n_rays, 2)) * np.sin(np.radians(SUN_DIAMETER_DEG / 2))
    turn = np.stack([direction_from_angles(90.0, 90.0), direction_from_angles(90.0, 0.0)])
    ways = suns[:, None] + disc @ turn
    ways = np.broadcast_to(ways, (n_sensors, n_times, n_rays, 3)).reshape(-1, 3)
    ways = mi.Vector3f(np.ascontiguousarray(ways.T, np.float32))
    starts = np.repeat(sensors, n_times * n_rays, axis=0)
    starts = mi.Point3f(np.ascontiguousarray(starts.T, np.float32))
    dr.eval(ways, starts)

    def bare():
        dr.eval(loaded.meshes.ray_test(mi.Ray3f(starts, ways)))
        dr.sync_thread()

    times = {"engine": [], "bare": []}
    for _ in range(6):
        for name, run in (("engine", lambda: trace(pairs, 8, 0, n_rays // 8)), ("bare", bare)):
            begin = time.perf_counter()
            run()
            times[name].append(time.perf_counter() - begin)
    engine, loop = (rays / min(times[name][1:]) for name in ("engine", "bare"))
    return {"rays_per_s": engine, "bare_rays_per_s": loop, "share_of_bare": engine / loop}
