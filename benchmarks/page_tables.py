"""Tables of the pages from finished runs.

    python benchmarks/page_tables.py RUN [--results results]

RUN is an experiment whose results lie in RESULTS; what the pages show of it is written to
docs/data. `docs/data/README.md` lists the tables.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import pandas as pd

DATA = Path(__file__).parents[1] / "docs" / "data"


def survey_small(folder: Path) -> dict[str, pd.DataFrame]:
    """Shadow of the small survey, to which a test compares its own run."""
    return {"survey_small_shadowing": pd.read_csv(folder / "survey" / "shadowing.csv")}


RUNS: dict[str, Callable[[Path], dict[str, pd.DataFrame]]] = {"survey-small": survey_small}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("run", choices=RUNS)
    parser.add_argument("--results", type=Path, default=DATA.parents[1] / "results")
    options = parser.parse_args()
    for name, table in RUNS[options.run](options.results / options.run).items():
        table.to_csv(DATA / f"{name}.csv", index=False, float_format="%.6g")
        print(f"docs/data/{name}.csv: {len(table)} rows")


if __name__ == "__main__":
    main()
