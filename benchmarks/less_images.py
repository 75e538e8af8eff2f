"""Images of many leaves and soils from one trace, against LESS 3's own images of each.

    python benchmarks/less_images.py RUN [--plot larch] [--results results] [--paths 1024]

RUN is a run of `study: chlorophyll` that has compared images with single renders by Mitsuba
(`chlorophyll.images.direct_renders`). The same combinations are photographed by LESS in one run:
each band of each combination is a wavelength of its own, since LESS sends the same rays through all
wavelengths. Collision orders, Semi-LESS and Mitsuba's renders are compared with LESS' images by
band, over cells and over the whole image: `less_images.csv`.

The same leaves and soils, and ten times as many, are then made by collision orders from a trace of
their own and by LESS, in turns: `less_images_cost.csv`, with the processor time of whole processes
of LESS and of dapple's functions. `ratio` is that of LESS over dapple's at an equal standard error
of cells in the last band: the error of LESS falls with the root of its paths.
"""

import argparse
import resource
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.config.chlorophyll import Chlorophyll  # noqa: E402
from dapple.config.settings import Settings  # noqa: E402
from dapple.formats import json, meshes, tables  # noqa: E402
from dapple.formats.meshes import Mesh  # noqa: E402
from dapple.frames import direction_from_angles  # noqa: E402
from dapple.optics.cameras import Camera, camera  # noqa: E402
from dapple.retrieval import coefficient_files as files  # noqa: E402
from dapple.retrieval import coefficients, comparison, image_paths  # noqa: E402
from dapple.retrieval.coefficients import Coefficients, Combinations, Window  # noqa: E402
from dapple.retrieval.comparison import Means  # noqa: E402
from dapple.retrieval.image_methods import FastImages  # noqa: E402
from dapple.retrieval.spectra import Spectra  # noqa: E402
from dapple.scene import scene_files, traced  # noqa: E402
from dapple.virtual import less_camera  # noqa: E402
from dapple.virtual.camera import View  # noqa: E402
from dapple.virtual.plot_optics import Materials  # noqa: E402

AROUND = 30.0
"""The ground goes on around the plot, by so many of its heights: with 10, LESS' images were 0.3 %
darker in the near infrared, with 3 they were 0.8 %."""
NAMES = {
    "collision_orders": "collision orders",
    "semi_less": "Semi-LESS",
    "direct": "renders by Mitsuba",
}
PROPERTIES = ["leaf_reflectance", "leaf_transmittance", "soil_reflectance"]
MORE = 16
"""The noise of LESS is found from an image with so many times fewer paths."""
REPEATED = (1, 10)
"""How often the same combinations are made for the times."""
FIRST_NM = 400.0
"""Wavelengths, one nanometre apart, say nothing here but which band of which combination it is."""


def world(scene: Path) -> tuple[Mesh, np.ndarray]:
    """The plot and ground around it as one mesh; of every triangle 0, 1, 2: leaf, wood, ground."""
    parts = [meshes.read_ply(scene / f"{name}.ply") for name in ("leaves", "wood", "terrain")]
    corners_m = np.array(
        [[end(part.vertices_m, axis=0) for part in parts] for end in (np.min, np.max)]
    )
    low, high = corners_m[0].min(axis=0), corners_m[1].max(axis=0)
    away = AROUND * (high[2] - low[2])
    west, south, east, north = *(low[:2] - away), *(high[:2] + away)
    corners = [[west, south], [east, south], [east, north], [west, north]]
    lowest_ground_m = corners_m[0, 2, 2]
    around = Mesh(
        np.column_stack([corners, np.full(4, lowest_ground_m)]),
        np.array([[0, 1, 2], [0, 2, 3]], np.int32),
        np.zeros(2, np.int32),
    )
    parts.append(around)
    kind = np.repeat([0, 1, 2, 2], [len(part.faces) for part in parts])
    return meshes.concatenate(parts), kind


@dataclass(frozen=True)
class Case:
    """A plot of a run, and leaves and soils of n combinations in b bands, (n, b) each."""

    folder: Path
    settings: Chlorophyll
    window: Window
    properties: Spectra

    @property
    def camera(self) -> Camera:
        return camera(self.settings.camera_bands)

    @property
    def bark(self) -> np.ndarray:
        """(b,) reflectance."""
        return self.camera.at_centres(self.settings.images.bark_reflectance)

    @property
    def diffuse_share(self) -> np.ndarray:
        """(b,) of the light on level ground."""
        return np.asarray(json.read(self.folder / "light/sky.json")["diffuse_share"])

    @property
    def sun_deg(self) -> dict[str, float]:
        """Zenith angle and azimuth [°]."""
        sun = json.read(self.folder / "light/sun.json")
        return {name: sun[name] for name in ("sun_zenith_deg", "sun_azimuth_deg")}

    def repeated(self, number: int) -> "Case":
        """The same combinations so many times."""
        both = self.properties
        tiled = (np.tile(getattr(both, name), (number, 1)) for name in PROPERTIES)
        return replace(self, properties=Spectra(*tiled))


def by_less(case: Case, paths: int) -> np.ndarray:
    """Images by LESS, (n, b, rows, columns)."""
    shape = case.properties.leaf_reflectance.shape
    mesh, kind = world(case.folder / "scene")
    opaque = np.zeros(shape)
    reflected = (
        case.properties.leaf_reflectance,
        np.broadcast_to(case.bark, shape),
        case.properties.soil_reflectance,
    )
    transmitted = case.properties.leaf_transmittance, opaque, opaque
    window = case.window
    image = less_camera.photograph(
        mesh,
        Materials(*(np.reshape(one, (3, -1)) for one in (reflected, transmitted)), kind),
        View(window.left_m, window.top_m, window.rows, window.columns, window.pixel_m),
        wavelength_nm=FIRST_NM + np.arange(opaque.size),
        **case.sun_deg,
        diffuse_share=np.broadcast_to(case.diffuse_share, shape).ravel(),
        paths_per_pixel=paths,
        seed=0,
    )
    return image.reshape(*shape, window.rows, window.columns)


def by_orders(case: Case, n_paths: int) -> Coefficients:
    """A trace as the run's, and whole images of all combinations by collision orders."""
    images, sun = case.settings.images, case.sun_deg
    names = ("leaves", "wood", "terrain")
    scene = scene_files.read_plot(*(case.folder / f"scene/{name}.ply" for name in names))
    found = image_paths.trace(
        traced.load(scene, "llvm_ad_rgb"),
        case.window,
        direction_from_angles(sun["sun_zenith_deg"], sun["sun_azimuth_deg"]),
        n_paths=n_paths,
        n_columns=images.columns,
        max_orders=images.max_orders,
        cell_m=case.settings.retrieval.map_pixel_m,
        seed=1,
    )
    leaf = case.properties.leaf_reflectance, case.properties.leaf_transmittance
    soil = case.properties.soil_reflectance
    made = Combinations(*leaf, case.bark, soil, case.diffuse_share)
    for _ in coefficients.image_chunks(found, made):
        pass
    return found


def cost(
    case: Case, n_paths: int, paths: int, error_of_orders: float, error_of_less: float
) -> pd.DataFrame:
    """Processor time of both with more and more combinations, a row a number."""
    rows = []
    for number in REPEATED:
        many = case.repeated(number)
        began = time.process_time()
        by_orders(many, n_paths)
        dapple_s, began = time.process_time() - began, children_s()
        by_less(many, paths)
        row = {"combinations": len(many.properties), "dapple_paths": n_paths, "less_paths": paths}
        row |= {"dapple_cpu_s": dapple_s, "less_cpu_s": children_s() - began}
        row |= {"dapple_error": error_of_orders, "less_error": error_of_less}
        row["ratio"] = row["less_cpu_s"] / dapple_s * (error_of_less / error_of_orders) ** 2
        rows.append(row)
    return pd.DataFrame(rows)


def children_s() -> float:
    """Processor time of all children that have ended [s]."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def of_cells(images: np.ndarray, window: Window, cell_m: float) -> Means:
    """Means over cells, as if they had no noise."""
    cell, n_cells = window.cells(cell_m)
    pixels = np.bincount(cell, minlength=n_cells)
    flat = images.reshape(-1, window.n_pixels)
    sums = np.array([np.bincount(cell, row, n_cells) for row in flat]) / pixels
    cells = sums.reshape(*images.shape[:2], n_cells).swapaxes(1, 2)
    return Means(cells, np.zeros_like(cells), pixels)


def with_noise(many: Means, few: Means, other: Means) -> Means:
    """Means of many paths with their variance by band, since LESS tells none.

    Of `MORE` times as many paths the variance is so much smaller, and what does not come from paths
    stays: the mean squares of differences from another method tell it.
    """
    squares = [((one.cells - other.cells) ** 2).mean(axis=(0, 1)) for one in (few, many)]
    variance = np.maximum(squares[0] - squares[1], 0.0) / (MORE - 1)
    return Means(many.cells, np.broadcast_to(variance, many.cells.shape), many.pixels)


def of_renders(
    mean: np.ndarray, error: np.ndarray, less: Means, bands: tuple[str, ...]
) -> pd.DataFrame:
    """Mitsuba's renders against LESS, over whole images: their cells are not kept."""
    whole = np.array([less.pixels.sum()])
    own = Means(mean[:, None], error[:, None] ** 2, whole)
    table = comparison.compare(own, Means(*(x[:, None] for x in less.image), whole), bands)
    return table[table["scale"] == "image"]


def relative(table: pd.DataFrame, method: str) -> pd.DataFrame:
    """A row a band: errors and noise over the mean of LESS, of the whole image and of cells."""
    table = table.set_index(["scale", "band"])
    noise = np.hypot(table["noise_method"], table["noise_reference"])
    shares = table[["bias", "rmse", "max"]].assign(noise=noise).div(table["mean"], axis=0)
    mean = table["mean"].loc["image"]
    found = pd.DataFrame({"method": method, "mean": mean})
    for scale in table.index.unique("scale"):
        found = found.join(shares.loc[scale].add_prefix(f"{scale}_"))
    return found.reset_index().drop(columns=["cell_bias"], errors="ignore")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run")
    parser.add_argument("--plot", default="larch")
    parser.add_argument("--paths", type=int, default=1024, help="a pixel, of LESS")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data")
    options = parser.parse_args()
    folder = options.results / options.run
    settings = Settings(**yaml.safe_load((folder / "config.yaml").read_text())).chlorophyll
    plot, bands = folder / "plots" / options.plot, camera(settings.camera_bands).names
    own = files.read(plot / "images/coefficients.nc")
    fitted = files.read_semiless(plot / "images/semiless.nc")
    renders = tables.read(plot / "images/renders.csv")
    renders = renders.astype({"band": str}).pivot(index="combination", columns="band")
    values = {
        name: renders[name][list(bands)].to_numpy()
        for name in (*PROPERTIES, "direct", "direct_error")
    }
    case = Case(plot, settings, own.window, Spectra(*(values[name] for name in PROPERTIES)))
    methods = FastImages(own, fitted, case.bark, case.diffuse_share).means(case.properties)
    orders = methods["collision_orders"]
    many, few = (
        of_cells(by_less(case, paths), own.window, own.cell_m)
        for paths in (options.paths, options.paths // MORE)
    )
    less = with_noise(many, few, orders)
    found = {name: comparison.compare(one, less, bands) for name, one in methods.items()}
    found["direct"] = of_renders(values["direct"], values["direct_error"], less, bands)
    table = pd.concat([relative(one, NAMES[name]) for name, one in found.items()])
    tables.write(options.output / "less_images.csv", table, "%.4g")
    print(table.to_string(index=False))
    errors = [float(np.sqrt(one.variance[..., -1].mean())) for one in (orders, less)]
    costs = cost(case, own.n_paths, options.paths, *errors)
    tables.write(options.output / "less_images_cost.csv", costs, "%.4g")
    print(costs.to_string(index=False))


if __name__ == "__main__":
    main()
