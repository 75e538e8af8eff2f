"""Typed configuration: every parameter with its unit, default, range and source.

The default configuration, its schema and its documentation are made from these classes:
`make docs` writes them.
"""

from __future__ import annotations

from math import sqrt
from typing import Annotated, Any, Literal

from annotated_types import Ge, Gt, Le
from pydantic import Field, ValidationError

from dapple.config import checks
from dapple.config.base import (
    FREY,
    RIEGL,
    Count,
    LeafAngles,
    Moment,
    NotNegative,
    Positive,
    Section,
    Share,
)
from dapple.config.base import parameter as _
from dapple.config.chlorophyll import Chlorophyll
from dapple.config.light import Advice, Light, Tradeoff
from dapple.config.stability import Stability
from dapple.config.survey import Survey


class Plant(Section):
    """The virtual apple tree (`source: virtual`)."""

    height_m: Positive = _(6.6, "height", FREY)
    crown_base_m: Positive = _(2.1, "height of the lowest leaves", FREY)
    crown_radius_m: Positive = _(3.78, "radius of the crown; projection 45 m²", FREY)
    dbh_m: Positive = _(0.19, "stem diameter at 1.3 m", FREY)
    leaf_area_m2: Positive = _(90.0, "one-sided leaf area")
    leaf_length_min_m: Positive = _(0.05, "shortest leaf")
    leaf_length_max_m: Positive = _(0.08, "longest leaf")
    leaf_angle_distribution: LeafAngles = _("spherical", "of the leaf normals")


class Leaves(Section):
    """Virtual leaf polygons along real wood (`source: wood`)."""

    placements: Count = _(8, "independent placements; light is their mean")
    leaf_area_m2: Positive = _(187.0, "area of all leaf polygons", FREY)
    n_elements: Count = _(147_098, "leaf polygons, one in a 5 cm voxel", FREY)
    small_share: Share = _(
        round(40_190 / 147_098, 4), "share of polygons made of one or two points", FREY
    )
    crown_base_m: NotNegative = _(2.1, "no leaf is lower above the stem's foot", FREY)
    max_distance_m: Positive = _(0.3, "longest shoot")
    # Of nine pairs these two come nearest to the published 6,960 voxels of 0.2 m and 44.8 m².
    clump_radius_m: Positive = _(0.04, "spread of leaves across their shoot")
    leaves_per_shoot: Count = _(600, "leaves that share a shoot")
    thin_wood_m2: Positive = _(0.001, "wood polygons of this area carry half as many shoots")
    leaf_angle_distribution: LeafAngles = _("spherical", "of the polygons' normals", FREY)


class Scan(Section):
    """The virtual terrestrial scanner, after the RIEGL VZ-400i."""

    positions: Count = _(8, "scan positions on a circle around the stem", FREY)
    radius_m: Positive = _(10.0, "distance of the positions from the stem", FREY)
    height_m: Positive = _(1.6, "height of the scanner above the ground")
    angular_step_deg: Annotated[float, Ge(0.005), Le(2)] = _(
        0.12, "angle between neighbouring shots; 0.04 in the field", FREY
    )
    beam_divergence_mrad: NotNegative = _(0.35, "full angle of the beam", RIEGL)
    exit_aperture_m: NotNegative = _(0.007, "diameter of the beam at the scanner", RIEGL)
    sub_rays: Annotated[int, Ge(1), Le(64)] = _(7, "rays that sample one beam")
    range_noise_m: NotNegative = _(0.005, "standard deviation of a range", RIEGL)
    min_separation_m: NotNegative = _(0.8, "nearer targets merge into one mixed return")
    max_returns: Annotated[int, Ge(1), Le(255)] = _(5, "returns of one shot")
    noise_points_per_shot: Share = _(0.001, "isolated noise points")
    leaf_reflectance_db: tuple[float, float] = _((-8.0, 1.5), "mean and deviation over leaves")
    wood_reflectance_db: tuple[float, float] = _((-2.5, 1.1), "mean and deviation over wood")
    window_margin_m: NotNegative = _(1.0, "shots that pass the tree within it are fired")


class CloudInput(Section):
    """A real point cloud (`source: cloud`)."""

    path: str = _("", "point cloud (las, laz, ply, e57, ptx, txt), relative to data_dir")
    scan_positions: str = _(
        "", "CSV of scan positions: position, x, y, z in the cloud's coordinates"
    )
    shots: Literal["none", "recorded", "scan_frame"] = _(
        "none", "misses: not known, recorded in the file (ptx), or rebuilt from scan_frame"
    )


class ScanFrame(Section):
    """The regular angular frame of a single scan, from which its misses are rebuilt."""

    n_zenith: Count = _(2082, "shots in a line")
    n_azimuth: Count = _(580, "lines")
    zenith_deg: tuple[float, float] = _((30.0, 130.024), "first and last zenith in the scanner")
    azimuth_deg: tuple[float, float] = _((0.0, 359.90), "first and last azimuth in the scanner")
    tilt_deg: tuple[float, float, float] = _((1.026, 0.760, -110.019), "roll, pitch, yaw")


class Clean(Section):
    """The noise filter."""

    min_reflectance_db: float = _(-15.0, "points at or below are dropped", FREY)
    max_deviation: Positive = _(15.0, "points at or above are dropped", FREY)
    outlier_backend: Literal["cloudcompare", "pdal", "none"] = _(
        "cloudcompare", "program that finds statistical outliers"
    )
    outlier_neighbours: Count = _(8, "neighbours whose mean distance is judged")
    outlier_multiplier: Positive = _(3.0, "standard deviations beyond which a point is an outlier")
    thin_voxel_m: Positive = _(0.01, "one point is left in a voxel of this size", FREY)
    distance_points: Count = _(200_000, "points whose distance from the polygons is measured")
    min_height_m: NotNegative = _(0.1, "points lower above the ground are dropped")


class Classify(Section):
    """Leaf or wood."""

    method: Literal["reflectance", "mixture", "geometry", "all_leaf"] = _(
        "reflectance",
        "fixed threshold, threshold from the data, shape of the neighbourhood, or none",
    )
    threshold_db: float = _(-5.4, "reflectance above which a point is wood", FREY)
    majority_voxel_m: Positive = _(0.05, "voxels in which the majority decides", FREY)


class Polygons(Section):
    """One planar polygon per voxel and class."""

    voxel_size_m: Positive = _(0.05, "edge of the voxels", FREY)
    buffer_m: NotNegative = _(round(sqrt(2 * 0.01**2) / 2, 6), "outward growth of each hull", FREY)
    mitre_limit: Annotated[float, Ge(1), Le(10)] = _(
        1.414, "corners move outwards by at most so many buffers"
    )


class Voxels(Section):
    """Plant area density."""

    sizes_m: tuple[Positive, ...] = _((0.2, 1.0), "edges of the voxels", FREY)
    estimator: Literal["transmittance", "ppl", "fpl", "fpl_biased", "contact_frequency"] = _(
        "fpl", "bias-corrected free path length", "Pimont et al. 2018"
    )
    leaf_angle_distribution: LeafAngles = _("spherical", "of the leaf normals", FREY)
    single_leaf_area_m2: NotNegative = _(0.0, "finite-element correction; 0: none")
    max_pad_m2_m3: Positive = _(5.0, "cap of plant area density", "AMAPVox")
    min_shots: Count = _(5, "fewer shots leave a voxel unknown", "AMAPVox")
    contact_voxel_m: NotNegative = _(
        0.05, "sub-voxels of the contact frequency; 0: none", "Hosoi and Omasa 2006"
    )
    beam_divergence_mrad: NotNegative = _(0.0, "weight shots by their beam's section; 0: equally")
    beam_diameter_m: NotNegative = _(0.0, "beam's diameter at the scanner, for that weight")
    allow_missing_misses: bool = _(False, "go on where every shot of a scan has a return")


class Corrections(Section):
    """What a scan did not see, made up for."""

    occlusion: bool = _(
        False, "add leaf polygons where coverage is poor", "after Van der Zande et al. 2008"
    )
    clumping: bool = _(False, "give voxels the effective density that light meets")
    fill_range_m: Positive = _(0.5, "unknown voxels are like known ones within about this distance")


class Site(Section):
    """Where the sensors stand."""

    latitude_deg: Annotated[float, Ge(-90), Le(90)] = _(48.0009, "north", FREY)
    longitude_deg: Annotated[float, Ge(-180), Le(180)] = _(7.8003, "east", FREY)
    altitude_m: float = _(230.0, "above sea level", FREY)
    timezone: str = _("Europe/Berlin", "IANA zone of local time, for figures")


class Time(Section):
    """The times to be simulated."""

    start: Moment = _("2023-08-10 10:10", "first time", FREY)
    end: Moment = _("2023-08-10 16:50", "last time", FREY)
    step_min: Positive = _(10.0, "minutes between times")
    timezone: str = _("UTC", "IANA zone of start and end")


class Radiation(Section):
    """Broadband radiation that reaches the top of the tree."""

    kind: Literal["clear_sky", "table"] = _("clear_sky", "modelled, or read from a file")
    path: str = _("", "CSV, relative to data_dir")
    time_column: str = _("time_utc", "column of time stamps")
    global_column: str = _("global_W_m2", "column of global horizontal irradiance [W m⁻²]")
    diffuse_column: str = _("diffuse_W_m2", "column of diffuse horizontal irradiance [W m⁻²]")
    timezone: str = _("UTC", "IANA zone of the time stamps")
    max_gap_min: Positive = _(60.0, "rows of the file further apart are filled by the model")
    linke_turbidity: Positive = _(3.0, "haze of the clear-sky model", "Ineichen and Perez 2002")
    precipitable_water_cm: Annotated[float, Gt(0), Le(8)] = _(2.0, "water vapour, for the spectrum")
    ozone_atm_cm: Annotated[float, Gt(0), Le(0.6)] = _(0.31, "ozone, for the spectrum")
    aerosol_optical_depth_500nm: Annotated[float, Ge(0), Le(2)] = _(0.1, "haze, for the spectrum")
    ground_albedo: Share = _(0.2, "broadband, for the spectrum of the diffuse light")
    sky: Literal["perez", "isotropic"] = _(
        "perez", "angular distribution of diffuse light", "Perez et al. 1993"
    )


class LeafOptics(Section):
    """PROSPECT-D parameters of the leaves."""

    n: Annotated[float, Ge(1), Le(4)] = _(1.5, "leaf structure index N")
    chlorophyll_ug_cm2: NotNegative = _(45.0, "chlorophyll a + b")
    carotenoids_ug_cm2: NotNegative = _(9.0, "carotenoids")
    brown: NotNegative = _(0.0, "brown pigments, arbitrary units")
    water_cm: NotNegative = _(0.012, "equivalent water thickness")
    dry_matter_g_cm2: NotNegative = _(0.006, "dry matter")


class Spectrum(Section):
    """A reflectance spectrum, linear between its wavelengths."""

    wavelength_nm: tuple[float, ...] = _((400.0, 700.0), "wavelengths, ascending")
    reflectance: tuple[Share, ...] = _((0.2, 0.2), "one value for each wavelength")
    path: str = _("", "instead: a table of wavelength and reflectance, relative to data_dir")


class Optics(Section):
    """Spectra of leaf, bark and meadow."""

    leaf: LeafOptics = LeafOptics()
    bark: Spectrum = Spectrum(wavelength_nm=(400.0, 550.0, 700.0), reflectance=(0.10, 0.18, 0.26))
    ground: Spectrum = Spectrum(
        wavelength_nm=(400.0, 500.0, 550.0, 600.0, 680.0, 700.0),
        reflectance=(0.03, 0.05, 0.10, 0.07, 0.05, 0.12),
    )


class Sensors(Section):
    """Horizontal PAR sensors."""

    kind: Literal["grid", "table", "none"] = _(
        "grid", "a grid around the stem, a file, or no light"
    )
    path: str = _("", "CSV with label, X, Y, Z, relative to data_dir")
    columns: Count = _(9, "grid: sensors from west to east")
    rows: Count = _(8, "grid: sensors from south to north")
    spacing_m: Positive = _(1.0, "grid: distance between neighbours", FREY)
    height_m: NotNegative = _(0.1, "grid: height above the ground")


class Measured(Section):
    """The measured series."""

    kind: Literal["virtual", "table", "none"] = _(
        "virtual", "light of the virtual truth through a sensor model, a file, or none"
    )
    path: str = _("", "CSV with time_utc, logger, channel, par_umolm2s, relative to data_dir")
    noise_relative: NotNegative = _(0.02, "sensor model: relative standard deviation")
    noise_umol_m2_s: NotNegative = _(2.0, "sensor model: absolute standard deviation")
    calibration_relative: NotNegative = _(0.0, "sensor model: relative error of a whole sensor")
    clock_offset_s: float = _(0.0, "sensor model: how far the logger's clock is ahead")


class Registration(Section):
    """Origin of the tree's frame and offset of the loggers' clock."""

    fit: bool = _(False, "fit them on a part of the records and report on the rest")
    origin_m: tuple[float, float, float] = _((0.0, 0.0, 0.0), "origin, or first guess of it")
    max_shift_m: NotNegative = _(0.4, "largest shift that is tried, east and north")
    max_clock_offset_s: NotNegative = _(60.0, "largest clock offset that is tried")
    split: Literal["sensor", "time"] = _(
        "sensor", "what is divided into fitting and reporting parts"
    )
    fit_share: Share = _(0.5, "share of it used for fitting")


class Statistics(Section):
    """How simulated and measured light are compared."""

    n_bootstrap: Count = _(1000, "bootstrap replicates, sensors drawn as blocks")
    confidence: Annotated[float, Gt(0), Le(0.999)] = _(0.95, "level of the intervals")


class Figures(Section):
    """Pictures."""

    sensors: tuple[str, ...] = _((), "sensors of the daily courses; empty: six spread ones")
    map_times: tuple[Moment, ...] = _((), "times of the ground maps; empty: four spread ones")
    map_spacing_m: Positive = _(0.25, "pixel of the ground maps")
    map_margin_m: NotNegative = _(2.0, "ground shown beyond the crown")


class Tools(Section):
    """External programs; a bare name is looked up on the PATH and in .tools."""

    pdal: str = _("pdal", "PDAL")
    cloudcompare: str = _("CloudCompare", "CloudCompare")


class Settings(Section):
    """The whole configuration of a run."""

    experiment: Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9-]*$")] = _(
        "virtual-apple", "name of the run: results go to results/{experiment}"
    )
    seed: Annotated[int, Ge(0)] = _(1, "every random number of the run derives from it")
    data_dir: str = _("../shared/data", "folder of real data; only real experiments read it")
    source: Literal["virtual", "wood", "cloud"] = _(
        "virtual", "a virtual tree and scan, real wood with virtual leaves, or a point cloud"
    )
    reconstructions: tuple[str, ...] = _(
        ("polygons", "voxels_0.2", "voxels_1.0", "truth"), "what light is computed for"
    )
    ground_z_m: float = _(0.0, "height of the flat ground in the tree's frame")
    wood_path: str = _("", "OBJ of wood polygons in LESS axes (source: wood), relative to data_dir")
    plant: Plant = Plant()
    leaves: Leaves = Leaves()
    scan: Scan = Scan()
    cloud: CloudInput = CloudInput()
    scan_frame: ScanFrame = ScanFrame()
    clean: Clean = Clean()
    classify: Classify = Classify()
    polygons: Polygons = Polygons()
    voxels: Voxels = Voxels()
    corrections: Corrections = Corrections()
    site: Site = Site()
    time: Time = Time()
    radiation: Radiation = Radiation()
    optics: Optics = Optics()
    sensors: Sensors = Sensors()
    measured: Measured = Measured()
    registration: Registration = Registration()
    light: Light = Light()
    advice: Advice = Advice()
    tradeoff: Tradeoff = Tradeoff()
    statistics: Statistics = Statistics()
    figures: Figures = Figures()
    survey: Survey = Survey()
    chlorophyll: Chlorophyll = Chlorophyll()
    stability: Stability = Stability()
    tools: Tools = Tools()


def validate(config: dict[str, Any], where: str = "configuration") -> Settings:
    """Turn a merged configuration into typed settings.

    Raises
    ------
    InputError
        A key that does not exist (the nearest valid one is named), a value of the wrong type or out
        of its range, or values that contradict each other.
    """
    try:
        settings = Settings.model_validate(config)
    except ValidationError as error:
        raise checks.explain(error, Settings, where) from None
    checks.check(settings, where)
    return settings
