"""Score the networks of one model on simulated entries and on trees with known chlorophyll."""

import numpy as np
import pandas as pd

from dapple.formats import json, rasters, tables, vectors
from dapple.retrieval import evaluation, intervals, maps, network, training_entries
from dapple.retrieval.noise import Noise
from dapple.workflow import run

N_SHOWN = 20_000


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    scores, trees, shown = [], [], []
    files = zip(
        params.taught, inputs.training, np.reshape(inputs.networks, (-1, len(params.seeds))),
        inputs.maps, inputs.intervals, strict=True,
    )  # fmt: skip
    for taught, table_path, network_paths, map_path, interval_path in files:
        saved = json.read(interval_path)["interval"]
        bins = {name: np.array(saved[name]) for name in ("edges", "width")}
        interval = intervals.Interval(**saved | bins)
        networks = [network.read(path) for path in network_paths]
        rows, some = simulated(tables.read(table_path), networks, interval, params)
        field_rows, table = [], evaluation.no_trees()
        if inputs.crowns:
            field_rows, table = field(map_path, inputs.crowns, params.seeds)
        scores += [{"plot": params.plot} | taught | row for row in [*rows, *field_rows]]
        trees.append(table.assign(plot=params.plot, **taught))
        shown.append(some.assign(**taught))
    scores = pd.DataFrame(scores)
    extra = scores.columns.difference(evaluation.COLUMNS, sort=False)
    tables.write(snakemake.output.accuracy, scores[[*evaluation.COLUMNS, *extra]])
    tables.write(snakemake.output.trees, pd.concat(trees))
    tables.write(snakemake.output.tests, pd.concat(shown))


def simulated(frame, networks, interval, params):
    """Scores on the kinds of test entries, and some entries to show.

    Test sets: `entries`, cells of combinations that also taught; `combinations`, leaves and soils
    never seen; `noisy`, these with errors in their bands.
    """
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    features = training_entries.features(frame, params.bands)
    target = training_entries.chlorophyll(frame)
    noisy = Noise(**params.errors).add(features, np.random.default_rng(params.split_seed))
    rows = []
    for test_set, part, bands in (
        ("entries", "entries", features),
        ("combinations", "combinations", features),
        ("noisy", "combinations", noisy),
    ):
        truth = target[parts[part]]
        each = np.array([network.predict(one, bands[parts[part]]) for one in networks])
        mean = each.mean(axis=0)
        ends = intervals.bounds(interval, mean, each.std(axis=0))
        of_seeds = evaluation.over_seeds(truth, dict(zip(params.seeds, each, strict=True)))
        of_seeds[-1]["coverage"] = intervals.coverage(*ends, truth)
        rows += [{"test_set": test_set} | row for row in of_seeds]
        if test_set == "entries":
            shown = pd.DataFrame({"truth_ug_cm2": truth, "predicted_ug_cm2": mean})
            shown = shown.sample(min(N_SHOWN, len(shown)), random_state=params.split_seed)
    return rows, shown


def field(map_path, crowns_path, seeds):
    """Scores on trees, where any has known chlorophyll, and all trees."""
    found, crowns = rasters.read(map_path), vectors.read(crowns_path)
    vectors.require_crs(crowns, found.crs, crowns_path)
    table = evaluation.trees(
        found.values, crowns.geometries, crowns.names, crowns.lcc_ug_cm2,
        left_m=found.left_m, top_m=found.top_m, cell_m=found.pixel_m, where=crowns_path,
    )  # fmt: skip
    new = {maps.MAP_BANDS[0]: "predicted_ug_cm2", "outside": "outside_share"}
    names = {f"predicted_{k}": new.get(band, band) for k, band in enumerate(found.bands)}
    table = table.rename(columns=names)
    missing = table["covered_share"] == 0
    print(f"{missing.sum()} of {len(table)} crowns have no pixel: {list(table['tree'][missing])}")
    if not np.isfinite(truth := table["truth_ug_cm2"].to_numpy()).any():
        return [], table
    each = {seed: table[f"seed_{seed}_ug_cm2"].to_numpy() for seed in seeds}
    rows = evaluation.over_seeds(truth, each)
    rows[-1] |= {
        "coverage": intervals.coverage(
            table["low_ug_cm2"].to_numpy(), table["high_ug_cm2"].to_numpy(), truth
        ),
        "outside_share": float(table["outside_share"].mean()),
    }
    of_field = {"test_set": "field", "n_without_pixels": int(missing.sum())}
    return [of_field | row for row in rows], table


if __name__ == "__main__":
    run(main, snakemake)
