"""Tables of the pages from finished runs.

    python benchmarks/page_tables.py RUN [--results results]

RUN is an experiment whose results lie in RESULTS, or `verdicts` for those of all real trees, or
`scaling` and `worse-records` for what follows from docs/data/scaling.csv and
stability_records.csv; what the pages show of it is written to docs/data. `docs/data/README.md`
lists the tables.
"""

import argparse
import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import stability_tables
import yaml

DATA = Path(__file__).parents[1] / "docs" / "data"
CENTRE_M = slice(5, 10)
"""Of a stand 15 m wide, in cells of 1 m."""


def survey_small(folder: Path) -> dict[str, pd.DataFrame]:
    """Shadow of the small survey, to which a test compares its own run."""
    return {"survey_small_shadowing": pd.read_csv(folder / "survey" / "shadowing.csv")}


def survey(folder: Path) -> dict[str, pd.DataFrame]:
    """Means over the stands of a species: shadow, contact frequency, correction and planner."""
    tables = {
        name: pd.read_csv(folder / "survey" / f"{name}.csv")
        for name in ("shadowing", "regression", "correction", "plan")
    }
    keys = {
        "shadowing": ["design", "n_beams"],
        "regression": ["design", "coverage_class"],
        "correction": ["factors_from", "quantity", "design"],
        "plan": ["n_scans", "planner"],
    }
    found = {f"survey_{name}": by_species(table, keys[name]) for name, table in tables.items()}
    variants = pd.read_csv(folder / "survey" / "variants.csv")
    first = ["design", "n_beams", "stand", "variant"]
    found["survey_variants"] = variants[[*first, *variants.columns.difference(first, sort=False)]]
    estimators = pd.read_csv(folder / "survey" / "estimators.csv")
    found["survey_estimators"] = by_species(estimators, ["design", "estimator", "cells"])
    found["survey_centre"] = of_centre(folder / "survey" / "shadow_maps.npz")
    return found | of_five_scans(found["survey_shadowing"])


def single_scan(folder: Path) -> dict[str, pd.DataFrame]:
    """What one real scan reached."""
    facts = json.loads((folder / "survey" / "coverage.json").read_text())
    return {"survey_real_scan": pd.DataFrame([{"scan": folder.name, **facts}])}


def by_species(table: pd.DataFrame, keys: list[str]) -> pd.DataFrame:
    """Means over the stands of a species, with a column for each species."""
    means = table.drop(columns="seed", errors="ignore").groupby(["stand", *keys], sort=False)
    wide = means.mean(numeric_only=True).unstack("stand")
    wide.columns = ["_".join(names) for names in wide.columns]
    return wide.reset_index()


def of_centre(path: Path) -> pd.DataFrame:
    """Shadow of the 5 x 5 m in the middle, by third of the height, counted from below."""
    rows: dict[tuple[str, int], dict[str, float]] = {}
    with np.load(path) as maps:
        for key in maps.files:
            species, design, third = key.split("/")
            centre = maps[key][CENTRE_M, CENTRE_M]
            rows.setdefault((design, int(third) + 1), {})[species] = float(np.nanmean(centre))
    return pd.DataFrame(
        [{"design": name, "third": third} | shares for (name, third), shares in rows.items()]
    )


def of_five_scans(shadowing: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """How much less a diamond leaves than one scan of as many beams, and how beams tell shadow."""
    shares = shadowing.filter(regex="^(rs|unreached)_").columns
    by = shadowing.set_index(["design", "n_beams"])[shares]
    logarithm = np.log(by.loc["diamond"].index.to_numpy(float))
    r2 = {name: np.corrcoef(logarithm, by.loc["diamond", name])[0, 1] ** 2 for name in shares}
    return {
        "survey_five_scans": (by.loc["single"] - by.loc["diamond"]).reset_index(),
        "survey_log_beams": pd.DataFrame([{"design": "diamond", **r2}]),
    }


def agreement_with_truth(folder: Path) -> pd.DataFrame:
    """How light under each reconstruction compares with records, and its leaf area [m²]."""
    table = pd.read_csv(folder / "statistics" / "overall.csv")
    summaries = {
        path.parent.name: json.loads(path.read_text())
        for path in folder.glob("structure/*/summary.json")
    }
    areas = {name: found["leaf_area_m2"] for name, found in summaries.items()}
    areas["truth"] = summaries["polygons"].get("true_leaf_area_m2")
    return table.assign(leaf_area_m2=table["reconstruction"].map(areas))


def virtual_apple(folder: Path) -> dict[str, pd.DataFrame]:
    """The default run and its advice: light against the truth's, engines against each other."""
    engines = pd.read_csv(folder / "statistics" / "agreement.csv")
    found = {"default_run": agreement_with_truth(folder), "engines": engines}
    return found | (advice(folder) if (folder / "advice.yaml").is_file() else {})


def advice(folder: Path) -> dict[str, pd.DataFrame]:
    """Effects and work of every refinement, and the model that is chosen."""
    facts = yaml.safe_load((folder / "advice.yaml").read_text())
    columns = ["refinement", "level", "effect_rel", "rmse_truth_rel", "work_s", "cpu_s"]
    rows = [
        {"refinement": name, **row}
        for effects in (facts["refinements"], facts["geometry"])
        for name, rows in effects.items()
        for row in rows
    ]
    cost = facts["run_cost_s"]
    chosen = facts["chosen"] | {key: facts[key] for key in ("tolerance", "measured_rel")}
    chosen |= {
        f"share_of_{kind}": cost["chosen"][kind] / cost["finest"][kind]
        for kind in ("work_s", "cpu_s")
    }
    model = pd.DataFrame([{"model": "chosen", **chosen}])
    return {"advice": pd.DataFrame(rows)[columns], "advice_model": model}


def apple(folder: Path) -> dict[str, pd.DataFrame]:
    """The published tree: light against records that the registration has not seen."""
    return {"apple": agreement_with_truth(folder)}


def verdicts(folder: Path) -> dict[str, pd.DataFrame]:
    """What is said of the runs of real trees whose results lie beside this folder."""
    rows = []
    for run in REAL_RUNS:
        found = json.loads((folder.parent / run / "verdict.json").read_text())
        unknown = "; ".join(one["text"] for one in found["unknown"])
        for name, own in found["reconstructions"].items():
            row = {"run": run, "verdict": found["state"], "reconstruction": name}
            row |= {"own_verdict": own["state"]}
            row |= {key: own[key] for key in ("expected_loss", "alarm")}
            row |= {"why": "; ".join(reason["text"] for reason in own["reasons"][:2])}
            rows.append(row | {"unknown": unknown})
    return {"real_verdicts": pd.DataFrame(rows)}


def worse_records(folder: Path) -> dict[str, pd.DataFrame]:
    """What worse records do to r and relative RMSE: over draws, median, least and most."""
    table = pd.read_csv(DATA / "stability_records.csv")
    table["trouble"] = [
        WORSE[stressor].format(level * 100 if stressor == "sensor_position" else level)
        for stressor, level in zip(table["stressor"], table["level"], strict=True)
    ]
    table["reconstruction"] = table["reconstruction"].str.replace(".", "")
    columns = ["stressor", "trouble"]
    parts = table.groupby([*columns, "reconstruction"])[["r", "rmse_rel"]].agg(
        ["median", "min", "max"]
    )
    parts.columns = ["_".join(names) for names in parts.columns]
    wide = parts.unstack("reconstruction")
    wide.columns = ["_".join(names) for names in wide.columns]
    order = table.drop_duplicates(columns).set_index(columns).index
    return {"stability_records_summary": wide.loc[order].reset_index()}


WORSE = {
    "clock_offset": "clocks {:.0f} min off",
    "sensor_position": "sensors {:.0f} cm off",
    "few_sensors": "{:.0%} of the sensors",
    "few_records": "{:.1%} of the records",
}


def scaling(folder: Path) -> dict[str, pd.DataFrame]:
    """Triangles: processor time at the most over that at the fewest. Every axis: its largest case,
    and exponents of growth over its three largest, of time as a whole and of memory.
    """
    table = pd.read_csv(DATA / "scaling.csv")
    steps = [column for column in table if column.endswith("_cpu_s")]
    table["cpu_s"] = table[steps].sum(axis=1)
    axes = {str(name): part.sort_values("value") for name, part in table.groupby("axis")}
    own, parts = axes["triangles"], ("direct", "paths")
    ratio = [own[f"{part}_cpu_s"].iloc[-1] / own[f"{part}_cpu_s"].iloc[0] for part in parts]
    largest = pd.DataFrame(
        [
            {"axis": axis, "value": part["value"].iloc[-1], "cpu_s": part["cpu_s"].iloc[-1]}
            | {"peak_mb": (part["engine_mb"] + part["geometry_mb"]).iloc[-1]}
            | {f"{of}_exponent": exponent(part, of) for of in ("cpu_s", "engine_mb")}
            for axis, part in axes.items()
        ]
    )
    growth = pd.DataFrame({"part": list(parts), "times_as_long": ratio})
    return {"scaling_growth": growth, "scaling_exponents": largest}


def exponent(part: pd.DataFrame, of: str) -> float:
    """Slope of the logarithm against that of the size, over the three largest sizes."""
    last = np.log(part[["value", of]].iloc[-3:].to_numpy(float))
    return float(np.polyfit(last[:, 0], last[:, 1], 1)[0])


REAL_RUNS = ("apple", "leafy-tree", "single-scan", "pine-plot")
RUNS: dict[str, Callable[[Path], dict[str, pd.DataFrame]]] = {
    "survey-small": survey_small,
    "survey": survey,
    "single-scan": single_scan,
    "virtual-apple": virtual_apple,
    "apple": apple,
    "stability": stability_tables.tables,
    "verdicts": verdicts,
    "scaling": scaling,
    "worse-records": worse_records,
}


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
