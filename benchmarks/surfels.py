"""Polygons and surfels against the true leaves of the default tree, by the step of the scan.

    python benchmarks/surfels.py [--steps 0.12 0.08 0.05 0.04] [--seed 1] [--docs docs]
    python benchmarks/surfels.py --angles        docs/data/surfels_angles.csv

Grows the tree of the default configuration, scans, cleans, classifies and rebuilds it, and traces
the share of the sun's disc that sensors see at the times of the default run. Errors are those of
this share; partial shade is where the true share lies between 5 % and 95 %. Constants of surfels
were chosen on trees of other seeds (docs/data/surfels.csv). Rows of other steps stay in the table.

With `--angles` small trees as on the stability map are rebuilt with leaves that lie flat or stand,
and the area of discs beside leaves of each inclination is compared with that of these leaves. Rows
are means over six trees, with the lowest and the highest of them.
"""

import argparse
import sys
import time
from collections.abc import Iterator
from itertools import pairwise, product
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import xarray as xr
import yaml
from scipy.spatial import cKDTree

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple import steps
from dapple.clock import time_range
from dapple.cloud.classify import classify
from dapple.cloud.clean import clean
from dapple.config.settings import Settings
from dapple.formats import clouds, ground_surface, shots
from dapple.formats.meshes import Mesh
from dapple.light import visibility
from dapple.scene import sensors, traced
from dapple.sky.sun import position
from dapple.streams import stream_seed
from dapple.structure.stem import stem_position
from dapple.virtual import scanner
from dapple.virtual.plants import apple_tree

STABILITY = Path(__file__).parents[1] / "config/stability.yaml"
TOLERANCE, MOST_RAYS = 0.01, 4096
"""Of the share of the sun's disc, and rays for it."""
LIT, SHADED = 0.95, 0.05
ANGLES = ("spherical", "uniform", "plagiophile", "erectophile", "planophile")
INCLINATIONS_DEG = (0, 15, 30, 45, 60, 90)
TREES = range(6)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--steps", type=float, nargs="+", default=[0.12, 0.08, 0.05, 0.04])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    parser.add_argument("--angles", action="store_true")
    options = parser.parse_args()
    if options.angles:
        cases = product(ANGLES, TREES)
        rows = pd.DataFrame([row for case in cases for row in by_inclination(*case)])
        table = over_trees(rows)
        path = options.docs / "data" / "surfels_angles.csv"
        table.to_csv(path, index=False, float_format="%.4g")
        print(table.to_string())
        return
    settings = Settings(seed=options.seed)
    plant = apple_tree(**settings.plant.model_dump(), seed=stream_seed(options.seed, "plant"))
    true = {"leaf": plant.leaves, "wood": plant.wood}
    truth, _ = sunlit(true, settings, plant.wood)
    path = options.docs / "data" / "surfels.csv"
    kept = pd.read_csv(path) if path.is_file() else pd.DataFrame({"step_deg": []})
    kept = kept[~kept["step_deg"].isin(options.steps)]
    rows = []
    for step_deg in options.steps:
        for row in rebuilt(true, step_deg, settings):
            meshes, _ = row.pop("meshes"), row.pop("facts", None)
            seen, seconds = sunlit(meshes, settings, plant.wood)
            row |= {
                "leaf_area_m2": meshes["leaf"].area_m2,
                "true_leaf_area_m2": plant.leaves.area_m2,
                "triangles": sum(len(mesh.faces) for mesh in meshes.values()),
                "light_cpu_s": seconds,
            } | scores(seen, truth)
            rows.append({"step_deg": step_deg} | row)
            print(rows[-1], flush=True)
            table = pd.concat([kept, pd.DataFrame(rows)], ignore_index=True)
            table = table.sort_values("step_deg", ascending=False, kind="stable")
            of_polygons = table[table["reconstruction"] == "polygons"].set_index("step_deg")["rmse"]
            table["rmse_to_polygons"] = table["rmse"] / table["step_deg"].map(of_polygons) - 1
            table.to_csv(path, index=False, float_format="%.4g")


def rebuilt(true: dict[str, Mesh], step_deg: float, settings: Settings) -> Iterator[dict]:
    """Reconstructions of one scan, with the processor time of each [s]."""
    scan = settings.scan.model_dump() | {"angular_step_deg": step_deg}
    places_m = scanner.positions_around(
        stem_position(true["wood"]),
        n=scan.pop("positions"),
        radius_m=scan.pop("radius_m"),
        height_m=scan.pop("height_m"),
    )
    with TemporaryDirectory() as folder:
        path = Path(folder) / "shots.parquet"
        seed = stream_seed(settings.seed, "scan")
        fired = scanner.scan_chunks(true, places_m, **scan, ground_z_m=0.0, seed=seed)
        shots.write_chunks(path, fired)
        cloud = classified(path, settings)
        seed = stream_seed(settings.seed, "polygons")
        begun = time.process_time()
        polygons = steps.polygons(cloud, seed=seed, **settings.polygons.model_dump())
        took_s = time.process_time() - begun
        yield {"reconstruction": "polygons", "meshes": polygons, "cpu_s": took_s}
        for name, fired in (("surfels", shots.iterate(path)), ("surfels without shots", None)):
            begun = time.process_time()
            leaves, facts = steps.surfels(
                cloud,
                fired,
                seed=stream_seed(settings.seed, "surfels"),
                **settings.surfels.model_dump(),
                max_deviation=settings.clean.max_deviation,
            )
            took_s = time.process_time() - begun
            meshes = polygons | {"leaf": leaves}
            yield {"reconstruction": name, "meshes": meshes, "cpu_s": took_s, "facts": facts}
        meshes = polygons | {"leaf": true["leaf"]}
        yield {"reconstruction": "true leaves", "meshes": meshes, "cpu_s": 0.0}


def by_inclination(angles: str, tree: int) -> Iterator[dict]:
    """Area of surfels over that of the true leaves, by the leaves' inclination and of all."""
    settings = Settings.model_validate(yaml.safe_load(STABILITY.read_text()))
    settings = settings.model_copy(update={"seed": settings.seed + tree})
    plant = settings.plant.model_dump() | {"leaf_angle_distribution": angles}
    plant = apple_tree(**plant, seed=stream_seed(settings.seed, "plant"))
    true = {"leaf": plant.leaves, "wood": plant.wood}
    made = rebuilt(true, settings.scan.angular_step_deg, settings)
    row = next(row for row in made if row["reconstruction"] == "surfels")
    discs, facts = row["meshes"]["leaf"], row["facts"]
    corner_m = plant.leaves.vertices_m[plant.leaves.faces]
    inside_m = 0.5 * (corner_m + corner_m.mean(axis=1, keepdims=True))
    _, nearest = cKDTree(inside_m.reshape(-1, 3)).query(
        discs.vertices_m[discs.faces].mean(axis=1), workers=2
    )
    normal, area_m2 = plant.leaves.triangle_normal, plant.leaves.triangle_area_m2
    upright = np.abs(normal[:, 2]) / np.linalg.norm(normal, axis=1)
    group = np.digitize(np.degrees(np.arccos(upright.clip(0, 1))), INCLINATIONS_DEG[1:-1])
    number = len(INCLINATIONS_DEG) - 1
    true_m2 = np.bincount(group, area_m2, number)
    found_m2 = np.bincount(group[nearest // 3], discs.triangle_area_m2, number)
    names = [f"{a} to {b}" for a, b in pairwise(INCLINATIONS_DEG)]
    groups = zip(
        [*names, "all"], [*true_m2, true_m2.sum()], [*found_m2, found_m2.sum()], strict=True
    )
    for name, of_true_m2, of_found_m2 in groups:
        yield {
            "inclination_deg": name,
            "leaf_angles": angles,
            "true_m2": of_true_m2,
            "found": of_found_m2 / of_true_m2,
            "edge_on_share": facts["edge_on_share"] if name == "all" else np.nan,
        }


def over_trees(rows: pd.DataFrame) -> pd.DataFrame:
    """Means over trees, and the lowest and the highest of what is found."""
    groups = rows.groupby(["inclination_deg", "leaf_angles"], sort=False)
    spread = {
        f"{name}_{end}": (name, how)
        for name in ("found", "edge_on_share")
        for end, how in (("low", "min"), ("high", "max"))
    }
    means = {name: (name, "mean") for name in ("true_m2", "found", "edge_on_share")}
    return groups.agg(trees=("true_m2", "size"), **means, **spread).reset_index()


def classified(path: Path, settings: Settings) -> clouds.Cloud:
    """Points of a scan, cleaned and told apart."""
    parts = [shots.to_cloud(chunk) for chunk in shots.iterate(path)]
    names = parts[0].attributes
    cloud = clouds.Cloud(
        np.concatenate([part.xyz_m for part in parts]),
        parts[0].origin_m,
        {name: np.concatenate([part.attributes[name] for part in parts]) for name in names},
    )
    options = settings.clean.model_dump(exclude={"distance_points"})
    programs = {"pdal": settings.tools.pdal, "cloudcompare": settings.tools.cloudcompare}
    cloud, _ = clean(cloud, ground=ground_surface.flat(0.0), where="scan", **options, **programs)
    options = settings.classify.model_dump()
    seed = stream_seed(settings.seed, "classify")
    return classify(cloud, where="scan", **options, seed=seed)[0]


def sunlit(
    meshes: dict[str, Mesh], settings: Settings, wood: Mesh, voxels: xr.Dataset | None = None
) -> tuple[np.ndarray, float]:
    """Share of the sun's disc (sensor, time), and the processor time that it took [s]."""
    grid = settings.sensors.grid()
    places = sensors.grid_around(stem_position(wood), **grid)[["x_m", "y_m", "z_m"]].to_numpy()
    site = settings.site
    times = time_range(**dict(settings.time))
    sun = position(times, site.latitude_deg, site.longitude_deg, site.altitude_m)
    zenith, azimuth = (
        np.radians(sun[f"sun_{name}_deg"].to_numpy()) for name in ("zenith", "azimuth")
    )
    towards = [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)]
    scene = traced.load(steps.scene(meshes, voxels))
    begun = time.process_time()
    seen = visibility.sunlit(
        scene,
        places,
        np.stack(towards, axis=1),
        tolerance=TOLERANCE,
        max_rays=MOST_RAYS,
        seed=stream_seed(settings.seed, "sun"),
        sun_diameter_deg=settings.light.sun_diameter_deg,
    )
    return seen.share.mean(axis=0), time.process_time() - begun


def scores(seen: np.ndarray, truth: np.ndarray) -> dict[str, float]:
    """Error and correlation of the visible share."""
    partial = (truth > SHADED) & (truth < LIT)
    return {
        "rmse": float(np.sqrt(np.mean((seen - truth) ** 2))),
        "bias": float(np.mean(seen - truth)),
        "r": float(np.corrcoef(seen.ravel(), truth.ravel())[0, 1]),
        "r_partial_shade": float(np.corrcoef(seen[partial], truth[partial])[0, 1]),
    }


if __name__ == "__main__":
    main()
