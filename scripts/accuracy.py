"""Score one model and mask on simulated entries and on trees with known chlorophyll."""

import numpy as np
import pandas as pd

from dapple.formats import json, polygons, rasters
from dapple.formats.atomic import atomic
from dapple.retrieval import evaluation, intervals, maps, network, training
from dapple.workflow import run

N_SHOWN = 20_000


def main(snakemake):
    params, inputs = snakemake.params, snakemake.input
    interval = json.read(inputs.interval)["interval"]
    interval = intervals.Interval(
        np.array(interval["edges"]), np.array(interval["width"]),
        interval["factor"], interval["level"],
    )  # fmt: skip
    rows, shown = simulated(inputs, params, interval)
    field_rows, table = field(inputs, params)
    names = {"plot": params.plot, "model": params.model, "mask": params.mask}
    scores = pd.DataFrame([names | row for row in [*rows, *field_rows]])
    columns = [*evaluation.COLUMNS, *scores.columns.difference(evaluation.COLUMNS, sort=False)]
    write(scores[columns], snakemake.output.accuracy)
    write(table.assign(**names), snakemake.output.trees)
    with atomic(snakemake.output.tests) as partial:
        shown.assign(model=params.model, mask=params.mask).to_parquet(partial, index=False)


def simulated(inputs, params, interval):
    """Scores on both kinds of test entries, and some entries to show."""
    frame = pd.read_parquet(inputs.training)
    parts = network.split(
        frame["combination"].to_numpy(), seed=params.split_seed, **dict(params.split)
    )
    networks = [network.read(path) for path in inputs.networks]
    rows = []
    for test_set in ("entries", "combinations"):
        chosen = frame.iloc[parts[test_set]]
        truth = chosen["chlorophyll_ug_cm2"].to_numpy(float)
        each = np.array([network.predict(one, training.features(chosen)) for one in networks])
        mean, spread = each.mean(axis=0), each.std(axis=0)
        held = intervals.coverage(*intervals.bounds(interval, mean, spread), truth)
        of_seeds = evaluation.over_seeds(truth, dict(zip(params.seeds, each, strict=True)))
        of_seeds[-1]["coverage"] = held
        rows += [{"test_set": test_set} | row for row in of_seeds]
        if test_set == "entries":
            shown = pd.DataFrame({"truth_ug_cm2": truth, "predicted_ug_cm2": mean})
            shown = shown.sample(min(N_SHOWN, len(shown)), random_state=params.split_seed)
    return rows, shown


def field(inputs, params):
    """Scores on trees, and the trees."""
    found, crowns = rasters.read(inputs.map), polygons.read(inputs.crowns)
    polygons.require_crs(crowns, found.crs, inputs.crowns)
    table = evaluation.trees(
        found.values, crowns.geometries, crowns.names, crowns.lcc_ug_cm2,
        left_m=found.left_m, top_m=found.top_m, cell_m=found.pixel_m, where=inputs.crowns,
    )  # fmt: skip
    new = ["predicted_ug_cm2" if band == maps.MAP_BANDS[0] else band for band in found.bands]
    table = table.rename(columns={f"predicted_{k}": band for k, band in enumerate(new)})
    table = table.rename(columns={"outside": "outside_share"})
    missing = table["covered_share"] == 0
    print(f"{missing.sum()} of {len(table)} crowns have no pixel: {list(table['tree'][missing])}")
    truth = table["truth_ug_cm2"].to_numpy()
    each = {seed: table[f"seed_{seed}_ug_cm2"].to_numpy() for seed in params.seeds}
    rows = evaluation.over_seeds(truth, each)
    rows[-1]["coverage"] = intervals.coverage(
        table["low_ug_cm2"].to_numpy(), table["high_ug_cm2"].to_numpy(), truth
    )
    rows = [{"test_set": "field", "n_without_pixels": int(missing.sum())} | row for row in rows]
    return rows, table


def write(table, path):
    with atomic(path) as partial:
        table.to_csv(partial, index=False, float_format="%.6g")


if __name__ == "__main__":
    run(main, snakemake)
