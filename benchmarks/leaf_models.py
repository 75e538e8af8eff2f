"""What models of leaf and soil do to retrieved chlorophyll, scored on field trees.

`python benchmarks/leaf_models.py results/chlorophyll larch` takes the traced light of a finished
run, simulates images with leaves of PROSPECT-D with and without anthocyanin and of PROSPECT-5,
trains a network on each and compares what it retrieves from the observed images with the truth.
A fourth set has the soils of GSV, where their vectors are in the run's `data_dir`.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.config.settings import Settings
from dapple.formats import json, rasters, vectors
from dapple.optics.cameras import ZHAO
from dapple.retrieval import evaluation, network, spectra, training_entries
from dapple.retrieval.noise import Noise
from training_set import images, level_canopies

COMBINATIONS, ENTRIES, SEED = 900, 80_000, 1
# PROSPECT's version, anthocyanin per chlorophyll, folder of the soil vectors.
SURFACES = {
    "PROSPECT-D": ("D", 0.0, ""),
    "PROSPECT-D, anthocyanin": ("D", 0.043, ""),
    "PROSPECT-5": ("5", 0.0, ""),
    "PROSPECT-D, anthocyanin, GSV": ("D", 0.043, "spectra/gsv"),
}
MODELS = {"collision_orders": ("images/coefficients.nc",),
          "prosail": ("scene/leaves.ply", "scene/wood.ply")}  # fmt: skip


def scores(folder: Path, name: str) -> pd.DataFrame:
    """Errors of simulated entries and field trees by leaves and soils, image model and network."""
    settings = Settings(**yaml.safe_load((folder / "config.yaml").read_text()))
    retrieval = settings.chlorophyll.retrieval
    path = folder / "plots" / name
    rows = []
    for surfaces, (version, anthocyanin, soils) in SURFACES.items():
        soils = soils and Path(settings.data_dir) / soils
        if soils and not soils.is_dir():
            print(f"no {soils}: without GSV")
            continue
        changed = {
            "prospect_version": version,
            "anthocyanin_per_chlorophyll": anthocyanin,
            "soil_vectors": str(soils),
        }
        for model in MODELS:
            frame = entries(settings.chlorophyll, path, name, changed, model)
            parts = network.split(
                frame["combination"].to_numpy(), seed=SEED, test_share=0.2, held_share=0.1
            )
            for kind in retrieval.networks:
                net = learn(frame, parts, retrieval, robust=kind == "robust")
                rows.append(
                    {"surfaces": surfaces, "model": model, "network": kind}
                    | test(net, frame.iloc[parts["entries"]])
                    | field(net, path, retrieval.map_pixel_m)
                )
                print(rows[-1], flush=True)
    return pd.DataFrame(rows)


def entries(settings, path: Path, name: str, changed: dict, model: str) -> pd.DataFrame:
    """Sunlit entries of a plot by one set of leaves and soils and one image model."""
    retrieval, plot = settings.retrieval, getattr(settings, name)
    ranges = ("n", "chlorophyll_ug_cm2", "dry_matter_g_cm2", "brown", "soil_brightness",
              "soil_moisture")  # fmt: skip
    drawn, properties = spectra.combinations(
        retrieval.model_dump()
        | {"ranges": {key: getattr(retrieval, key) for key in ranges}}
        | {"shoot_recollision": plot.shoot_recollision}
        | changed,
        COMBINATIONS,
        ZHAO,
        seed=SEED,
    )
    params = {
        "model": model,
        "selection": {"cell_m": retrieval.map_pixel_m, "min_share": retrieval.min_share},
        "sail": {"leaf_angle_deg": retrieval.leaf_angle_deg, "hot_spot": retrieval.hot_spot},
    }
    canopy = rasters.read(path / "retrieval/canopy.tif")
    inputs = SimpleNamespace(
        simulation=[path / file for file in MODELS[model]],
        sun=path / "light/sun.json",
        sky=path / "light/sky.json",
    )
    if model == "prosail":
        origin_m = json.read(path / "scene/summary.json")["world_origin_m"]
        chunks, mask, pixel_m = level_canopies(inputs, canopy, properties, origin_m, params)
    else:
        share = np.asarray(json.read(inputs.sky)["diffuse_share"])
        bark = ZHAO.at_centres(settings.images.bark_reflectance)
        chunks, _ = images(inputs.simulation[0], properties, model, bark, share)
        mask, pixel_m = canopy.values[0] > 0, canopy.pixel_m
    over = training_entries.cells(mask.shape, pixel_m=pixel_m, cell_m=retrieval.map_pixel_m)
    found = training_entries.aggregate(
        chunks,
        mask,
        over,
        masks=("sunlit",),
        near_infrared=ZHAO.near_infrared,
        sunlit_nir=retrieval.sunlit_nir,
        min_share=retrieval.min_share,
    )["sunlit"]
    return training_entries.entries(*found, drawn, ZHAO.names, max_entries=ENTRIES, seed=SEED)


def learn(frame: pd.DataFrame, parts: dict, retrieval, *, robust: bool) -> network.Network:
    """A network, taught with or without errors in the bands."""
    bands, target = (
        training_entries.features(frame, ZHAO.names),
        frame["chlorophyll_ug_cm2"].to_numpy(),
    )
    relative, absolute = retrieval.relative_noise, retrieval.absolute_noise
    net, _ = network.train(
        *(x[parts[part]] for part in ("train", "validation") for x in (bands, target)),
        seed=SEED, low=4.0, high=76.0, max_epochs=12,
        noise=Noise(relative, relative, absolute, absolute) if robust else None,
    )  # fmt: skip
    return net


def test(net: network.Network, frame: pd.DataFrame) -> dict[str, float]:
    """Score on simulated entries."""
    predicted = network.predict(net, training_entries.features(frame, ZHAO.names))
    found = evaluation.scores(frame["chlorophyll_ug_cm2"].to_numpy(), predicted)
    return {"simulated_rmse": found["rmse"]}


def field(net: network.Network, path: Path, cell_m: float) -> dict[str, float]:
    """Score on the trees of the observed images."""
    observed = rasters.read(path / "retrieval/observed_sunlit.tif")
    crowns = vectors.read(path / "world/crowns.geojson")
    bands = rasters.select(observed, ZHAO.names, path).values
    flat = bands.reshape(len(bands), -1).T
    lcc = np.where(np.isfinite(flat).all(axis=1), network.predict(net, flat), np.nan)
    table = evaluation.trees(
        lcc.reshape(1, *bands.shape[1:]), crowns.geometries, crowns.names, crowns.lcc_ug_cm2,
        left_m=observed.left_m, top_m=observed.top_m, cell_m=cell_m,
    ).dropna()  # fmt: skip
    found = evaluation.scores(table["truth_ug_cm2"].to_numpy(), table["predicted_0"].to_numpy())
    return {key: found[key] for key in ("n", "r2", "rmse", "bias")}


if __name__ == "__main__":
    print(scores(Path(sys.argv[1]), sys.argv[2]).round(2).to_string(index=False))
