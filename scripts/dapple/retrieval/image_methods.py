"""Images of one plot by every method: how far they are from renders, and how long they take."""

import time
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from dapple.optics.cameras import Camera
from dapple.retrieval import coefficients, comparison, semiless, spectra
from dapple.retrieval.coefficients import Coefficients, Combinations
from dapple.retrieval.comparison import Means
from dapple.retrieval.rendered_images import Renderer
from dapple.retrieval.semiless import Fitted
from dapple.retrieval.spectra import Spectra
from dapple.scene.scene_optics import Optics
from dapple.streams import stream_seed

STRUCTURES = (1.0, 1.5, 2.0, 2.5)
"""PROSPECT's N for which Semi-LESS is looked at."""
PER_STRUCTURE = 64
SPEED = ["method", "combinations", "seconds", "peak_rss_mb", "measured", "paths_per_pixel"]


def render_all(
    renderer: Renderer,
    traced: Coefficients,
    properties: Spectra,
    *,
    towards_sun: np.ndarray,
    bark: np.ndarray,
    diffuse_share: np.ndarray,
    n_paths: int,
    seed: int,
) -> tuple[Means, list[float], int]:
    """Means of direct renders of every combination, their seconds, and paths per pixel.

    Parameters
    ----------
    renderer : Renderer
        With the scene of the plot.
    traced : Coefficients
        For its window and cells.
    properties : Spectra
        Leaves and soils of n combinations.
    towards_sun : (3,) float64
    bark, diffuse_share : (b,) float
    n_paths : int
        Per pixel, at least.
    seed : int
    """
    parts, seconds = [], []
    for k in range(-1, len(properties)):  # the first is not counted: kernels are compiled
        row = max(k, 0)
        optics = Optics.of_tree(
            np.zeros(len(bark)),
            properties.leaf_reflectance[row],
            properties.leaf_transmittance[row],
            np.asarray(bark),
            properties.soil_reflectance[row],
        )
        made = renderer.render(
            traced.window,
            towards_sun,
            optics,
            diffuse_share,
            n_paths=n_paths,
            seed=stream_seed(seed, k),
        )
        if k < 0:
            continue
        parts.append(comparison.of_passes(made.passes, traced.window, traced.cell_m))
        seconds.append(made.seconds)
        print(f"render {k}: {made.seconds:.2f} s")
    return comparison.together(parts), seconds, made.n_paths


class FastImages:
    """Images of any leaves and soils from one trace, by collision orders and by Semi-LESS.

    Parameters
    ----------
    traced : Coefficients
    fitted : Fitted
        Semi-LESS, fitted to the same paths.
    bark, diffuse_share : (b,) float
    """

    def __init__(
        self,
        traced: Coefficients,
        fitted: Fitted,
        bark: np.ndarray,
        diffuse_share: np.ndarray,
    ):
        self.traced, self.fitted = traced, fitted
        self.bark, self.diffuse_share = bark, diffuse_share

    def means(self, properties: Spectra) -> dict[str, Means]:
        """Means over cells of n combinations, by method."""
        leaf = properties.leaf_reflectance, properties.leaf_transmittance
        ground, traced = properties.soil_reflectance, self.traced
        chunks = semiless.image_chunks(self.fitted, *leaf, ground)
        return {
            "collision_orders": comparison.of_coefficients(traced, self._combinations(properties)),
            "semi_less": comparison.of_chunks(chunks, traced.window, traced.cell_m),
        }

    def seconds(self, properties: Spectra) -> dict[str, float]:
        """Seconds that whole images of n combinations take, by method."""
        leaf = properties.leaf_reflectance, properties.leaf_transmittance
        ground = properties.soil_reflectance
        found = {}
        for name, chunks in {
            "collision_orders": coefficients.image_chunks(
                self.traced, self._combinations(properties)
            ),
            "semi_less": semiless.image_chunks(self.fitted, *leaf, ground),
        }.items():
            started = time.perf_counter()
            for _ in chunks:
                pass
            found[name] = time.perf_counter() - started
        return found

    def _combinations(self, properties: Spectra) -> Combinations:
        leaf = properties.leaf_reflectance, properties.leaf_transmittance
        return Combinations(*leaf, self.bark, properties.soil_reflectance, self.diffuse_share)


def errors(
    images: FastImages,
    means: Mapping[str, Means],
    reference: Means,
    leaves_and_soils: Mapping[str, Any],
    camera: Camera,
    seed: int,
) -> pd.DataFrame:
    """Every method against renders; Semi-LESS against collision orders for single N.

    Parameters
    ----------
    images : FastImages
    means : mapping of str to Means
        Of the combinations that were rendered, by method.
    reference : Means
        Of the renders.
    leaves_and_soils : mapping
        See `spectra.combinations`.
    camera : Camera
    seed : int
    """
    parts = [
        comparison.compare(own, reference, camera.names).assign(method=name, reference="direct")
        for name, own in means.items()
    ]
    for structure in STRUCTURES:
        _, properties = spectra.combinations(
            leaves_and_soils,
            PER_STRUCTURE,
            camera,
            seed=stream_seed(seed, "structure"),
            n=structure,
        )
        own = images.means(properties)
        exact = own["collision_orders"]
        # The same paths: they differ without noise.
        exact = Means(exact.cells, np.zeros_like(exact.variance), exact.pixels)
        table = comparison.compare(own["semi_less"], exact, camera.names)
        names = {"method": f"semi_less_n_{structure}", "reference": "collision_orders"}
        parts.append(table.assign(**names))
    return pd.concat(parts)[["method", "reference", *parts[0].columns[:-2]]]


def per_combination(
    drawn: pd.DataFrame,
    properties: Spectra,
    camera: Camera,
    reference: Means,
    means: Mapping[str, Means],
) -> pd.DataFrame:
    """One row per combination and band: what went in, and image means of all methods."""
    rows = []
    all_means = {"direct": reference.image} | {name: own.image for name, own in means.items()}
    for k in range(len(drawn)):
        for b, band in enumerate(camera.names):
            row = {"combination": k, **drawn.iloc[k], "band": band}
            row["leaf_reflectance"] = properties.leaf_reflectance[k, b]
            row["leaf_transmittance"] = properties.leaf_transmittance[k, b]
            row["soil_reflectance"] = properties.soil_reflectance[k, b]
            for name, (mean, variance) in all_means.items():
                row[name], row[f"{name}_error"] = mean[k, b], np.sqrt(variance[k, b])
            rows.append(row)
    return pd.DataFrame(rows)


def speed(
    images: FastImages,
    properties: Spectra,
    *,
    tracing: Mapping[str, float],
    fitting: Mapping[str, float],
    render_s: Sequence[float],
    render_paths: int,
    render_peak_mb: float,
    table: pd.DataFrame,
) -> pd.DataFrame:
    """Seconds and memory of images of n combinations by every method, with their errors.

    Parameters
    ----------
    images : FastImages
    properties : Spectra
        Of n combinations.
    tracing, fitting : mapping
        `seconds` and `peak_rss_mb` of what methods need before their first image.
    render_s, render_paths, render_peak_mb
        Seconds of single renders, their paths per pixel and memory.
    table : DataFrame
        As `errors` gives it.
    """
    n, n_paths = len(properties), images.traced.n_paths
    took = images.seconds(properties)
    before = {
        "collision_orders": (tracing["seconds"], tracing["peak_rss_mb"]),
        "semi_less": (
            tracing["seconds"] + fitting["seconds"],
            max(tracing["peak_rss_mb"], fitting["peak_rss_mb"]),
        ),
    }
    rows = [
        (name, n, first_s + took[name], peak_mb, n, n_paths)
        for name, (first_s, peak_mb) in before.items()
    ]
    all_s, count = float(np.mean(render_s)) * n, len(render_s)
    # In proportion to the paths.
    fair_s = all_s * n_paths / render_paths
    rows += [
        ("direct", n, all_s, render_peak_mb, count, render_paths),
        ("direct_same_paths", n, fair_s, render_peak_mb, count, n_paths),
    ]
    found = pd.DataFrame(rows, columns=SPEED)
    worst = table[(table.reference == "direct") & (table.scale == "image")].groupby("method")
    found["rmse_vs_direct"] = found.method.map(worst.rmse.max())
    found["max_vs_direct"] = found.method.map(worst["max"].max())
    return found
