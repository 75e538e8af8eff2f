"""Images of one virtual plot by Mitsuba and by LESS 3, and what is retrieved from each.

    python benchmarks/renderers.py MITSUBA_RUN LESS_RUN [--plot larch] [--results results]

The runs differ in `chlorophyll.world.renderer` alone. Writes `renderers.csv`: mean reflectance of
the plot by band, and root mean square difference and correlation of cells of 3 m, and, where both
runs have retrieved chlorophyll, `renderers_retrieval.csv`: its errors on the field trees.
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


def of_images(folders: list[Path], plot: str) -> pd.DataFrame:
    """A row a band."""
    images = [rasters.read(folder / f"plots/{plot}/world/images.tif") for folder in folders]
    mitsuba, less = (cells(image) for image in images)
    return pd.DataFrame(
        {
            "plot": plot,
            "band": images[0].bands,
            "mitsuba": mitsuba.mean(axis=1),
            "less": less.mean(axis=1),
            "difference_rel": less.mean(axis=1) / mitsuba.mean(axis=1) - 1.0,
            "cell_rmse_rel": np.sqrt(((less - mitsuba) ** 2).mean(axis=1)) / mitsuba.mean(axis=1),
            "cell_r": [np.corrcoef(*both)[0, 1] for both in zip(mitsuba, less, strict=True)],
        }
    )


def of_retrieval(folders: list[Path], plot: str) -> pd.DataFrame:
    """A row a model, mask and network; empty where a run has retrieved nothing."""
    keys = ["plot", "model", "mask", "network"]
    found = []
    for folder in folders:
        paths = sorted(folder.glob(f"plots/{plot}/retrieval/accuracy_*.csv"))
        if not paths:
            return pd.DataFrame()
        table = pd.concat([tables.read(path) for path in paths])
        chosen = (table["test_set"] == "field") & (table["seed"] == "mean")
        found.append(table[chosen].set_index(keys)[["n", "r2", "rmse", "bias"]])
    return found[0].join(found[1], lsuffix="_mitsuba", rsuffix="_less").reset_index()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("runs", nargs=2)
    parser.add_argument("--plot", default="larch")
    parser.add_argument("--results", type=Path, default=ROOT / "results")
    parser.add_argument("--output", type=Path, default=ROOT / "docs/data")
    options = parser.parse_args()
    folders = [options.results / run for run in options.runs]
    for name, table in (
        ("renderers", of_images(folders, options.plot)),
        ("renderers_retrieval", of_retrieval(folders, options.plot)),
    ):
        if not table.empty:
            print(table.to_string(index=False))
            tables.write(options.output / f"{name}.csv", table)


if __name__ == "__main__":
    main()
