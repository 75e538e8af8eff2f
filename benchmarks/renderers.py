"""Images of one virtual plot by Mitsuba and by LESS 3, and what is retrieved from each.

    python benchmarks/renderers.py MITSUBA_RUN LESS_RUN [--plot larch] [--results results]

The runs differ in `chlorophyll.world.renderer` alone. Writes `renderers.csv`: mean reflectance of
the plot by band, and root mean square difference and correlation of cells of 3 m;
`renderers_cost.csv`: processor time and memory of the images; and, where both runs have retrieved
chlorophyll, `renderers_retrieval.csv`: its errors on the field trees. Rows of plots of another edge
stay.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "scripts"))

from dapple.formats import rasters, tables  # noqa: E402

CELL_M = 3.0


def cells(raster: rasters.Raster) -> np.ndarray:
    """(b, cells) mean reflectance of whole cells."""
    edge = round(CELL_M / raster.pixel_m)
    n_rows, n_columns = (n // edge for n in raster.values.shape[1:])
    whole = raster.values[:, : n_rows * edge, : n_columns * edge].astype(float)
    parts = whole.reshape(len(whole), n_rows, edge, n_columns, edge)
    return parts.mean(axis=(2, 4)).reshape(len(whole), -1)


def images_of(folders: list[Path], plot: str) -> list[rasters.Raster]:
    """Of each run."""
    return [rasters.read(folder / f"plots/{plot}/world/images.tif") for folder in folders]


def of_images(images: list[rasters.Raster]) -> pd.DataFrame:
    """A row a band."""
    mitsuba, less = (cells(image) for image in images)
    return pd.DataFrame(
        {
            "band": images[0].bands,
            "mitsuba": mitsuba.mean(axis=1),
            "less": less.mean(axis=1),
            "difference_rel": less.mean(axis=1) / mitsuba.mean(axis=1) - 1.0,
            "cell_rmse_rel": np.sqrt(((less - mitsuba) ** 2).mean(axis=1)) / mitsuba.mean(axis=1),
            "cell_r": [np.corrcoef(*both)[0, 1] for both in zip(mitsuba, less, strict=True)],
        }
    )


def of_cost(folders: list[Path], plot: str) -> pd.DataFrame:
    """A row a renderer: what its images took, the reading and writing of files included."""
    found = []
    for renderer, folder in zip(("mitsuba", "less"), folders, strict=True):
        taken = pd.read_csv(folder / f"benchmarks/uav_images_{plot}.tsv", sep="\t").iloc[0]
        row = {"cpu_s": float(taken["cpu_time"]), "memory_mb": float(taken["max_rss"])}
        found.append({"renderer": renderer} | row)
    return pd.DataFrame(found)


def of_retrieval(folders: list[Path], plot: str) -> pd.DataFrame:
    """A row a model, mask and network; empty where a run has retrieved nothing."""
    keys = ["model", "mask", "network"]
    found = []
    for folder in folders:
        paths = sorted(folder.glob(f"plots/{plot}/retrieval/accuracy_*.csv"))
        if not paths:
            return pd.DataFrame()
        table = pd.concat([tables.read(path) for path in paths])
        chosen = (table["test_set"] == "field") & (table["seed"] == "mean")
        found.append(table[chosen].set_index(keys)[["n", "r2", "rmse", "bias"]])
    both = found[0].add_suffix("_mitsuba").join(found[1].add_suffix("_less"))
    return both.reset_index()


def write(path: Path, table: pd.DataFrame, edge_m: float) -> None:
    """Rows of this edge in the place of former ones."""
    table.insert(0, "edge_m", edge_m)
    print(table.to_string(index=False))
    if path.exists():
        former = tables.read(path)
        table = pd.concat([former[former["edge_m"] != edge_m], table])
        table = table.sort_values("edge_m", kind="stable")
    tables.write(path, table)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs=2)
    parser.add_argument("--plot", default="larch")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data")
    options = parser.parse_args()
    folders = [options.results / run for run in options.runs]
    images = images_of(folders, options.plot)
    edge_m = images[0].pixel_m * images[0].values.shape[-1]
    for name, table in (
        ("renderers", of_images(images)),
        ("renderers_cost", of_cost(folders, options.plot)),
        ("renderers_retrieval", of_retrieval(folders, options.plot)),
    ):
        if not table.empty:
            write(options.output / f"{name}.csv", table, edge_m)


if __name__ == "__main__":
    main()
