"""Error and cost of light over a grid of settings, all in this process."""

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from dapple.advice import tradeoff
from dapple.formats import netcdf, tables, voxel_grids
from dapple.light import light_model, series
from dapple.light.light_model import Cost, Effort, Model, timed
from dapple.light.timestep_series import Reference
from dapple.scene import scene_files, scene_optics, traced
from dapple.scene.surfaces import WOOD, Scene
from dapple.workflow import run

FINEST_PATHS, FINEST_PATCHES = 65_536, 2305
PATCHES, PATHS = 577, 4096
"""Of settings that vary something else."""


class Grid:
    """The sensors, times and references that all points share."""

    def __init__(self, params, inputs):
        sky, self.optics = netcdf.read(inputs.sky), scene_optics.read(inputs.optics)
        table = tables.read(inputs.sensors)
        lit = np.flatnonzero(series.open_sky_par(sky).to_numpy() > 0)
        self.sky = sky.isel(time=lit[light_model.spread(len(lit), params.times)])
        self.table = table.iloc[light_model.spread(len(table), params.sensors)]
        self.points_m = self.table[["x_m", "y_m", "z_m"]].to_numpy()
        self.open_sky = series.open_sky_par(self.sky).to_numpy()
        self.params = params
        self.finest_model = Model(
            sky_patches=FINEST_PATCHES, max_orders=params.max_orders, bands=len(self.optics)
        )
        # Without a truth the first geometry, the finest polygons, stands for it.
        _, _, best = next(geometries(params, inputs))
        if inputs.truth:
            best = scene_files.read([inputs.truth[0]], inputs.truth[1], params.ground_z_m)[0]
        self.reference = self.finest(traced.load(best, params.variant))
        self.reference_name = "truth" if inputs.truth else "finest polygons"

    def effort(self, paths: int) -> Effort:
        """Rays in proportion: as many shadow rays as give the sun the paths' own accuracy."""
        return Effort(
            paths=paths,
            sky_rays=paths,
            shadow_tolerance=0.5 / paths**0.5,
            max_shadow_rays=paths,
            sun_diameter_deg=self.params.sun_diameter_deg,
            aperture_m=self.params.aperture_m,
            sun_kernel_deg=self.params.sun_kernel_deg,
        )

    def light(self, scene, model, paths, repeats=1):
        """PAR (n, t) and what it cost."""
        runs = [
            light_model.light(
                scene,
                self.points_m,
                self.sky,
                self.optics,
                model,
                self.effort(paths),
                seed=self.params.seed + paths,
            )
            for _ in range(repeats)
        ]
        costs = [sum(parts.values(), Cost()) for _, parts in runs]
        return runs[-1][0].par, light_model.least(costs)

    def finest(self, scene):
        """PAR (n, t) of the finest setting."""
        return self.light(scene, self.finest_model, FINEST_PATHS)[0]

    def point(self, name, size_m, setting, par, finest, cost, compile_s, **facts):
        """One row of the table."""
        row = {
            "setting": setting,
            "reconstruction": name,
            "size_m": size_m,
            "cost_s": cost.wall_s,
            "cpu_s": cost.cpu_s,
            "compile_s": compile_s,
            "error_rel": tradeoff.rmse_rel(par, self.reference, self.open_sky),
            "error_finest_rel": tradeoff.rmse_rel(par, finest, self.open_sky),
            "reference": self.reference_name,
            "n_sensors": len(self.points_m),
            "n_times": len(self.open_sky),
        } | facts
        print(f"{name} {setting}: {row['cost_s']:.3f} s", flush=True)
        return row


def settings_of(params, is_base):
    """Paths, patches and orders that a geometry is tried with; all combinations for one of them."""
    if is_base:
        return list(product(params.paths, params.sky_patches, params.orders))
    return [(paths, PATCHES, params.max_orders) for paths in params.paths]


def transport_points(grid, name, size_m, scene, finest, load_cost, compile_s, is_base):
    """Points of the transport engine on one geometry."""
    rows = []
    for paths, n_patches, orders in settings_of(grid.params, is_base):
        model = replace(grid.finest_model, sky_patches=n_patches, max_orders=orders)
        par, cost = grid.light(scene, model, paths, grid.params.repeats)
        setting = f"transport, {size_m:g} m, {paths} paths, {n_patches} patches, {orders} orders"
        facts = {
            "engine": "transport",
            "paths": paths,
            "sky_patches": n_patches,
            "max_orders": orders,
        }
        rows.append(
            grid.point(name, size_m, setting, par, finest, load_cost + cost, compile_s, **facts)
        )
    return rows


def timestep_points(grid, name, size_m, scene, finest):
    """Points of the per-timestep engine on one geometry."""
    rows = []
    for rays in grid.params.timestep_rays:
        options = grid.params.timestep | {
            "direct_rays": rays,
            "sky_rays": rays,
            "scattered_rays": max(rays // 2, 1),
        }
        engine = Reference([scene], grid.sky, grid.optics, **options, seed=grid.params.seed)
        load_cost = timed(partial(getattr, engine, "rendered"))[1]
        first = timed(partial(engine.at, 0, grid.table))[1]
        runs = [
            timed(lambda e=engine: [e.at(k, grid.table) for k in grid_times(grid)])
            for _ in range(grid.params.repeats)
        ]
        found, cost = runs[-1][0], light_model.least([one for _, one in runs])
        par = np.concatenate([one["par_umol_m2_s"].to_numpy() for one in found], axis=1)
        compile_s = max(first.wall_s - cost.wall_s / len(found), 0.0)
        setting = f"per timestep, {size_m:g} m, {rays} rays"
        facts = {"engine": "timestep", "paths": rays * options["replicates"]}
        facts["max_orders"] = options["max_depth"] - 1
        rows.append(
            grid.point(name, size_m, setting, par, finest, load_cost + cost, compile_s, **facts)
        )
    return rows


def grid_times(grid):
    """Indices of the grid's times."""
    return range(len(grid.open_sky))


def geometries(params, inputs):
    """Name, size and scene of every geometry."""
    for size, leaves, wood in zip(
        params.polygon_sizes_m, inputs.sized_leaves, inputs.sized_wood, strict=False
    ):
        yield "polygons", size, scene_files.read([leaves], wood, params.ground_z_m)[0]
    base = scene_files.read([inputs.leaves], inputs.wood, params.ground_z_m)[0]
    if not inputs.sized_leaves:
        yield "polygons", params.polygon_size_m, base
    for size, path in zip(params.voxel_sizes_m, inputs.voxels, strict=False):
        yield (
            f"voxels_{size}",
            size,
            Scene(base.of(WOOD), voxel_grids.read(path), params.ground_z_m),
        )


def main(snakemake):
    params = snakemake.params
    grid = Grid(params, snakemake.input)
    rows, references = [], []
    for name, size_m, scene in geometries(params, snakemake.input):
        loads = [
            timed(lambda s=scene: traced.load(s, params.variant)) for _ in range(params.repeats)
        ]
        loaded, load_cost = loads[-1][0], light_model.least([cost for _, cost in loads])
        small = replace(grid.finest_model, sky_patches=PATCHES)
        first, again = (
            timed(lambda m=small, s=loaded: grid.light(s, m, min(params.paths)))[1].wall_s
            for _ in range(2)
        )
        finest = grid.finest(loaded)
        is_base = name == "polygons" and size_m == params.polygon_size_m
        rows += transport_points(
            grid, name, size_m, loaded, finest, load_cost, max(first - again, 0.0), is_base
        )
        if is_base or (name in tradeoff.PUBLISHED_S and name != "polygons"):
            references.append((name, size_m, scene, finest))
    for name, size_m, scene, finest in references:
        rows += timestep_points(grid, name, size_m, scene, finest)
    tables.write(snakemake.output.points, tradeoff.table(rows))


if __name__ == "__main__":
    run(main, snakemake)
