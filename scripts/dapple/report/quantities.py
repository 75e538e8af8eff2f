"""What the columns of tables mean: a name to read, a unit, and a definition for those who hover."""

from dataclasses import dataclass

PAR_UNIT = "µmol m⁻² s⁻¹"


@dataclass(frozen=True)
class Quantity:
    """How a column is shown.

    Attributes
    ----------
    label, unit, meaning : str
    digits : int
        Significant digits of its numbers.
    """

    label: str
    unit: str = ""
    meaning: str = ""
    digits: int = 3


QUANTITIES = {
    "reconstruction": Quantity(
        "reconstruction",
        meaning="What the scan was rebuilt as. Truth: the plant that a virtual scan was made of.",
    ),
    "sensor": Quantity("sensor", meaning="Label of the sensor: logger and channel."),
    "n": Quantity("n", meaning="Number of records that were compared."),
    "n_sensors": Quantity("sensors", meaning="Number of sensors."),
    "r": Quantity("r", meaning="Pearson's correlation of simulated with measured PAR; 1 is best."),
    "r_low": Quantity("r, lower", meaning="Lower end of the confidence interval of r."),
    "r_high": Quantity("r, upper", meaning="Upper end of the confidence interval of r."),
    "rmse": Quantity(
        "RMSE", PAR_UNIT, "Root of the mean squared difference between simulated and measured."
    ),
    "bias": Quantity("bias", PAR_UNIT, "Mean of simulated minus measured."),
    "mae": Quantity("MAE", PAR_UNIT, "Mean absolute difference between simulated and measured."),
    "baseline_r": Quantity(
        "r without a tree",
        meaning="Correlation that the same sky reaches where no tree stands: what the hour alone "
        "explains.",
    ),
    "intercept": Quantity("intercept", PAR_UNIT, "Of measured on simulated PAR."),
    "intercept_se": Quantity("± intercept", PAR_UNIT, "Standard error of the intercept."),
    "slope": Quantity("slope", meaning="Of measured on simulated PAR; 1 where scales agree."),
    "slope_se": Quantity("± slope", meaning="Standard error of the slope."),
    "sensor_sd": Quantity(
        "between sensors",
        PAR_UNIT,
        "Standard deviation of the sensors' own offsets (random intercepts).",
    ),
    "residual_sd": Quantity("residual", PAR_UNIT, "Standard deviation within a sensor's series."),
    "r2_marginal": Quantity("R² marginal", meaning="Share of variance that the light explains."),
    "r2_conditional": Quantity(
        "R² conditional", meaning="Share of variance that light and sensor explain together."
    ),
    "residual_autocorrelation": Quantity(
        "lag-1 correlation", meaning="Of residuals that follow each other."
    ),
    "singular": Quantity("singular", meaning="Whether sensors showed no offsets of their own."),
    "note": Quantity("note"),
    "rmse_rel": Quantity("RMSE", "of open sky", "Root mean square over the PAR of an open sky."),
    "bias_rel": Quantity("bias", "of open sky", "Mean difference over the PAR of an open sky."),
    "max_abs_z": Quantity(
        "largest |z|",
        meaning="Largest difference over its standard error: of thousands of values, 4 is chance.",
    ),
    "engine": Quantity("engine"),
    "reference": Quantity("reference"),
    "shared": Quantity(
        "shared", meaning="What both engines have in common, whose faults agreement cannot show."
    ),
    "leaf_area_m2": Quantity("leaf area", "m²", "One-sided area of all leaves."),
    "true_leaf_area_m2": Quantity("true leaf area", "m²", "Of the virtual plant."),
    "wood_area_m2": Quantity("wood area", "m²", "Surface of stem and branches."),
    "n_elements": Quantity("elements", meaning="Polygons, discs, leaves, or voxels with leaves."),
    "n_added": Quantity("elements added", meaning="Polygons that fill what was occluded."),
    "n_wood_elements": Quantity("wood elements", meaning="Polygons of stem and branches."),
    "volume_m3": Quantity("volume", "m³", "Of the cells in which something stands."),
    "n_unknown": Quantity("unknown voxels", meaning="Voxels which too few shots entered."),
    "n_not_reached": Quantity("hidden voxels", meaning="Voxels which no shot reached."),
    "n_capped": Quantity("capped voxels", meaning="Voxels at the largest density that is allowed."),
    "mean_pad_m2_m3": Quantity("mean density", "m² m⁻³", "Plant area per volume of filled voxels."),
    "step": Quantity("step"),
    "wall_s": Quantity("time", "s", "From start to end."),
    "cpu_s": Quantity("processor time", "s", "Of all cores together."),
    "peak_rss_mb": Quantity("memory", "MB", "Largest resident memory."),
    "integral_mol_m2": Quantity(
        "light integral", "mol m⁻² d⁻¹", "PAR summed over the simulated hours of a day."
    ),
    "measured_integral_mol_m2": Quantity(
        "measured integral", "mol m⁻² d⁻¹", "Recorded PAR summed over the same hours."
    ),
    "open_share": Quantity("of open sky", "%", "Light integral over that of an open sky."),
    "sunfleck_share": Quantity(
        "time in sunflecks",
        "%",
        "Share of the time in which more than half of the sun's disc is seen.",
    ),
    "n_sunflecks": Quantity("sunflecks", "d⁻¹", "How often the sun comes out, a day."),
    "sunfleck_min": Quantity("median fleck", "min", "Median duration of a sunfleck."),
    "sunfleck_light_share": Quantity(
        "light in sunflecks", "%", "Share of the light integral that arrives during sunflecks."
    ),
    "stand": Quantity("stand", meaning="Species and replicate of the virtual stand."),
    "design": Quantity("design", meaning="How the scan positions are laid out."),
    "seed": Quantity("seed", meaning="Number that draws the virtual world."),
    "n_beams": Quantity("beams", meaning="Laser shots of one scan."),
    "rs": Quantity(
        "relative shadow",
        meaning="Share of the filled voxels that the scans do not see (Van der Zande et al. 2008).",
    ),
    "expected_rs": Quantity("expected", meaning="Relative shadow as the planner foresaw it."),
    "not_hit": Quantity("not hit", meaning="Share of filled voxels without a return."),
    "false_hits": Quantity("false hits", meaning="Share of returns in voxels that are empty."),
    "coverage_class": Quantity(
        "laser coverage", "%", "Share of a voxel's beams that reached it."
    ),
    "r2": Quantity("R²", meaning="Coefficient of determination."),
    "n_scans": Quantity("scans"),
    "planner": Quantity("planner"),
    "stressor": Quantity("trouble", meaning="What was made worse, one thing at a time."),
    "level": Quantity("level", meaning="How bad it was made."),
    "label": Quantity("level"),
    "r_harmless": Quantity("r undisturbed"),
    "r_worst": Quantity("r at worst"),
    "reason": Quantity("limit", meaning="What broke first: r below 0.8 of it, or RMSE doubled."),
    "detection": Quantity("failures found", meaning="Share of failed runs that were flagged."),
    "false_alarms": Quantity("false alarms", meaning="Share of sound runs that were flagged."),
    "failures": Quantity("failures", meaning="Runs with r below 0.8 of it, or RMSE doubled."),
    "runs": Quantity("runs"),
    "plot": Quantity("plot"),
    "model": Quantity("model", meaning="Which simulation taught the network."),
    "mask": Quantity("pixels", meaning="All canopy pixels of a cell, or the sunlit ones."),
    "network": Quantity("network", meaning="As published, or the ensemble with robust losses."),
    "test_set": Quantity("tested on", meaning="Simulated entries left out, or measured trees."),
    "rrmse": Quantity("relative RMSE", meaning="RMSE over the mean of what was measured."),
    "coverage": Quantity("in interval", meaning="Share of true values within their intervals."),
    "outside_share": Quantity(
        "unlike training", meaning="Share of cells that look unlike all that was simulated."
    ),
    "cells": Quantity("cells", meaning="Cells of the map that have data."),
    "median_ug_cm2": Quantity("median chlorophyll", "µg cm⁻²", "Of all cells."),
    "interval_width_ug_cm2": Quantity("interval", "µg cm⁻²", "Median width of the intervals."),
    "truth_ug_cm2": Quantity("reference", "µg cm⁻²", "Chlorophyll of the leaves, as measured or "
                             "as given to a virtual tree."),
    "predicted_ug_cm2": Quantity("retrieved", "µg cm⁻²"),
    "low_ug_cm2": Quantity("lower", "µg cm⁻²", "Lower end of the interval."),
    "high_ug_cm2": Quantity("upper", "µg cm⁻²", "Upper end of the interval."),
    "covered_share": Quantity("seen", meaning="Share of the crown with pixels that were used."),
    "tree": Quantity("tree"),
    "method": Quantity("method"),
    "seconds": Quantity("time", "s"),
    "combinations": Quantity("images", meaning="Combinations of leaf and ground that were made."),
}  # fmt: skip

CHLOROPHYLL = {
    "n": Quantity("n", meaning="Number of entries or trees that were compared."),
    "rmse": Quantity("RMSE", "µg cm⁻²", "Root of the mean squared difference."),
    "bias": Quantity("bias", "µg cm⁻²", "Mean of retrieved minus reference."),
}
"""Columns that mean something else in tables of chlorophyll."""
REFLECTANCE = {name: Quantity(name) for name in ("rmse", "bias", "mean", "max")} | {
    "n": Quantity("n", meaning="Number of images that were compared.")
}
"""The same in tables of simulated images."""


UNITS = {
    "_m2_m3": "m² m⁻³", "_umol_m2_s": PAR_UNIT, "_ug_cm2": "µg cm⁻²", "_m3": "m³", "_m2": "m²",
    "_m": "m", "_deg": "°", "_s": "s", "_mb": "MB", "_rel": "relative",
}  # fmt: skip
"""Units by the end of a column's name."""


def quantity(name: str) -> Quantity:
    """How a column is shown; one that has no entry, by its name and the unit in it."""
    if name in QUANTITIES:
        return QUANTITIES[name]
    ending = next((end for end in UNITS if name.endswith(end)), "")
    return Quantity(name.removesuffix(ending).replace("_", " "), UNITS.get(ending, ""))
