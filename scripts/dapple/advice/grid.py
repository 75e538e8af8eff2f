"""Error and cost of light over a grid of settings, all in one process."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from dapple.advice.costs import Cost, least, repeated, timed
from dapple.advice.geometries import Geometry
from dapple.advice.pilot import light_and_costs
from dapple.light import less_engine
from dapple.light.less_files import LessRays
from dapple.light.light_model import Model, Tracing
from dapple.light.timestep_series import Reference
from dapple.light.tolerances import DIRECT_SHARE
from dapple.scene import traced
from dapple.scene.facing import facing_of
from dapple.scene.scene_optics import Optics
from dapple.scene.sensors import POSITION
from dapple.scene.surfaces import Scene
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import open_sky_par
from dapple.stats.agreement import rmse_rel

FINEST_PATHS, FINEST_PATCHES = 65_536, 2305
PATCHES = 577
"""Of settings that vary something else."""
PUBLISHED_VOXELS = ("voxels_1.0", "voxels_0.2")
"""Turbid voxels as large as those of Frey et al. (2025)."""


@dataclass
class Grid:
    """The sensors and times that all points share, and what is tried.

    Attributes
    ----------
    sensors : DataFrame
        `sensor`, `x_m`, `y_m`, `z_m`, local frame [m].
    sky : Dataset
        Sun and sky at the times, in daylight.
    optics : Optics
    paths : sequence of int
        Paths, and rays to the sky, that are tried.
    sky_patches, orders : sequence of int
        Subdivisions of the sky and most orders that are tried with the base geometry.
    max_orders : int
        Of the finest model.
    timestep_rays : sequence of int
        Rays of each kind that are tried with the per-timestep engine.
    timestep : dict
        Further settings of that engine.
    less_rays : sequence of int
        Rays of each sensor and time that are tried with LESS 3.
    less : dict
        Further settings of that engine: `bands` and `aperture_m` of `less_engine.series`, and
        fields of `LessRays`.
    tracing : Tracing
        For what is known of sun and sensors.
    repeats : int
        The shortest of so many runs is what a setting costs.
    variant : str
        Of Mitsuba.
    seed : int
    truth : Scene or None
        None: the finest polygons stand for it.
    """

    sensors: pd.DataFrame
    sky: xr.Dataset
    optics: Optics
    paths: Sequence[int]
    sky_patches: Sequence[int]
    orders: Sequence[int]
    max_orders: int
    timestep_rays: Sequence[int]
    timestep: dict[str, Any]
    tracing: Tracing
    less_rays: Sequence[int]
    less: dict[str, Any]
    repeats: int
    variant: str
    seed: int
    truth: Scene | None = None
    reference: np.ndarray = field(init=False)

    @cached_property
    def open_sky(self) -> np.ndarray:
        """(t,) PAR without a tree [µmol m⁻² s⁻¹]."""
        return open_sky_par(self.sky, self.tracing.response).to_numpy()

    @property
    def finest_model(self) -> Model:
        return Model(sky_patches=FINEST_PATCHES, max_orders=self.max_orders, bands=len(self.optics))

    def points(self, geometries: Sequence[Geometry], base_size_m: float) -> list[dict[str, Any]]:
        """Rows of the trade-off: every setting with every geometry.

        Parameters
        ----------
        geometries : sequence of Geometry
            The finest polygons first.
        base_size_m : float
            Of the polygons with which all combinations of settings are tried [m].
        """
        best = self.truth or geometries[0].load()
        self.reference = self._finest(traced.load(best, self.variant))
        rows: list[dict[str, Any]] = []
        for_timesteps = []
        for geometry in geometries:
            name = geometry.kind
            name = f"voxels_{geometry.size_m}" if name == "voxels" else name
            is_base = name == "polygons" and geometry.size_m == base_size_m
            scene = geometry.load()
            loaded, load_cost = repeated(partial(traced.load, scene, self.variant), self.repeats)
            small = replace(self.finest_model, sky_patches=PATCHES)
            first, again = (
                timed(partial(self._light, loaded, small, min(self.paths)))[1].wall_s
                for _ in range(2)
            )
            one = _Tried(name, geometry.size_m, scene, self._finest(loaded))
            rows += self._by_transport(one, loaded, load_cost, max(first - again, 0.0), is_base)
            if is_base:
                rows += self._by_less(one)
            if is_base or name in PUBLISHED_VOXELS:
                for_timesteps.append(one)
        for one in for_timesteps:
            rows += self._by_timestep(one)
        return rows

    def _light(self, scene: TracedScene, model: Model, paths: int) -> tuple[np.ndarray, Cost]:
        """PAR (n, t) and what it cost, with rays in proportion to the paths."""
        tracing = replace(
            self.tracing,
            paths=paths,
            sky_rays=paths,
            max_shadow_rays=paths,
            # As many shadow rays as give the sun the paths' own accuracy.
            tolerance=0.5 / DIRECT_SHARE / paths**0.5,
        )
        light, costs = light_and_costs(
            scene,
            self.sensors[POSITION].to_numpy(),
            self.sky,
            self.optics,
            model,
            tracing,
            facing=facing_of(self.sensors),
            seed=self.seed + paths,
        )
        return light.par, sum(costs.values(), Cost())

    def _finest(self, scene: TracedScene) -> np.ndarray:
        return self._light(scene, self.finest_model, FINEST_PATHS)[0]

    def _by_transport(
        self,
        one: "_Tried",
        scene: TracedScene,
        load_cost: Cost,
        compile_s: float,
        is_base: bool,
    ) -> Iterator[dict[str, Any]]:
        """Points of the transport engine on one geometry; all combinations on the base."""
        tried = (
            product(self.paths, self.sky_patches, self.orders)
            if is_base
            else product(self.paths, (PATCHES,), (self.max_orders,))
        )
        for paths, patches, orders in tried:
            model = replace(self.finest_model, sky_patches=patches, max_orders=orders)
            runs = [self._light(scene, model, paths) for _ in range(self.repeats)]
            yield self._point(
                one,
                f"transport, {one.size_m:g} m, {paths} paths, {patches} patches, {orders} orders",
                runs[-1][0],
                load_cost + least(cost for _, cost in runs),
                compile_s,
                engine="transport",
                paths=paths,
                sky_patches=patches,
                max_orders=orders,
            )

    def _by_timestep(self, one: "_Tried") -> Iterator[dict[str, Any]]:
        """Points of the per-timestep engine on one geometry."""
        for rays in self.timestep_rays:
            options = self.timestep | {
                "direct_rays": rays,
                "sky_rays": rays,
                "scattered_rays": max(rays // 2, 1),
            }
            engine = Reference([one.scene], self.sky, self.optics, **options, seed=self.seed)
            load_cost = timed(partial(getattr, engine, "rendered"))[1]
            first = timed(partial(engine.at, 0, self.sensors))[1]
            found, cost = repeated(partial(self._all_times, engine), self.repeats)
            yield self._point(
                one,
                f"per timestep, {one.size_m:g} m, {rays} rays",
                found,
                load_cost + cost,
                max(first.wall_s - cost.wall_s / len(self.open_sky), 0.0),
                engine="timestep",
                paths=rays * options["replicates"],
                max_orders=options["max_depth"] - 1,
            )

    def _by_less(self, one: "_Tried") -> Iterator[dict[str, Any]]:
        """Points of LESS 3, which runs in a process of its own: its start is part of the cost."""
        for rays in self.less_rays:
            options = dict(self.less)
            kept = {name: options.pop(name) for name in ("bands", "aperture_m")}
            sampling = LessRays(**options | {"rays": rays}, seed=self.seed)
            given = [one.scene], self.sky, self.optics, self.sensors
            run = partial(less_engine.series, *given, rays=sampling, **kept)
            found, cost = repeated(run, self.repeats)
            yield self._point(
                one,
                f"LESS 3, {one.size_m:g} m, {rays} rays, {sampling.suns} suns",
                found["par_umol_m2_s"].transpose("sensor", "time").to_numpy(),
                cost,
                0.0,
                engine="less",
                paths=rays,
                max_orders=sampling.max_orders,
            )

    def _all_times(self, engine: Reference) -> np.ndarray:
        """PAR (n, t) of the per-timestep engine."""
        found = [engine.at(k, self.sensors) for k in range(len(self.open_sky))]
        return np.concatenate([one["par_umol_m2_s"].to_numpy() for one in found], axis=1)

    def _point(
        self,
        one: "_Tried",
        setting: str,
        par: np.ndarray,
        cost: Cost,
        compile_s: float,
        **facts: Any,
    ) -> dict[str, Any]:
        """One row of the table."""
        print(f"{one.name} {setting}: {cost.wall_s:.3f} s", flush=True)
        return {
            "setting": setting,
            "reconstruction": one.name,
            "size_m": one.size_m,
            "cost_s": cost.wall_s,
            "cpu_s": cost.cpu_s,
            "compile_s": compile_s,
            "error_rel": rmse_rel(par, self.reference, self.open_sky),
            "error_finest_rel": rmse_rel(par, one.finest, self.open_sky),
            "reference": "truth" if self.truth else "finest polygons",
            "n_sensors": len(self.sensors),
            "n_times": len(self.open_sky),
        } | facts


@dataclass(frozen=True)
class _Tried:
    """A geometry, and PAR (n, t) of the finest setting on it."""

    name: str
    size_m: float
    scene: Scene
    finest: np.ndarray
