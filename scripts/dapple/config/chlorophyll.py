"""Leaf chlorophyll from UAV images and UAV LiDAR."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt
from pydantic import AllowInfNan

from dapple.config.base import (
    Count,
    MomentOrNone,
    NotNegative,
    OneOf,
    Positive,
    Section,
    Share,
    Some,
    key,
)
from dapple.optics.cameras import CAMERAS

ZHAO = "Zhao et al. 2025"
ZHANG = "Zhang et al. 2016"
# Least and most of a parameter, and levels of a grid between them.
GridRange = tuple[NotNegative, NotNegative, Count]
Spectrum = Some[tuple[Positive, Share]]


class OwnPlot(Section):
    """Your own plot: its files, and when they were taken."""

    lidar: str = key("", "LAS or LAZ of the plot, relative to data_dir")
    images: str = key(
        "",
        "reflectance as GeoTIFF, in any coordinate system, relative to data_dir; a pattern with * "
        "for bands in files of their own",
    )
    band_order: tuple[Count, ...] = key(
        (), "number of the image's band for each of the camera; empty: by name, wavelength, colour"
    )
    scale: NotNegative = key(0.0, "value that means a reflectance of 1; 0: the file's own, or none")
    nodata: Annotated[float, AllowInfNan()] | None = key(
        None, "value that means no data, besides the file's own"
    )
    crowns: str = key(
        "", "GeoPackage, Shapefile or GeoJSON of crowns, relative to data_dir; empty: cells only"
    )
    crowns_layer: str = key("", "layer of a file with several")
    crowns_tree_column: str = key("", "names of the trees; empty: by the usual names, or numbered")
    crowns_lcc_column: str = key(
        "", "measured leaf chlorophyll [µg/cm²]; empty: by the usual names, or none"
    )
    sun_zenith_deg: Annotated[float, Ge(0), Le(80)] | None = key(
        None, "of the images; none: from `time` and the place of the images"
    )
    sun_azimuth_deg: Annotated[float, Ge(0), Le(360)] | None = key(
        None, "of the images, from north over east; none: from `time`"
    )
    time: MomentOrNone = key(
        "", "middle of the flight, as 2024-07-01 11:30; not needed with both angles"
    )
    timezone: str = key("UTC", "zone of `time` where it has no offset of its own")
    diffuse_share: tuple[tuple[Positive, Share], ...] = key(
        (),
        "of the light on level ground, from the sky: wavelength [nm] and share, linear between; "
        "empty: a cloudless sky",
    )


class Plot(Section):
    """A virtual plot: its trees and the flight over it."""

    size_m: tuple[Positive, Positive] = key((50.0, 50.0), "edges east and north", ZHAO)
    cover: Annotated[float, Gt(0), Le(0.95)] = key(0.62, "canopy cover", ZHAO)
    species: Literal["larch", "spruce"] = key("larch", "of the virtual trees")
    height_m: Annotated[float, Ge(3)] = key(15.0, "mean height of the trees")
    height_sd_m: NotNegative = key(1.5, "standard deviation of heights, cut off at twice that")
    crown_radius_m: Positive = key(
        2.5, "mean radius of crowns: the circle as large as their outline"
    )
    crown_radius_sd_m: NotNegative = key(0.35, "standard deviation, cut off at twice that")
    crown_base_share: Annotated[float, Gt(0), Lt(0.9)] = key(0.3, "height of the crown's base")
    dbh_m: Positive = key(0.2, "stem diameter at 1.3 m")
    crown_leaf_area_index: Positive = key(3.0, "leaf area over the area of the crown's outline")
    sun_zenith_deg: Annotated[float, Ge(0), Le(80)] = key(58.0, "of the images", ZHAO)
    sun_azimuth_deg: Annotated[float, Ge(0), Le(360)] = key(266.32, "of the images", ZHAO)
    pixel_m: Positive = key(0.04, "of the images", ZHAO)
    field_trees: Count = key(28, "trees with measured chlorophyll", ZHAO)


class World(Section):
    """What the virtual plots share: chlorophyll, needles, terrain, LiDAR, camera."""

    crs: str = key("EPSG:25832", "coordinate system of the plots: projected, in metres")
    origin_m: tuple[float, float, float] = key(
        (612_000.0, 5_324_000.0, 640.0), "south-west corner of the plots"
    )
    grown_trees: Count = key(5, "different trees; all others are turned and scaled copies")
    core_share: Annotated[float, Gt(0), Le(1)] = key(
        0.7, "least distance of two stems over the sum of both crown radii"
    )
    lcc_mean_ug_cm2: Positive = key(39.9, "mean leaf chlorophyll of the trees", ZHAO)
    lcc_sd_ug_cm2: Positive = key(10.8, "standard deviation between trees", ZHAO)
    lcc_range_ug_cm2: tuple[Positive, Positive] = key((5.0, 85.0), "no tree lies outside")
    lowest_to_highest_lcc: Annotated[float, Gt(0.3), Lt(3)] = key(
        0.8, "chlorophyll of the lowest needles over the highest; a tree's value is their mean"
    )
    lcc_layers: Annotated[int, Ge(1), Le(20)] = key(5, "steps in which it changes with height")
    leaves_per_layer: Annotated[int, Ge(1), Le(20)] = key(3, "kinds of shoots in each of them")
    within_tree_sd: Share = key(
        0.1, "standard deviation between these kinds, of chlorophyll and dry matter, as a share"
    )
    chlorophyll_per_carotenoid: tuple[Positive, NotNegative] = key(
        (5.4, 0.5), "mean and standard deviation between trees"
    )
    needle_structure: tuple[Positive, NotNegative] = key(
        (1.6, 0.1), "PROSPECT's N, mean and standard deviation between trees"
    )
    dry_matter_g_cm2: tuple[Positive, NotNegative] = key(
        (0.012, 0.002), "mean and standard deviation between trees"
    )
    brown: tuple[NotNegative, NotNegative] = key(
        (0.05, 0.03), "brown pigments, mean and standard deviation between trees"
    )
    water_cm: tuple[NotNegative, NotNegative] = key(
        (0.02, 0.004), "equivalent water thickness, mean and standard deviation between trees"
    )
    shoot_length_m: Positive = key(0.16, "strips of needles that make up a shoot")
    strip_width_m: Positive = key(0.02, "of these strips")
    strips_per_shoot: Annotated[int, Ge(1), Le(20)] = key(4, "strips around the axis of a shoot")
    slope: Annotated[float, Ge(0), Le(1)] = key(0.04, "of the mean ground, rise per metre")
    wave_height_m: NotNegative = key(1.5, "greatest height of the ground's waves")
    wave_length_m: Positive = key(30.0, "longest of these waves; the shortest is half as long")
    terrain_step_m: Positive = key(0.25, "edge of the ground's triangles and of its colours")
    soil_brightness: Positive = key(1.0, "of a brown forest soil, as a factor")
    soil_moisture: Share = key(0.4, "mean over the ground, as a share of saturation")
    litter_share: Share = key(0.4, "of the ground, under litter of needles; mean")
    ground_variation: Share = key(0.2, "standard deviation of soil_moisture and litter_share")
    lidar_height_m: Annotated[float, Ge(10)] = key(50.0, "of the UAV above the mean ground", ZHAO)
    lidar_pulses_per_m2: Positive = key(
        950.0, "about 2000 points per m² with several returns", ZHAO
    )
    lidar_line_spacing_m: Positive = key(17.5, "between parallel flight lines")
    lidar_half_swath_deg: Annotated[float, Gt(0), Le(60)] = key(
        35.0, "largest angle from the nadir"
    )
    lidar_divergence_mrad: NotNegative = key(1.5, "full angle of the beam")
    lidar_range_noise_m: NotNegative = key(0.015, "standard deviation of one echo's range")
    lidar_separation_m: NotNegative = key(0.5, "nearer echoes of a pulse merge")
    lidar_returns: Annotated[int, Ge(1), Le(15)] = key(5, "returns that a pulse has at most")
    aerosol_optical_depth: Annotated[float, Ge(0), Le(2)] = key(
        0.18, "at 500 nm, while the images are taken", "SPECTRL2 (Bird and Riordan 1984)"
    )
    band_centre_sd_nm: NotNegative = key(2.0, "of the camera's bands about their nominal centres")
    band_width_sd: Annotated[float, Ge(0), Le(0.3)] = key(
        0.08, "of their widths about the nominal ones, as a share; bands are bells, not windows"
    )
    renderer: Literal["mitsuba", "less"] = key(
        "mitsuba", "of the observed images; LESS 3 shares no code with what chlorophyll is told by"
    )
    paths_per_pixel: tuple[Annotated[int, Ge(1), Le(4096)], Annotated[int, Ge(1), Le(4096)]] = key(
        (12, 32), "of the observed images, visible and infrared: scattered more often there"
    )
    relative_noise: NotNegative = key(0.01, "of the images: standard deviation over the value")
    absolute_noise: NotNegative = key(0.001, "of the images: standard deviation, as reflectance")


class Crowns(Section):
    """From a cloud to a scene: ground, crowns, sub-crowns, facets."""

    crs: str = key("", "coordinate system of a cloud that names none, as in EPSG:25832")
    noise_cell_m: Positive = key(2.0, "edge of the cells that tell isolated points")
    noise_points: Annotated[int, Ge(0)] = key(5, "so few points in 27 cells are noise; 0: none are")
    dem_pixel_m: Positive = key(0.5, "of the elevation model")
    ground_cell_m: Positive = key(0.2, "the lowest point of each cell is shown to the cloth")
    cloth_m: Positive = key(0.5, "distance of the cloth's knots", ZHANG)
    ground_rigidness: Literal[1, 2, 3] = key(2, "of the cloth: 1 steep, 2 hilly, 3 flat", ZHANG)
    ground_threshold_m: Positive = key(0.3, "from the cloth to ground points")
    chm_pixel_m: Positive = key(0.25, "of the canopy heights, or the points' distance if larger")
    chm_reach_m: NotNegative = key(2.0, "canopy height is not known farther from any point")
    min_height_m: Positive = key(2.0, "least height of a crown's canopy")
    smoothing_m: NotNegative = key(0.5, "standard deviation that smooths the canopy heights")
    min_distance_m: Positive = key(1.0, "between the tops of two trees")
    min_area_m2: NotNegative = key(1.5, "least area of a crown")
    subcrown_area_m2: Positive = key(2.0, "wanted area of a sub-crown")
    subcrown_points: Annotated[int, Ge(0)] = key(
        50, "points that a sub-crown needs: in a sparse cloud it gets larger"
    )
    layers: Annotated[int, Ge(1), Le(10)] = key(3, "height layers of a crown", ZHAO)
    base_share: Share = key(0.02, "share of a crown's points below its base: stems, shrubs")
    min_leaf_height_m: Positive = key(0.5, "lower returns are ground")
    voxel_m: Positive = key(0.2, "thinning for alpha shapes; voxels in which pulses are followed")
    alpha_m: Positive = key(0.6, "radius of the alpha shapes")
    alpha_spacings: NotNegative = key(3.0, "least radius, in mean distances of the cloud's points")
    window_s: Positive = key(0.5, "time over which the sensor flies straight")
    range_exponent: Annotated[float, Ge(0), Le(4)] = key(
        2.0, "intensity falls with range to this power; 0: the instrument corrects it"
    )
    ground_to_canopy_intensity: NotNegative = key(
        0.0, "of pulses on ground alone over those on canopy alone; 0: from single returns"
    )
    projection: Annotated[float, Gt(0), Le(1)] = key(0.5, "G of the plants: spherical angles", ZHAO)
    max_density_m2_m3: Positive = key(5.0, "plant area density where nothing passes")
    clumping_index: Annotated[float, Gt(0), Le(1)] = key(
        1.0, "effective over true plant area within a part: needles in shoots; 1: not corrected"
    )
    wood_share: Share = key(
        0.15, "of the plant area, which pulses cannot tell from leaves", "Gower et al. 1999"
    )
    facet_area_m2: Positive = key(0.01, "square facets that fill sub-crowns", ZHAO)
    terrain_step_m: Positive = key(1.0, "edge of the terrain's squares")


class Images(Section):
    """Simulated images: paths, orders, the published acceleration."""

    pixel_m: Positive = key(
        0.25, "of the simulated images: wider than facets, or chance tilts tell what is sunlit"
    )
    paths_per_pixel: Annotated[int, Ge(4), Le(65536)] = key(64, "light paths, at least")
    least_paths: Count = key(16_000_000, "of a whole image: a small plot gets more per pixel")
    columns: Annotated[int, Ge(4), Le(200)] = key(
        32, "functions of the kind of path kept per pixel, for sun and sky each"
    )
    max_orders: Annotated[int, Ge(2), Le(250)] = key(100, "most surfaces on a path")
    bark_reflectance: Spectrum = key(
        ((450.0, 0.115), (560.0, 0.132), (650.0, 0.157), (730.0, 0.197), (840.0, 0.278)),
        "of wood: wavelength [nm] and reflectance, linear between; Semi-LESS takes the bands' mean",
        "larch branches in the spectral database of LESS",
    )
    absorption_levels: Annotated[int, Ge(4), Le(100)] = key(14, "Semi-LESS: leaves to fit to", ZHAO)
    leaf_structure: Annotated[float, Ge(1), Le(3)] = key(1.5, "Semi-LESS: N of these leaves", ZHAO)
    degree: Annotated[int, Ge(1), Le(12)] = key(6, "Semi-LESS: polynomials of the leaf albedo")
    reference_soils: tuple[Share, Share, Share] = key(
        (0.2, 0.5, 0.8), "Semi-LESS: reflectance of three soils beside a black one"
    )
    direct_renders: Annotated[int, Ge(2)] = key(30, "combinations rendered one by one, to compare")
    direct_paths: Annotated[int, Ge(2)] = key(32, "paths per pixel of such a render")
    speed_combinations: Count = key(1000, "combinations for which times are compared", ZHAO)


class Retrieval(Section):
    """Leaves and soils to simulate, training set, network and map."""

    models: Some[Literal["collision_orders", "semi_less", "prosail"]] = key(
        ("collision_orders", "semi_less", "prosail"), "what simulates the images to learn from"
    )
    masks: Some[Literal["sunlit", "all"]] = key(
        ("sunlit", "all"), "canopy pixels that are averaged: sunlit ones, or all"
    )
    map_pixel_m: Positive = key(3.0, "of training entries and map", ZHAO)
    sunlit_nir: Share = key(0.25, "near-infrared reflectance above which a pixel is sunlit", ZHAO)
    canopy_height_m: NotNegative = key(2.0, "least height of vegetation that counts as canopy")
    min_share: Share = key(0.02, "chosen pixels that a map pixel must have, as a share of it")
    combinations: Annotated[int, Ge(10)] = key(1400, "combinations of leaf and soil")
    max_entries: Count = key(200_000, "entries kept of more, drawn by chance; 182,560 published")
    n: GridRange = key((1.0, 2.5, 4), "leaf structure: least, most, levels of the grid", ZHAO)
    chlorophyll_ug_cm2: GridRange = key((10.0, 70.0, 13), "chlorophyll a and b per leaf area", ZHAO)
    chlorophyll_per_carotenoid: GridRange = key(
        (2.5, 7.0, 4), "carotenoids follow from chlorophyll", "Lichtenthaler and Buschmann 2001"
    )
    anthocyanin_per_chlorophyll: NotNegative = key(
        0.043,
        "PROSPECT-D: what green leaves hold; PROSPECT-5 counts it as chlorophyll",
        "larch and birch leaves in the spectral database of LESS",
    )
    dry_matter_g_cm2: GridRange = key((0.0, 0.03, 4), "dry matter per leaf area", ZHAO)
    water_cm: GridRange = key((0.005, 0.03, 4), "equivalent water thickness", "Feret et al. 2008")
    brown: GridRange = key(
        (0.0, 0.2, 4),
        "brown pigments: green leaves have few or none; [0, 0.8, 5], as published, for dying ones",
        "none in the green leaves of PROSPECT-5 (Feret et al. 2008)",
    )
    soil_brightness: GridRange = key((0.01, 0.7, 4), "of the soil", ZHAO)
    soil_moisture: GridRange = key((0.01, 0.78, 4), "of the soil, a share of saturation", ZHAO)
    shoot_recollision: GridRange = key(
        (0.0, 0.68, 4),
        "chance that light scattered by a needle meets its own shoot; [0, 0, 1]: broad leaves",
        "1 - 4 STAR (Smolander and Stenberg 2003) of 305 Scots pine shoots (Stenberg et al. 1994)",
    )
    aerosol_optical_depth: GridRange = key(
        (0.03, 0.5, 4), "at 500 nm, on clear days; not used where diffuse_share is stated"
    )
    jitter_steps: NotNegative = key(0.5, "deviation of the jitter, in grid steps", ZHAO)
    prospect_version: Literal["5", "D"] = key("D", "calibration of PROSPECT")
    soil_vectors: str = key(
        "", "folder with GSV's DryVec.txt and SMVec.txt in data_dir; empty: prosail's two soils"
    )
    leaf_angle_deg: Annotated[float, Ge(0), Le(90)] = key(57.0, "SAIL: mean angle; 57 is spherical")
    hot_spot: Positive = key(0.01, "SAIL: leaf size over canopy height")
    networks: Some[Literal["robust", "published"]] = key(
        ("robust", "published"), "that learn from bands with errors, or from exact ones"
    )
    relative_noise: NotNegative = key(
        0.05, "robust: error of each band on its own, as a share of the value"
    )
    common_noise: NotNegative = key(
        0.2,
        "robust: error that all bands share, as a share of the value: calibration, and how much "
        "of the crown is lit",
    )
    absolute_noise: NotNegative = key(
        0.002, "robust: errors of each band and of all together, as reflectance"
    )
    seeds: Some[int] = key((1, 2, 3), "one network each; the map is their mean")
    hidden: Some[Count] = key((800, 400, 200), "widths of the first hidden layers", ZHAO)
    block: Count = key(3, "hidden layers within the residual block", ZHAO)
    learning_rate: Positive = key(0.001, "of Adam", ZHAO)
    last_rate_share: Share = key(0.01, "share of the rate to which it falls, along a cosine")
    weight_decay: NotNegative = key(0.001, "of Adam, decoupled from the gradient", ZHAO)
    batch: Count = key(512, "entries of one step")
    max_epochs: Count = key(10, "most passes over all entries")
    patience: Count = key(5, "epochs without a better validation after which training stops")
    test_share: Annotated[float, Gt(0), Lt(1)] = key(0.2, "of entries that test", ZHAO)
    held_share: Annotated[float, Gt(0), Lt(0.5)] = key(
        0.1, "of combinations that validate, and as many that test: none of them teaches"
    )
    interval_level: Annotated[float, Gt(0), Lt(1)] = key(0.9, "truths that an interval holds")
    range_quantile: Annotated[float, Gt(0), Lt(1)] = key(
        0.999, "of entries that lie within the training range"
    )


class Chlorophyll(Section):
    """Leaf chlorophyll from UAV images and UAV LiDAR."""

    plots: Some[Literal["larch", "spruce", "user"]] = key(("larch", "spruce"), "plots to map")
    camera: Annotated[str, OneOf(CAMERAS)] = key(
        "p4m", "that took the images: its bands, by their makers' data", ZHAO
    )
    bands: tuple[tuple[str, Positive, Positive], ...] = key(
        (), "of another camera: name in the images, centre and width [nm]"
    )
    responses: str = key(
        "", "CSV of wavelength_nm and a response by name of band, relative to data_dir; empty: flat"
    )
    margin_m: NotNegative = key(10.0, "surroundings of a plot that shade it")
    larch: Plot = Plot()
    spruce: Plot = Plot(
        size_m=(20.0, 30.0),
        cover=0.42,
        species="spruce",
        height_m=10.0,
        height_sd_m=1.2,
        crown_radius_m=1.8,
        crown_radius_sd_m=0.25,
        crown_base_share=0.12,
        dbh_m=0.16,
        crown_leaf_area_index=4.5,
        sun_zenith_deg=38.53,
        sun_azimuth_deg=242.81,
        pixel_m=0.026,
        field_trees=17,
    )
    user: OwnPlot = OwnPlot()
    world: World = World()
    crowns: Crowns = Crowns()
    images: Images = Images()
    retrieval: Retrieval = Retrieval()

    @property
    def camera_bands(self) -> tuple[tuple[str, float, float], ...]:
        """Name, centre and width [nm] of the camera's bands."""
        named = CAMERAS[self.camera]
        return self.bands or tuple((band.name, band.centre_nm, band.width_nm) for band in named)
