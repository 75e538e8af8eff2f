"""Every classifier of leaf and wood on kinds of trees and scanners that none was taught by.

    python benchmarks/classifier.py [--trees plane beech olive pine] [--seed 1] [--docs docs]
        [--classifiers geometry "learned: shape" …]

Virtual trees are scanned, cleaned and classified, with the reflectance of their points and without.
Scores are those of all points, and of those that are leaf or of wood at least as thick as the beam
is wide there: of thinner wood every return is partly of what lies behind it
(docs/data/classifier.csv). Thinned scores are how many of the points are classified alike where
half of them, by chance, are left out. Rows of trees and classifiers that are not asked for stay.
"""

import argparse
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.insert(0, str(Path(__file__).parents[1] / "scripts"))

from dapple.cloud.classify import classify
from dapple.cloud.scores import scores
from dapple.config.settings import Settings
from dapple.errors import InputError
from dapple.formats.clouds import WOOD, Cloud
from dapple.streams import stream_seed
from dapple.virtual import labelled_scans

WAYS = {
    "reflectance: fixed threshold": ("reflectance", True),
    "reflectance: own threshold": ("mixture", True),
    "geometry": ("geometry", False),
    "learned: shape": ("learned", False),
    "learned: shape and reflectance": ("learned", True),
}
"""Method, and whether it is given reflectance."""
ORDER = [*labelled_scans.UNSEEN, *labelled_scans.OTHER_SCANNERS, *WAYS]
"""Of the rows of the table."""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--trees", nargs="+", default=list(labelled_scans.UNSEEN))
    parser.add_argument("--classifiers", nargs="+", default=list(WAYS), choices=WAYS)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--docs", type=Path, default=Path(__file__).parents[1] / "docs")
    options = parser.parse_args()
    runs = []
    for tree in options.trees:
        plant = labelled_scans.unseen(tree, options.seed)
        for scanner, settings in labelled_scans.OTHER_SCANNERS.items():
            seed = stream_seed(options.seed, tree, scanner)
            cloud = labelled_scans.scan(plant, seed=seed, **settings)
            for name in options.classifiers:
                method, bright = WAYS[name]
                row = {"tree": tree, "classifier": name, "scanner": scanner}
                runs.append(row | tried(cloud, method, bright, seed))
                print(runs[-1], flush=True)
    table, path = pd.DataFrame(runs), options.docs / "data" / "classifier.csv"
    if path.exists():
        known = pd.read_csv(path).query("tree != 'mean'")
        anew = known["tree"].isin(options.trees) & known["classifier"].isin(options.classifiers)
        table = pd.concat([known[~anew], table]).sort_values(
            ["tree", "scanner", "classifier"],
            key=lambda column: column.map({name: k for k, name in enumerate(ORDER)}),
            kind="stable",
        )
    means = table.drop(columns=["tree", "scanner"]).groupby("classifier", sort=False).mean()
    means = means.reset_index().assign(tree="mean", scanner="all")
    table = pd.concat([means, table])[table.columns]
    table.to_csv(path, index=False, float_format="%.3g")


def tried(cloud: Cloud, method: str, bright: bool, seed: int) -> dict[str, float]:
    """Scores of a classifier on a cloud, its time, and how it bears fewer points."""
    settings = Settings().classify.model_dump() | {"method": method, "seed": seed}
    names = [name for name in cloud.attributes if bright or name != "Reflectance"]
    given = Cloud(cloud.xyz_m, cloud.origin_m, {name: cloud.attributes[name] for name in names})
    begun = time.process_time()
    try:
        found = classify(given, **settings)[0].attributes["Classification"]
    except InputError as error:  # no two classes to be told apart
        print(error)
        return {"points": len(cloud)}
    seconds = time.process_time() - begun
    half = np.random.default_rng(seed).random(len(cloud)) < 0.5
    fewer = classify(given.select(half), **settings)[0].attributes["Classification"]
    truth = cloud.attributes["TrueClass"]
    visible = ~(cloud.attributes["BeamShare"] < 1)
    row: dict[str, float] = {"points": len(cloud), "wood_share": float(np.mean(truth == WOOD))}
    for kind, chosen in (("", slice(None)), ("_visible", visible)):
        scored = scores(found[chosen], truth[chosen])
        row |= {f"accuracy{kind}": scored["accuracy"], f"kappa{kind}": scored["kappa"]}
        row |= {f"wood_{one}{kind}": scored["wood"][one] for one in ("f1", "precision", "recall")}
    row["visible_wood_share"] = float(np.mean(visible[truth == WOOD]))
    row["same_with_half"] = float(np.mean(fewer == found[half]))
    return row | {"cpu_s_per_million": 1e6 * seconds / len(cloud)}


if __name__ == "__main__":
    main()
