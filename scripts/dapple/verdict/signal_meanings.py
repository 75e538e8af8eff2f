"""What each signal means, which way it gets worse, and what would help."""

import math
from dataclasses import dataclass
from string import Formatter


@dataclass(frozen=True)
class Signal:
    """How a signal is read.

    Attributes
    ----------
    worse : int
        1 where more is worse, -1 where less is, 0 where it should be as in an undisturbed run.
    text : str
        What it tells, `{value}` standing for the number, `{factor}` for e to the power of it.
    help : str
        What would help.
    is_log : bool
        Judged by its logarithm.
    only_of : str
        The reconstruction that alone is judged by it: others may come without that one.
    most : float
        Beyond it no model is asked: what `only_of` names stands on nothing.
    """

    worse: int
    text: str
    help: str
    is_log: bool = False
    only_of: str = ""
    most: float = math.inf

    def tell(self, value: float) -> str:
        """What a value of the signal says, in words."""
        return self.text.format(**_said(value))

    def number(self, value: float) -> str:
        """The number alone, as it stands in the words; nothing where they have none."""
        said = _said(value)
        fields = [(name, spec or "") for _, name, spec, _ in Formatter().parse(self.text) if name]
        return next((format(said[name], spec) for name, spec in fields), "")


def _said(value: float) -> dict[str, float]:
    """A value as words may need it."""
    return {"value": value, "factor": math.exp(min(value, 700.0))}


MORE_SCANS = "Scan from more positions, spread evenly around the tree: `snakemake -- survey_next`."
DENSER = "Scan with a smaller angular step or from nearer."
FEWER_POLYGONS = f"Set polygons.voxel_size_m to auto. {DENSER}"
COARSER = "Take larger voxels, or scan with a smaller angular step."
FINER = "Take smaller voxels, as far as enough shots enter them, or polygons."
REGISTER = "Register the scans again with more tie points, and scan in still air."
CLASSES = "Check the leaf and wood threshold against the histogram, or classify by geometry."
OCCLUDED = (
    "Switch on corrections.occlusion, or scan from more positions, also from below the crown."
)
PLACES = "Survey the sensors' positions again; average over sensors or over an hour."
LIGHT = "Judge this hour by its mean: with this sky single sensors differ too little to compare."
DISAGREEMENT = (
    "Compare both reconstructions in a part of the crown that is seen well; where they differ, at "
    "least one is wrong."
)
REFIT = (
    "See where in structure/RECONSTRUCTION/rescan.csv (`snakemake -- rescan`); take another size, "
    "or the reconstruction that the shots fit."
)
OPENNESS = "the scan's own shots pass {} with an error of {{value:.0%}}, degree by degree"

SIGNALS = {
    "scan_count": Signal(-1, "{value:.0f} scan positions", MORE_SCANS, is_log=True),
    "largest_gap_deg": Signal(1, "no scan over {value:.0f}° around the tree", MORE_SCANS),
    "noise_share": Signal(
        1,
        "the noise filter took {value:.0%} of the returns",
        "Look for rain, dust or a low sun in the scan; filter by pulse deviation.",
    ),
    "scan_shift_m": Signal(1, "scans fit better when moved by {value:.3f} m", REGISTER),
    "scan_residual_m": Signal(1, "points of different scans lie {value:.3f} m apart", REGISTER),
    "shots_per_voxel": Signal(
        -1, "{value:.0f} shots or fewer enter a twentieth of the voxels", COARSER, is_log=True
    ),
    "unknown_share": Signal(1, "{value:.0%} of the crown's volume is unknown", MORE_SCANS),
    "unknown_on_sun_beams": Signal(
        1, "{value:.0%} of the way of light through the crown is unknown", MORE_SCANS
    ),
    "seen_on_sun_beams": Signal(
        -1, "the scan sees {value:.0%} of the leaves on the way of light", OCCLUDED
    ),
    "reflectance_separation": Signal(
        -1, "reflectances of two kinds lie {value:.1f} deviations apart (Ashman's D)", CLASSES
    ),
    "reflectance_gain": Signal(-1, "reflectance shows one kind of points rather than two", CLASSES),
    "reflectance_valley": Signal(-1, "no valley between leaf and wood in the reflectance", CLASSES),
    "threshold_height": Signal(
        0, "leaf and wood part {value:.1f} deviations above the leaves' reflectance", CLASSES
    ),
    "class_contrast": Signal(
        -1, "leaf and wood differ by {value:.1f} deviations of reflectance", CLASSES
    ),
    "wood_share": Signal(0, "{value:.0%} of the points are wood", CLASSES),
    "sparse_polygons": Signal(
        1, "{value:.0%} of the polygons are made of one or two points", FEWER_POLYGONS
    ),
    "points_per_polygon": Signal(
        -1, "{value:.1f} points in a polygon", FEWER_POLYGONS, is_log=True
    ),
    "distance_to_polygons": Signal(
        1, "points lie {value:.2f} of a polygon's size off its plane", REGISTER
    ),
    "tilt_departure": Signal(
        1,
        "leaves are not at spherical angles (mean |cos| differs by {value:.2f})",
        "Set voxels.leaf_angle_distribution to what polygons show.",
    ),
    "lacking_area": Signal(
        1, "polygons lack {value:.0%} of their area where beams seldom came", OCCLUDED
    ),
    "area_polygons_to_fine": Signal(
        0, "polygons have {factor:.2f} times the leaf area of the voxels", DISAGREEMENT
    ),
    "area_fine_to_coarse": Signal(
        0, "small voxels have {factor:.2f} times the leaf area of large ones", COARSER
    ),
    "capped_share": Signal(
        1,
        "{value:.0%} of the leaf area is in voxels at the cap of density",
        "Raise voxels.max_pad_m2_m3, take larger voxels or switch on corrections.clumping.",
    ),
    "plant_area_index": Signal(1, "a dense crown: {value:.1f} m² of leaf above each m²", OCCLUDED),
    "fine_voxel_to_crown": Signal(1, "small voxels of {value:.2f} of the crown's size", FINER),
    "coarse_voxel_to_crown": Signal(1, "large voxels of {value:.2f} of the crown's size", FINER),
    "shots_per_surfel": Signal(
        -1, "{value:.1f} shots tell how open a disc is", DENSER, is_log=True, only_of="surfels"
    ),
    "surfels_without_surface": Signal(
        1,
        "{value:.0%} of the discs lie on no surface that points show",
        f"{DENSER} Until then take polygons or voxels.",
        only_of="surfels",
        most=0.5,
    ),
    "area_surfels_to_fine": Signal(
        0,
        "surfels have {factor:.2f} times the leaf area of the voxels",
        DISAGREEMENT,
        only_of="surfels",
    ),
    "gap_error_polygons": Signal(1, OPENNESS.format("polygons"), REFIT),
    "gap_error_surfels": Signal(1, OPENNESS.format("surfels"), REFIT, only_of="surfels"),
    "gap_error_fine": Signal(1, OPENNESS.format("small voxels"), REFIT),
    "gap_error_coarse": Signal(1, OPENNESS.format("large voxels"), REFIT),
    "lowest_sun_deg": Signal(-1, "the sun stands as low as {value:.0f}°", LIGHT),
    "direct_share": Signal(-1, "{value:.0%} of the light comes straight from the sun", LIGHT),
    "light_contrast": Signal(
        -1, "sensors differ by {value:.0%} of the mean light at a time", LIGHT
    ),
    "r_polygons_fine": Signal(
        -1, "light of polygons and small voxels correlates with {value:.2f}", DISAGREEMENT
    ),
    "difference_polygons_fine": Signal(
        0, "light below polygons differs from that below small voxels by {value:+.0%}", DISAGREEMENT
    ),
    "r_surfels_fine": Signal(
        -1,
        "light of surfels and small voxels correlates with {value:.2f}",
        DISAGREEMENT,
        only_of="surfels",
    ),
    "difference_surfels_fine": Signal(
        0,
        "light below surfels differs from that below small voxels by {value:+.0%}",
        DISAGREEMENT,
        only_of="surfels",
    ),
    "r_fine_coarse": Signal(
        -1, "light of small and large voxels correlates with {value:.2f}", DISAGREEMENT
    ),
    "difference_fine_coarse": Signal(
        0,
        "light below small voxels differs from that below large ones by {value:+.0%}",
        DISAGREEMENT,
    ),
    "sensitivity_polygons": Signal(
        1, "moved sensors change light by {value:.2f} of its spread (polygons)", PLACES
    ),
    "sensitivity_surfels": Signal(
        1,
        "moved sensors change light by {value:.2f} of its spread (surfels)",
        PLACES,
        only_of="surfels",
    ),
    "sensitivity_fine": Signal(
        1, "moved sensors change light by {value:.2f} of its spread (small voxels)", PLACES
    ),
    "sensitivity_coarse": Signal(
        1, "moved sensors change light by {value:.2f} of its spread (large voxels)", PLACES
    ),
    "clock_lag_min": Signal(
        1,
        "records fit best {value:.1f} min earlier or later",
        "Set the loggers' clocks right, or fit the offset (registration.fit).",
    ),
    "misplaced_share": Signal(
        1, "records of {value:.0%} of the sensors fit better at a place beside them", PLACES
    ),
}
"""All signals, in the order of the chain."""

OF_RECORDS = ("clock_lag_min", "misplaced_share")
"""Signals that need measured light: what is wrong with sensors and clocks leaves no other trace."""

ABSENT = {
    "shots": (
        ("unknown_share", "shots_per_voxel"),
        "without shots nobody knows what the scan did not see",
        "Export all pulses, misses included, from the scanner's software.",
    ),
    "scans": (
        ("scan_shift_m",),
        "points do not say which scan they come from, or there is one scan only",
        "Keep the scan position of each point (PointSourceId) when scans are merged.",
    ),
    "light": (
        ("light_contrast",),
        "no light was simulated",
        "Give sensors, so that reconstructions can be compared by what they predict.",
    ),
}
"""What may be lacking: signals that then are NaN, what that means, what would help."""
