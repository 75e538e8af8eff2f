"""Tables of the page on stability, from the results of `config/stability.yaml`.

`page_tables.py stability` writes them.
"""

from pathlib import Path

import pandas as pd

SHOWN = ("surfels", "polygons", "voxels_0.2", "voxels_1.0")
CORRECTED = {f"{name}_corrected": name for name in SHOWN if name != "surfels"}
COLUMNS = [
    "stressor", "level", "label", "harmless", "reconstruction", "seed", "r", "rmse_rel", "bias_rel",
    "mean_par_rel", "leaf_area_m2", "leaf_area_bias", "f1_leaf", "f1_wood", "flagged", "wall_s",
    "failed",
]  # fmt: skip
PLAIN = [
    ("nothing", "scan_positions", ["8"], "surfels"),
    ("two scan positions, one", "scan_positions", ["2", "1"], "voxels from two positions down"),
    ("all positions at one place", "scan_side", ["0"], "voxels, or move the scanner"),
    ("shots 0.2°, 0.5° apart (usual 0.08°)", "angular_step", ["0.2", "0.5"],
     "surfels to 0.2°, then voxels"),
    ("shots 0.02°, 0.04° apart", "angular_step", ["0.02", "0.04"],
     "surfels; a finer scan gains a little"),
    ("a tenth, a hundredth of the shots", "few_shots", ["0.1", "0.01"], "voxels"),
    ("3 in 1000 shots", "few_shots", ["0.003"], "voxels of 1 m"),
    ("scans 5 cm, 10 cm out of register", "misregistration", ["0.05", "0.1"],
     "register again, or voxels"),
    ("leaves move 5 cm, 20 cm between scans", "wind", ["0.05", "0.2"],
     "scan in still air, or voxels"),
    ("sensors 5 cm, 30 cm from where they are said to be", "sensor_position", ["0.05", "0.3"],
     "survey the sensors, or coarse voxels"),
    ("the clock 5 min, 10 min ahead", "clock_offset", ["5", "10"], "fit the clock"),
    ("voxels a quarter as large (polygons 1.25 cm, voxels 5 cm and 25 cm)",
     "voxel_to_leaf_size", ["0.25"], "surfels, whose size follows the points"),
    ("voxels four times as large (20 cm, 80 cm, 4 m)", "voxel_to_leaf_size", ["4"],
     "surfels, whose size follows the points"),
    ("needles 1 mm wide", "leaf_size", ["needles 1 mm"], "voxels or surfels"),
    ("leaves of 15 cm", "leaf_size", ["15 cm"], "surfels or polygons"),
    ("four times the leaf area", "leaf_area", ["4"], "surfels"),
    ("density cap of 0.5 m² m⁻³", "pad_cap", ["0.5"],
     "raise the cap; surfels and polygons have none"),
]  # fmt: skip
"""What goes wrong in plain words: stressor, labels of its levels, and what to use."""


def tables(folder: Path) -> dict[str, pd.DataFrame]:
    """All tables of the page, by name."""
    found = folder / "stability"
    points = pd.read_csv(found / "points.csv", dtype={"label": str})
    return {
        "stability": points[COLUMNS],
        "stability_thresholds": pd.read_csv(found / "thresholds.csv"),
        "stability_medians": medians(points),
        "stability_plain": plain(points),
        "stability_surfels_lost": surfels_lost(points),
        "corrections": corrections(points),
        "verdict": pd.read_csv(found / "verdict.csv"),
    }


def medians(points: pd.DataFrame) -> pd.DataFrame:
    """Over worlds, of every level of a stressor and reconstruction; runs that failed left out."""
    key = ["stressor", "label", "reconstruction", "level"]
    values = ["r", "rmse_rel", "mean_par_rel", "leaf_area_m2", "leaf_area_bias"]
    return points.groupby(key, sort=False)[values].median().reset_index()


def plain(points: pd.DataFrame) -> pd.DataFrame:
    """Median r of the usual reconstructions as text, that of the best in bold."""
    r = medians(points).set_index(["stressor", "label", "reconstruction"])["r"]
    rows = []
    for trouble, stressor, labels, use in PLAIN:
        cells: dict[str, list[str]] = {name: [] for name in SHOWN}
        for label in labels:
            values = {name: f"{r[stressor, label, name]:.2f}" for name in SHOWN}
            best = max(values.values())
            for name, value in values.items():
                cells[name].append(f"**{value}**" if value == best else value)
        of_method = {name.replace(".", ""): ", ".join(texts) for name, texts in cells.items()}
        rows.append({"trouble": trouble} | of_method | {"use": use})
    return pd.DataFrame(rows)


def surfels_lost(points: pd.DataFrame) -> pd.DataFrame:
    """Levels at which another reconstruction has a smaller median RMSE than surfels.

    With the share of the worlds in which the verdict, fitted without them, warns of surfels.
    """
    key = ["stressor", "label"]
    table = medians(points).set_index(["reconstruction", *key])[["r", "rmse_rel"]]
    wide = pd.concat(
        {name.replace(".", ""): table.loc[name] for name in SHOWN}, axis=1, names=["method"]
    )
    wide.columns = [f"{value}_{method}" for method, value in wide.columns]
    errors = wide[[f"rmse_rel_{name.replace('.', '')}" for name in SHOWN]]
    wide["best"] = [SHOWN[place] for place in errors.to_numpy().argmin(axis=1)]
    own = points[points["reconstruction"] == "surfels"].groupby(key)
    wide["warned"] = own["flagged"].mean()
    wide["warned_scan"] = own["flagged_scan"].mean()
    return wide[wide["best"] != "surfels"].reset_index()


def corrections(points: pd.DataFrame) -> pd.DataFrame:
    """Means over disturbed runs without and with corrections, and how many runs changed."""
    disturbed = points[~points["harmless"].astype(bool) & points["failed"].isna()]
    key = ["stressor", "label", "seed"]
    rows = []
    for corrected, name in CORRECTED.items():
        with_, without = (
            disturbed[disturbed["reconstruction"] == one].set_index(key)[["r", "rmse_rel"]]
            for one in (corrected, name)
        )
        both = without.join(with_, rsuffix="_corrected", how="inner").dropna()
        gain = both["r_corrected"] - both["r"]
        changed = {"better": int((gain > 0.005).sum()), "worse": int((gain < -0.005).sum())}
        rows.append({"reconstruction": name, "runs": len(both)} | both.mean().to_dict() | changed)
    return pd.DataFrame(rows)
