"""Chlorophyll of new virtual plots, plot by plot: every image model, mask and kind of network.

    python benchmarks/chlorophyll_plots.py run FOLDER --seeds 402 403 404 405
    python benchmarks/chlorophyll_plots.py table FOLDER

`run` draws a world for every seed and species (its light, leaves, soils and chlorophyll), writes
its configuration to FOLDER and runs the workflow up to the training sets; results go to
`results/new-SPECIES-SEED`. Then it teaches ten networks of every kind on them and compares what
they retrieve with the trees, into a table in FOLDER. A plot whose table is there is left out.
`table` puts the tables together: docs/data/chlorophyll_plots.csv, a row for each plot, model, mask
and kind of network; chlorophyll_by_plot.csv, the same with models and networks side by side;
chlorophyll_models.csv, over the plots of a species; and chlorophyll_costs.csv, what the steps of a
plot cost.

Plots are smaller than those of Zhao et al. (2025), with coarser images, fewer combinations and
narrower networks, so that many plots and ten networks each can be run on two cores.
"""

import argparse
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import yaml

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.config.settings import Settings, validate
from dapple.formats import rasters, tables, vectors
from dapple.optics.cameras import ZHAO
from dapple.retrieval import evaluation, intervals, maps, network, training_entries
from dapple.retrieval.noise import Noise
from dapple.streams import stream_seed

ROOT = Path(__file__).parents[1]
DATA = ROOT / "docs" / "data"
SPECIES = ("larch", "spruce")
PLOT_SEEDS = (402, 403, 404, 405)
"""501 and 502 served to choose priors and are scored nowhere."""
MODELS = ("collision_orders", "semi_less", "prosail")
TAUGHT = tuple(product(training_entries.MASKS, ("published", "robust")))
"""Pixels and kind of network."""
SEEDS = range(1, 11)
"""Of the networks."""
PLOT = {"size_m": [15.0, 15.0], "pixel_m": 0.15, "field_trees": 8}
RETRIEVAL = {
    "combinations": 400,
    "max_entries": 10_000,
    "hidden": [256, 128, 64],
    "batch": 128,
    "max_epochs": 10,
}


def configuration(species: str, seed: int) -> dict:
    """A plot whose world nobody told the retrieval: drawn from ranges, not the defaults."""
    rng = np.random.default_rng((seed, SPECIES.index(species)))

    def between(low: float, high: float) -> float:
        return round(float(rng.uniform(low, high)), 3)

    plot = PLOT | {
        "sun_zenith_deg": between(30.0, 58.0),
        "sun_azimuth_deg": between(120.0, 270.0),
        "cover": between(0.4, 0.6),
        "crown_leaf_area_index": between(2.5, 5.0),
    }
    world = {
        "lcc_mean_ug_cm2": between(30.0, 50.0),
        "lcc_sd_ug_cm2": between(8.0, 13.0),
        "lowest_to_highest_lcc": between(0.7, 1.1),
        "needle_structure": [between(1.3, 2.0), 0.1],
        "dry_matter_g_cm2": [between(0.008, 0.016), 0.002],
        "chlorophyll_per_carotenoid": [between(3.5, 6.0), 0.5],
        "water_cm": [between(0.01, 0.025), 0.003],
        "soil_brightness": between(0.7, 1.3),
        "soil_moisture": between(0.2, 0.7),
        "litter_share": between(0.2, 0.7),
        "aerosol_optical_depth": between(0.05, 0.35),
    }
    return {
        "experiment": f"new-{species}-{seed}",
        "study": "chlorophyll",
        "seed": seed,
        "chlorophyll": {
            "plots": [species],
            "margin_m": 4.0,
            species: plot,
            "world": world,
            "images": {"least_paths": 400_000},
            "retrieval": RETRIEVAL,
        },
    }


def make(folder: Path, seeds: list[int], cores: int) -> None:
    """Run the workflow on every plot, up to its training sets, and score what they teach."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        for species in SPECIES:
            config = configuration(species, seed)
            path = folder / f"{config['experiment']}.yaml"
            if path.with_suffix(".csv").is_file():
                continue
            path.write_text(yaml.safe_dump(config))
            retrieval = f"results/{config['experiment']}/plots/{species}/retrieval"
            targets = [f"{retrieval}/training_{model}_sunlit.parquet" for model in MODELS]
            command = [sys.executable, "-m", "snakemake", "--cores", str(cores), "--quiet", "all"]
            command += ["--configfile", str(path), "--", *targets]
            subprocess.run(command, cwd=ROOT, check=True)
            scores = pd.DataFrame(score(*finished(path)))
            scores.to_csv(path.with_suffix(".csv"), index=False, float_format="%.5g")


def finished(path: Path) -> tuple[Settings, str, Path]:
    """Settings, species and results of a plot by its configuration."""
    settings = validate(yaml.safe_load(path.read_text()))
    (species,) = settings.chlorophyll.plots
    return settings, species, ROOT / "results" / settings.experiment


def score(settings: Settings, species: str, results: Path) -> list[dict]:
    """A row for each model, mask and kind of network of a plot."""
    retrieval, rows = results / "plots" / species / "retrieval", []
    for model in MODELS:
        for mask, kind in TAUGHT:
            frame = tables.read(retrieval / f"training_{model}_{mask}.parquet")
            row = {"species": species, "plot_seed": settings.seed, "model": model}
            row |= {"mask": mask, "network": kind}
            found = taught(frame, settings, robust=kind == "robust")
            rows.append(row | field(*found, results / "plots" / species, mask))
            print(rows[-1], flush=True)
    return rows


def taught(
    frame: pd.DataFrame, settings: Settings, *, robust: bool
) -> tuple[list[network.Network], intervals.Interval, float]:
    """Ten networks, their interval, and their RMSE on leaves and soils that taught none."""
    retrieval = settings.chlorophyll.retrieval
    split = stream_seed(settings.seed, "split")
    parts = network.split(frame["combination"].to_numpy(), seed=split)
    bands = training_entries.features(frame, ZHAO.names)
    target = training_entries.chlorophyll(frame)
    absolute = retrieval.absolute_noise
    errors = Noise(retrieval.relative_noise, retrieval.common_noise, absolute, absolute)
    noise = errors if robust else None
    low, high = retrieval.chlorophyll_ug_cm2[:2]
    margin = 0.1 * (high - low)
    names = ("hidden", "batch", "max_epochs", "patience")
    networks = [
        network.train(
            *(x[parts[part]] for part in ("train", "validation") for x in (bands, target)),
            seed=seed, low=low - margin, high=high + margin, noise=noise,
            **{name: getattr(retrieval, name) for name in names},
        )[0]
        for seed in SEEDS
    ]  # fmt: skip
    seen = noise.add(bands, np.random.default_rng(split)) if noise else bands
    held, unseen = parts["validation"], parts["combinations"]
    interval = intervals.fit(
        *maps.ensemble(networks, seen[held]), target[held], level=retrieval.interval_level
    )
    predicted = maps.ensemble(networks, bands[unseen])[0]
    return networks, interval, evaluation.scores(target[unseen], predicted)["rmse"]


def field(
    networks: list[network.Network],
    interval: intervals.Interval,
    simulated_rmse: float,
    plot: Path,
    mask: str,
) -> dict[str, float]:
    """Scores on the trees of the observed images: of the networks' mean, and of single networks."""
    observed = rasters.read(plot / f"retrieval/observed_{mask}.tif")
    crowns = vectors.read(plot / "world/crowns.geojson")
    bands = rasters.select(observed, ZHAO.names, plot).values
    flat = bands.reshape(len(bands), -1).T
    known = np.isfinite(flat).all(axis=1)
    each = [np.where(known, network.predict(one, flat), np.nan) for one in networks]
    ends = intervals.bounds(interval, np.mean(each, axis=0), np.std(each, axis=0))
    table = evaluation.trees(
        np.array([*each, *ends]).reshape(-1, *bands.shape[1:]), crowns.geometries, crowns.names,
        crowns.lcc_ug_cm2, left_m=observed.left_m, top_m=observed.top_m, cell_m=observed.pixel_m,
    ).dropna()  # fmt: skip
    truth, n = table["truth_ug_cm2"].to_numpy(), len(networks)
    rows = evaluation.over_seeds(truth, {k: table[f"predicted_{k}"].to_numpy() for k in range(n)})
    single = pd.DataFrame(rows[:-2])["rmse"]
    low, high = (table[f"predicted_{k}"].to_numpy() for k in (n, n + 1))
    return {
        "trees": len(table),
        "truth_mean": truth.mean(),
        "truth_sd": truth.std(),
        **{key: rows[-1][key] for key in ("rmse", "bias", "r2")},
        "networks": n,
        "network_rmse_mean": single.mean(),
        "network_rmse_sd": single.std(),
        "network_rmse_low": single.min(),
        "network_rmse_high": single.max(),
        "coverage": intervals.coverage(low, high, truth),
        "simulated_rmse": simulated_rmse,
    }


def by_plot(table: pd.DataFrame) -> pd.DataFrame:
    """RMSE and bias of every model and kind of network, in a row for each plot and mask."""
    of_plot = ["species", "plot_seed", "mask"]
    wide = table.pivot(index=of_plot, columns=["model", "network"], values=["rmse", "bias"])
    wide.columns = [f"{model}_{network}_{value}" for value, model, network in wide.columns]
    trees = table.groupby(of_plot)[["trees", "truth_mean", "truth_sd"]].first()
    return trees.join(wide).reset_index()


def over_plots(table: pd.DataFrame) -> pd.DataFrame:
    """What a model, mask and kind of network does on all plots of a species.

    RMSE, bias, R² and coverage are those of all trees, R² against the mean of each plot's own.
    """
    table = table.assign(
        squares=table.trees * table.rmse**2,
        spread=table.trees * table.truth_sd**2,
        deviations=table.trees * table.bias,
        held=table.trees * table.coverage,
    )
    groups = table.groupby(["species", "mask", "model", "network"], sort=False)
    sums = groups[["trees", "squares", "spread", "deviations", "held"]].sum()
    found = pd.DataFrame(
        {
            "plots": groups.size(),
            "trees": sums.trees,
            "truth_sd": np.sqrt(sums.spread / sums.trees),
            "rmse": np.sqrt(sums.squares / sums.trees),
            "rmse_low": groups.rmse.min(),
            "rmse_high": groups.rmse.max(),
            "bias": sums.deviations / sums.trees,
            "r2": 1 - sums.squares / sums.spread,
            "coverage": sums.held / sums.trees,
            "network_rmse_sd": groups.network_rmse_sd.mean(),
            "simulated_rmse": groups.simulated_rmse.mean(),
        }
    )
    return found.reset_index()


def costs(paths: list[Path]) -> pd.DataFrame:
    """Processor seconds and peak memory of every step, means over the plots of a species."""
    rows = []
    for settings, species, results in map(finished, paths):
        for file in sorted((results / "benchmarks").glob("*.tsv")):
            took = pd.read_csv(file, sep="\t").iloc[-1]
            row = {"species": species, "plot_seed": settings.seed}
            row |= {"step": file.stem.replace(f"_{species}", "")}
            rows.append(row | {"cpu_s": took["cpu_time"], "peak_mb": took["max_rss"]})
    means = pd.DataFrame(rows).groupby(["species", "step"], as_index=False)
    return means[["cpu_s", "peak_mb"]].mean()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("action", choices=["run", "table"])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seeds", type=int, nargs="+", default=PLOT_SEEDS)
    parser.add_argument("--cores", type=int, default=2)
    given = parser.parse_args()
    if given.action == "run":
        make(given.folder.resolve(), given.seeds, given.cores)
        return
    scored = sorted(given.folder.glob("new-*.csv"))
    table = pd.concat([pd.read_csv(path) for path in scored])
    plots = [path.with_suffix(".yaml") for path in scored]
    made = {
        "plots": table,
        "by_plot": by_plot(table),
        "models": over_plots(table),
        "costs": costs(plots),
    }
    for name, one in made.items():
        one.to_csv(DATA / f"chlorophyll_{name}.csv", index=False, float_format="%.5g")
    print(table.round(2).to_string(index=False))


if __name__ == "__main__":
    main()
