"""What single assumptions of the retrieval do to chlorophyll, on plots that are there.

    python benchmarks/chlorophyll_assumptions.py FOLDER [--seeds 402]

FOLDER is that of `chlorophyll_plots.py run`. The traced light of its plots is used again with one
assumption changed: the chance that scattered light meets its own shoot (right, wrong), the leaf
model, brown pigments, and everything about leaves but chlorophyll at once. Robust networks on
collision orders of sunlit pixels are taught anew. Writes docs/data/chlorophyll_assumptions.csv.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

import chlorophyll_plots as plots

from dapple.config.chlorophyll import World
from dapple.config.settings import Settings
from dapple.formats import json, rasters
from dapple.optics.cameras import ZHAO
from dapple.retrieval import flight_light, spectra, training_entries
from training_set import images

TRUE_SHOOTS = {"larch": 0.06, "spruce": 0.23}
"""Found with rays (tests/physics/test_shoots.py)."""
LEAF = ("dry_matter_g_cm2", "brown", "water_cm", "chlorophyll_per_carotenoid")
"""Of the world: mean and standard deviation between trees."""
RANGES = (
    "n",
    "chlorophyll_ug_cm2",
    "dry_matter_g_cm2",
    "brown",
    "soil_brightness",
    "soil_moisture",
    "chlorophyll_per_carotenoid",
    "water_cm",
    "shoot_recollision",
    "aerosol_optical_depth",
)


def assumptions(species: str, world: World) -> dict[str, dict]:
    """What is changed in the settings of the retrieval, by name."""

    def shoots(chance: float) -> dict:
        return {"shoot_recollision": (chance, chance, 1)}

    true = TRUE_SHOOTS[species]
    means = {"n": world.needle_structure[0]}
    means |= {name: getattr(world, name)[0] for name in LEAF}
    leaves = {name: (mean, mean, 1) for name, mean in means.items()}
    return {
        f"shoots as they are: {true:g}": shoots(true),
        "shoots as single leaves: 0": shoots(0.0),
        "shoots as in Scots pine: 0.47": shoots(0.47),
        "the world's leaf model": {"prospect_version": "5"},
        "brown pigments up to 0.8 as published": {"brown": (0.0, 0.8, 5)},
        "the world's leaves but for chlorophyll": leaves | shoots(true) | {"prospect_version": "5"},
    }


def entries(settings: Settings, plot: Path, changed: dict) -> pd.DataFrame:
    """Sunlit entries of a plot by collision orders, with some assumptions changed."""
    retrieval = settings.chlorophyll.retrieval.model_dump() | changed
    ranges = {"ranges": {name: retrieval[name] for name in RANGES}}
    n, seed = retrieval["combinations"], settings.seed
    drawn, properties = spectra.combinations(retrieval | ranges, n, ZHAO, seed=seed)
    share = flight_light.shares(
        json.read(plot / "light/sky.json"), drawn["aerosol_optical_depth"].to_numpy()
    )
    bark = ZHAO.at_centres(settings.chlorophyll.images.bark_reflectance)
    coefficients = plot / "images/coefficients.nc"
    chunks, _ = images(coefficients, properties, "collision_orders", bark, share)
    canopy = rasters.read(plot / "retrieval/canopy.tif")
    mask = canopy.values[0] > 0
    found = training_entries.aggregate(
        chunks,
        mask,
        training_entries.cells(mask.shape, pixel_m=canopy.pixel_m, cell_m=retrieval["map_pixel_m"]),
        masks=("sunlit",),
        near_infrared=ZHAO.near_infrared,
        sunlit_nir=retrieval["sunlit_nir"],
        min_share=retrieval["min_share"],
    )["sunlit"]
    return training_entries.entries(
        *found, drawn, ZHAO.names, max_entries=retrieval["max_entries"], seed=seed
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=plots.PLOT_SEEDS)
    given = parser.parse_args()
    rows = []
    for path in sorted(given.folder.glob("new-*.yaml")):
        settings, species, results = plots.finished(path)
        if settings.seed not in given.seeds or not path.with_suffix(".csv").is_file():
            continue
        plot = results / "plots" / species
        for name, changed in assumptions(species, settings.chlorophyll.world).items():
            found = plots.taught(entries(settings, plot, changed), settings, robust=True)
            row = {"species": species, "assumption": name}
            rows.append(row | plots.field(*found, plot, "sunlit"))
            print(rows[-1], flush=True)
    means = pd.DataFrame(rows).groupby(["species", "assumption"], sort=False)
    table = means.agg(
        plots=("trees", "size"), trees=("trees", "sum"),
        rmse=("rmse", lambda x: np.sqrt((x**2).mean())), rmse_low=("rmse", "min"),
        rmse_high=("rmse", "max"), bias=("bias", "mean"),
        network_rmse_sd=("network_rmse_sd", "mean"),
    ).reset_index()  # fmt: skip
    output = plots.DATA / "chlorophyll_assumptions.csv"
    table.to_csv(output, index=False, float_format="%.5g")
    print(table.round(2).to_string(index=False))


if __name__ == "__main__":
    main()
