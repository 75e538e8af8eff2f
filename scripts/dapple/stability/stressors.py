"""What is made worse, one thing at a time, and by how much."""

from dataclasses import asdict, dataclass, replace
from math import inf
from typing import Any

from dapple.errors import InputError


@dataclass(frozen=True)
class Conditions:
    """Everything about a run that a stressor may change; the defaults are an undisturbed run.

    Attributes
    ----------
    leaf_area_factor : float
        Leaf area of the tree, as a multiple of the undisturbed one.
    leaf_length_m : float or None
        Mean length of leaf blades [m]; None: as the plant is configured.
    needle_width_m : float
        Leaves are bundles of flat needles of this width [m]; 0: they are blades.
    leaf_angles : str
        Distribution of the leaves' normals; reconstructions assume the one that is configured.
    second_tree_m : float
        Distance of a second tree from the first [m]; infinite: there is none.
    positions : int or None
        Scan positions; None: as configured.
    span_deg : float
        They are spread over this arc around the tree [°].
    angular_step_deg : float or None
        Angle between neighbouring shots [°]; None: as configured.
    reflectance_gap_db : float or None
        Mean of bark less mean of leaves [dB]; None: as configured.
    noise_share : float
        Share of returns above the ground that have no target.
    wind_m : float
        Root mean square displacement of leaves, another one for every scan position [m].
    misregistration_m : float
        Shift of every scan but the first, each in its own direction [m].
    kept_share : float
        Share of shots that is kept, by chance.
    drift_db : float
        Error of the reflectance calibration [dB].
    classifier : str or None
        How leaf and wood are told apart (`cloud.classifiers`); None: as configured.
    has_stem : bool
        Whether the classifier sees the stem, to which branches lead.
    voxel_factor : float
        Edges of all voxels, those of polygons too, as a multiple of the configured ones.
    max_pad_m2_m3 : float or None
        Cap of plant area density [m² m⁻³]; None: as configured.
    sensor_error_m : float
        Horizontal error of each sensor's position, each in its own direction [m].
    clock_offset_min : float
        How far the clock of the simulated series is ahead [min].
    sun_elevation_deg : float or None
        Minutes around this height of the sun instead of the configured times, and sensors in the
        crown's shadow [°].
    diffuse_share : float or None
        Diffuse share of global radiation; None: a cloudless sky.
    """

    leaf_area_factor: float = 1.0
    leaf_length_m: float | None = None
    needle_width_m: float = 0.0
    leaf_angles: str = "spherical"
    second_tree_m: float = inf
    positions: int | None = None
    span_deg: float = 360.0
    angular_step_deg: float | None = None
    reflectance_gap_db: float | None = None
    noise_share: float = 0.0
    wind_m: float = 0.0
    misregistration_m: float = 0.0
    kept_share: float = 1.0
    drift_db: float = 0.0
    classifier: str | None = None
    has_stem: bool = True
    voxel_factor: float = 1.0
    max_pad_m2_m3: float | None = None
    sensor_error_m: float = 0.0
    clock_offset_min: float = 0.0
    sun_elevation_deg: float | None = None
    diffuse_share: float | None = None


UNDISTURBED = Conditions()

STAGES = {
    "tree": (
        "leaf_area_factor",
        "leaf_length_m",
        "needle_width_m",
        "leaf_angles",
        "second_tree_m",
    ),
    "scan": (
        "positions",
        "span_deg",
        "angular_step_deg",
        "reflectance_gap_db",
        "noise_share",
        "wind_m",
        "misregistration_m",
        "kept_share",
    ),
    "cloud": ("drift_db",),
    "classes": ("classifier", "has_stem"),
    "structure": ("voxel_factor", "max_pad_m2_m3"),
    "light": ("sensor_error_m", "sun_elevation_deg"),
    "sky": ("clock_offset_min", "diffuse_share"),
}
"""Which conditions each step of the chain depends on, besides those of the steps before it."""


def key(conditions: Conditions, stage: str) -> tuple[Any, ...]:
    """What a step's result depends on: the conditions of this step and of those before it."""
    values = asdict(conditions)
    names = list(STAGES)
    before = names[: names.index(stage) + 1]
    return tuple(values[name] for step in before for name in STAGES[step])


@dataclass(frozen=True)
class Level:
    """One degree of a stressor: its number, how a figure calls it, and what it changes."""

    value: float
    label: str
    changes: dict[str, Any]

    @property
    def conditions(self) -> Conditions:
        """The undisturbed conditions with the changes."""
        return replace(UNDISTURBED, **self.changes)


@dataclass(frozen=True)
class Stressor:
    """Something that is made worse.

    Attributes
    ----------
    name, title : str
        For files and for figures; the title names the unit of the levels.
    levels : tuple of Level
        In the order of their values.
    harmless : float
        The level that others are compared with.
    """

    name: str
    title: str
    levels: tuple[Level, ...]
    harmless: float

    def chosen(self, n: int) -> tuple[Level, ...]:
        """The harmless level and n - 1 others, the most extreme ones first; all if n is enough."""
        if n >= len(self.levels):
            return self.levels
        at = next(k for k, level in enumerate(self.levels) if level.value == self.harmless)
        order = sorted(range(len(self.levels)), key=lambda k: (k != at, -abs(k - at), k))
        return tuple(self.levels[k] for k in sorted(order[:n]))


def _numbers(
    name: str, title: str, field: str, values: tuple, harmless: float, *, usual: bool = True
) -> Stressor:
    """Levels by their number; where `usual`, the harmless one leaves all as it is configured."""
    levels = tuple(
        Level(float(v), f"{v:g}", {} if usual and v == harmless else {field: v}) for v in values
    )
    return Stressor(name, title, levels, float(harmless))


def _named(name: str, title: str, changes: dict[str, dict[str, Any]]) -> Stressor:
    """Levels without a natural number, numbered from the harmless one."""
    levels = tuple(Level(float(k), *one) for k, one in enumerate(changes.items()))
    return Stressor(name, title, levels, 0.0)


def _leaf_sizes() -> Stressor:
    blades = [Level(m, f"{100 * m:g} cm", {"leaf_length_m": m}) for m in (0.03, 0.15)]
    usual = Level(0.065, "6.5 cm", {})
    needles = [Level(m, f"needles {1000 * m:g} mm", {"needle_width_m": m}) for m in (0.001, 0.003)]
    return Stressor(
        "leaf_size", "leaf size [m]", (*needles, blades[0], usual, blades[1]), usual.value
    )


def _second_tree() -> Stressor:
    distances = (inf, 4.0, 3.0, 2.0, 1.0)
    levels = tuple(
        Level(1 / m, f"{m:g} m" if m < inf else "none", {"second_tree_m": m} if m < inf else {})
        for m in distances
    )
    return Stressor("second_tree", "second tree, by closeness [m⁻¹]", levels, 0.0)


STRESSORS = {
    stressor.name: stressor
    for stressor in (
        _numbers("scan_positions", "scan positions", "positions", (1, 2, 4, 6, 8), 8),
        _numbers("scan_side", "arc of 8 positions [°]", "span_deg", (0, 45, 90, 180, 360), 360),
        _numbers(
            "angular_step",
            "angular step [°]",
            "angular_step_deg",
            (0.02, 0.04, 0.08, 0.11, 0.2, 0.5),
            0.08,
        ),
        _numbers(
            "leaf_area", "leaf area, multiple", "leaf_area_factor", (0.5, 1.0, 2.0, 3.0, 4.0), 1
        ),
        _leaf_sizes(),
        _named(
            "leaf_angles",
            "true leaf angles, spherical assumed",
            {
                name: {} if name == "spherical" else {"leaf_angles": name}
                for name in ("spherical", "plagiophile", "erectophile", "uniform", "planophile")
            },
        ),
        _numbers(
            "reflectance_drift", "reflectance drift [dB]", "drift_db", (-3, -1.5, 0, 1.5, 3), 0
        ),
        _numbers(
            "reflectance_overlap",
            "bark less leaf reflectance [dB]",
            "reflectance_gap_db",
            (0, 1.5, 3, 4.5, 5.5),
            5.5,
        ),
        _named(
            "no_reflectance",
            "classes without calibrated reflectance",
            {
                "calibrated": {},
                "from data": {"classifier": "mixture"},
                "geometry": {"classifier": "geometry"},
                "no stem": {"classifier": "geometry", "has_stem": False},
                "all leaf": {"classifier": "all_leaf"},
            },
        ),
        _numbers(
            "noise_points", "noise share of points", "noise_share", (0, 0.02, 0.05, 0.1, 0.2), 0
        ),
        _numbers(
            "misregistration",
            "misregistration [m]",
            "misregistration_m",
            (0, 0.01, 0.02, 0.05, 0.1),
            0,
        ),
        _numbers("wind", "wind: leaves displaced [m]", "wind_m", (0, 0.02, 0.05, 0.1, 0.2), 0),
        _numbers(
            "voxel_to_leaf_size",
            "voxel edges, multiple",
            "voxel_factor",
            (0.25, 0.5, 1.0, 2.0, 4.0),
            1,
        ),
        _numbers(
            "few_shots", "share of shots kept", "kept_share", (0.003, 0.01, 0.03, 0.1, 1.0), 1
        ),
        _numbers(
            "pad_cap", "cap of density [m² m⁻³]", "max_pad_m2_m3", (0.5, 1.0, 2.0, 5.0, 20.0), 5
        ),
        _numbers(
            "sensor_position",
            "sensor position error [m]",
            "sensor_error_m",
            (0, 0.05, 0.1, 0.2, 0.3),
            0,
        ),
        _numbers("clock_offset", "clock offset [min]", "clock_offset_min", (0, 1, 2, 5, 10), 0),
        _numbers(
            "low_sun",
            "height of the sun [°]",
            "sun_elevation_deg",
            (4, 8, 15, 30, 45),
            45,
            usual=False,
        ),
        _numbers(
            "diffuse_share",
            "diffuse share of light",
            "diffuse_share",
            (0.1, 0.3, 0.5, 0.8, 1.0),
            0.1,
            usual=False,
        ),
        _second_tree(),
    )
}


def find(name: str, where: str = "stability") -> Stressor:
    """A stressor by its name; `where` is named when there is none.

    Raises
    ------
    InputError
        There is none of that name.
    """
    if name not in STRESSORS:
        raise InputError(
            where,
            f"`stability.stressors: {name}`",
            f"one of {', '.join(STRESSORS)}",
            "Choose among these; empty: all.",
        )
    return STRESSORS[name]
