"""The published apple tree on ten random halves of its sensors, each with its own fit.

    python benchmarks/apple.py [--folder results/apple] [--docs docs] [--halves-alone] [--step 5]

Needs a finished run of config/apple.yaml. For every half of the sensors the shift of the tree and
the gain of the site are fitted on that half alone; the other half reports.

docs/data/apple_choices.csv: how leaves are placed, their sway, the gain and the interval of a
record, compared with direct light and an even sky on a grid of shifts; what fits the fitting halves
best is what config/apple.yaml takes. docs/data/apple_clock.csv: the clock offset that fits each
half best. docs/data/apple_halves.csv: the whole model of that configuration on each half, with
--halves-alone nothing else, with --step on records so many minutes apart;
docs/data/apple_halves_summary.csv: mean and range over the halves.
"""

import argparse
import itertools
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from published_apple import Run
from scipy.ndimage import gaussian_filter1d

from dapple.light.rays_to_sky import Tracer
from dapple.optics.responses import COSINE
from dapple.registration import shading
from dapple.scene import traced
from dapple.scene.surfaces import Scene, of_kinds
from dapple.sky.open_sky import towards_sun
from dapple.sky.solar_disc import SUN_DIAMETER_DEG
from dapple.stats.measures import pearson
from dapple.streams import stream_seed
from dapple.virtual.leaves import along_wood

N_HALVES = 10
LEAVES = {  # leaves on a shoot, longest shoot [m]
    "128 on a shoot": (128, 0.2), "16": (16, 0.2), "1": (1, 0.2),
    "128, shoots to 0.3 m": (128, 0.3), "1, to 0.3 m": (1, 0.3), "1, to 0.4 m": (1, 0.4),
}  # fmt: skip
SWAY_M = (0.0, 0.05, 0.1, 0.15)
STEP_M, REACH_M, FINE_S, CLOCK_S = 0.1, 0.4, 30.0, 300.0


@dataclass(frozen=True)
class Grid:
    """Direct light and an even sky at all sensors for a square of shifts of the tree.

    Attributes
    ----------
    sunlit : (k, k, sensor, fine time) float32
        Share of the sun's disc, mean over placements of leaves.
    open_sky : (k, k, sensor) float32
    beam, diffuse : (fine time,) float64
        Light of sun and sky on the level [µmol m⁻² s⁻¹].
    """

    sunlit: np.ndarray
    open_sky: np.ndarray
    beam: np.ndarray
    diffuse: np.ndarray

    @property
    def shifts_m(self) -> np.ndarray:
        """(k², 2) east and north."""
        axis = np.round(np.arange(-REACH_M, REACH_M + 1e-9, STEP_M), 6)
        return np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)

    def swaying(self, sway_m: float) -> "Grid":
        """Light averaged over shifts of this standard deviation."""
        parts = [self.sunlit, self.open_sky]
        for axis in (0, 1) if sway_m else ():
            parts = [gaussian_filter1d(x, sway_m / STEP_M, axis, mode="nearest") for x in parts]
        return Grid(*parts, self.beam, self.diffuse)

    def light(self, index: np.ndarray, mean_of_minute: bool) -> tuple[np.ndarray, np.ndarray]:
        """PAR and the sun's share (k², sensor, record), at an instant or as mean of a minute."""
        sunlit = self.sunlit.reshape(-1, *self.sunlit.shape[2:])
        par = sunlit * self.beam + self.open_sky.reshape(len(sunlit), -1, 1) * self.diffuse
        weights = {-1: 0.25, 0: 0.5, 1: 0.25} if mean_of_minute else {0: 1.0}
        return sum(w * par[..., index + k] for k, w in weights.items()), sunlit[..., index]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=Path("results/apple"))
    parser.add_argument("--placements", type=int, default=8)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    parser.add_argument("--halves-alone", action="store_true")
    parser.add_argument("--step", type=float, default=1.0, help="minutes between times")
    options = parser.parse_args()
    run = Run(options.folder, options.step)
    found = {}
    if not options.halves_alone:
        found["apple_choices"], found["apple_clock"] = compare(run, options.placements)
    found["apple_halves"] = whole_model(run)
    found["apple_halves_summary"] = summary(found["apple_halves"])
    for name, table in found.items():
        table.to_csv(options.docs / "data" / f"{name}.csv", index=False, float_format="%.5g")
        print(table.to_string(index=False, float_format=lambda value: f"{value:.4g}"), flush=True)


def halves(names: list[str]) -> list[np.ndarray]:
    """Which sensors fit: N_HALVES draws of half of them."""
    drawn = []
    for seed in range(N_HALVES):
        fits = np.zeros(len(names), bool)
        fits[np.random.default_rng(seed).permutation(len(names))[: len(names) // 2]] = True
        drawn.append(fits)
    return drawn


def compare(run: Run, n_placements: int) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Settings on all halves, and clock offsets under the one that fits best."""
    table = run.records.pivot(index="sensor", columns="time", values="par_umol_m2_s")
    measured = table.loc[list(run.sensors["sensor"])].to_numpy()
    margin = pd.Timedelta(seconds=CLOCK_S + 2 * FINE_S)
    fine = pd.date_range(table.columns[0] - margin, table.columns[-1] + margin, freq=f"{FINE_S:g}s")
    index = np.searchsorted(fine, table.columns)
    drawn, rows, grids = halves(list(run.sensors["sensor"])), [], {}
    for name, (on_shoot, reach_m) in LEAVES.items():
        placing = run.settings.leaves.model_dump(exclude={"placements", "path"})
        placing |= {"leaves_per_shoot": on_shoot, "max_distance_m": reach_m}
        grids[name] = traced_grid(run, placing, n_placements, fine)
        for sway_m, minute in itertools.product(SWAY_M, (False, True)):
            grid = grids[name].swaying(sway_m)
            par, sunlit = grid.light(index, minute)
            for gain in ("none", "site"):
                found = pd.DataFrame([scored(par, sunlit, measured, f, gain) for f in drawn])
                rows.append(
                    {"leaves": name, "sway_m": sway_m, "minute": minute, "gain": gain}
                    | found.mean().to_dict()
                    | {"r_least": found["r"].min(), "r_most": found["r"].max()}
                )
        print(name, flush=True)
    choices = pd.DataFrame(rows)
    best = choices.loc[choices["r_fit"].idxmax()]
    grid = grids[best["leaves"]].swaying(best["sway_m"])
    clocks = pd.DataFrame([best_clock(grid, index, measured, k, f) for k, f in enumerate(drawn)])
    return choices, clocks


def traced_grid(run: Run, placing: dict, n_placements: int, fine: pd.DatetimeIndex) -> Grid:
    """Trace what sensors see of sun and sky at every shift of the tree."""
    sky = run.sky(fine)
    sun = towards_sun(sky)
    points_m = run.sensors[["x_m", "y_m", "z_m"]].to_numpy()
    k = 2 * round(REACH_M / STEP_M) + 1
    sunlit = np.zeros((k * k, len(points_m), len(fine)), np.float32)
    open_sky = np.zeros((k * k, len(points_m)), np.float32)
    empty = Grid(sunlit, open_sky, np.empty(0), np.empty(0))
    for number in range(n_placements):
        leaves = along_wood(run.wood, **placing, seed=stream_seed(11, number))
        tracer = Tracer(Scene(of_kinds(leaf=leaves, wood=run.wood)), "llvm_ad_mono")
        for at, shift_m in enumerate(empty.shifts_m):
            moved = points_m - [*shift_m, 0.0]
            seen = tracer.sun_visibility(
                moved, sun, n_disc=16, sun_diameter_deg=SUN_DIAMETER_DEG, seed=number
            )
            sunlit[at] += seen / n_placements
            open_sky[at] += tracer.sky_visibility(moved, n=256, seed=number) / n_placements
    return Grid(
        sunlit.reshape(k, k, *sunlit.shape[1:]),
        open_sky.reshape(k, k, -1),
        sky["beam_normal_umol_m2_s"].sum("band").to_numpy() * np.maximum(sun[:, 2], 0),
        sky["diffuse_horizontal_umol_m2_s"].sum("band").to_numpy(),
    )


def scored(par, sunlit, measured, fits, gain) -> dict[str, float]:
    """Shift and gain from the fitting sensors; errors on both parts."""
    fitting, reporting = (np.where(part[:, None], measured, np.nan) for part in (fits, ~fits))
    known = np.isfinite(fitting)
    at = int(np.argmax([pearson(measured[known], one[known]) for one in par]))
    factor = 1.0
    if gain == "site":
        factor = shading.open_sky_gain(fitting, par[at], sunlit[at])["gain"]
    found = {"gain_found": factor}
    for end, part in (("_fit", fitting), ("", reporting)):
        known = np.isfinite(part)
        error = factor * par[at][known] - part[known]
        found |= {
            f"r{end}": pearson(part[known], par[at][known]),
            f"rmse{end}": float(np.sqrt((error**2).mean())),
            f"bias{end}": float(error.mean()),
        }
    return found


def best_clock(grid: Grid, index, measured, number: int, fits) -> dict[str, float]:
    """The clock offset of the highest r on the fitting sensors, each with its best shift."""
    known = np.isfinite(measured) & fits[:, None]
    r = {}
    for steps in range(-round(CLOCK_S / FINE_S), round(CLOCK_S / FINE_S) + 1):
        par = grid.light(index - steps, True)[0]
        r[steps * FINE_S] = max(pearson(measured[known], one[known]) for one in par)
    best = max(r, key=r.get)
    return {"half": number, "clock_offset_s": best, "r_fit": r[best], "r_fit_at_0": r[0.0]}


def whole_model(run: Run) -> pd.DataFrame:
    """Every reconstruction on every half, with all light, as a run of the configuration does it."""
    settings, names = run.settings, list(run.sensors["sensor"])
    scenes = {name: run.scenes(name) for name in settings.reconstructions}
    loaded = {name: [traced.load(one) for one in some] for name, some in scenes.items()}
    rows = []
    for number, fits in enumerate(halves(names)):
        fitting = [name for name, one in zip(names, fits, strict=True) if one]
        found = shading.register(
            scenes["polygons"],
            run.sensors,
            run.records[run.records["sensor"].isin(fitting)],
            sky_at=run.sky,
            max_shift_m=settings.registration.max_shift_m,
            max_clock_offset_s=0.0,
            # All records that are given fit; the last time alone is left, and nothing reads it.
            split_by="time",
            fit_share=0.999,
            gain="site",
            sun_diameter_deg=settings.light.sun_diameter_deg,
            aperture_m=settings.light.entrance_m,
            response=COSINE,
            variant="llvm_ad_mono",
            seed=3,
        )
        sky, shift_m = run.sky(gain=found["gain"]), (found["east_m"], found["north_m"])
        for name, some in loaded.items():
            par = np.mean([light.par for light in run.light(some, sky, shift_m)], axis=0)
            parts = {"": [n for n in names if n not in fitting], "_fit": fitting}
            rows.append(
                {"reconstruction": name, "half": number}
                | {f"{k}{end}": v for end, part in parts.items()
                   for k, v in run.score(par, part).items()}
                | {key: found[key] for key in ("gain", "east_m", "north_m")}
            )  # fmt: skip
            print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def summary(by_half: pd.DataFrame) -> pd.DataFrame:
    """Mean, least and most of r, RMSE and bias on the sensors that did not fit, over all halves."""
    parts = by_half.groupby("reconstruction", sort=False)[["n", "r", "rmse", "bias", "gain"]]
    columns = {end: getattr(parts, end)() for end in ("mean", "min", "max")}
    named = [table.add_suffix(f"_{end}") for end, table in columns.items()]
    return pd.concat([parts.size().rename("halves"), *named], axis=1).reset_index()


if __name__ == "__main__":
    main()
