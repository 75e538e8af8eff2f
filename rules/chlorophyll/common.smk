"""
Settings of the chlorophyll experiment, and what its rules share. No rules here.

Needs   the configuration
Makes   nothing
"""

from itertools import product

from dapple.optics.cameras import camera

CHLOROPHYLL = settings.chlorophyll
BANDS = CHLOROPHYLL.camera_bands
CAMERA = camera(BANDS)
RESPONSES = [data(CHLOROPHYLL.responses)] if CHLOROPHYLL.responses else []
CROWNS = CHLOROPHYLL.crowns
RETRIEVAL = CHLOROPHYLL.retrieval
CROWN_NOISE = {"cell_m": CROWNS.noise_cell_m, "most_points": CROWNS.noise_points}


wildcard_constraints:
    plot="larch|spruce|user",
    model="collision_orders|semi_less|prosail",
    mask="sunlit|all",
    network="robust|published",


def plot_of(wildcards):
    """Settings of the plot of a job."""
    return getattr(CHLOROPHYLL, wildcards.plot)


def plot_file(path):
    """A file of every plot, as a pattern."""
    return results(f"plots/{{plot}}/{path}")


def own(kind):
    """The user's `lidar`, `images` (perhaps several files) or `crowns`, or nothing."""
    path = getattr(CHLOROPHYLL.user, kind)
    if "*" in path:
        return data_files(path)
    return data(path) if path else []


def plot_lidar(wildcards):
    """LiDAR of a plot."""
    return (
        own("lidar")
        if wildcards.plot == "user"
        else results(f"plots/{wildcards.plot}/world/lidar.laz")
    )


def plot_images(wildcards):
    """Images of a plot: reflectance in the camera's bands, in the cloud's coordinate system."""
    folder = "input" if wildcards.plot == "user" else "world"
    return results(f"plots/{wildcards.plot}/{folder}/images.tif")


def plot_crowns(wildcards):
    """Crowns of a plot in the cloud's coordinate system; a user may have none."""
    if wildcards.plot == "user":
        has_crowns = bool(CHLOROPHYLL.user.crowns)
        return results("plots/user/input/crowns.geojson") if has_crowns else []
    return results(f"plots/{wildcards.plot}/world/crowns.geojson")


def plot_input_facts(wildcards):
    """What was found in a user's files."""
    if wildcards.plot != "user":
        return []
    crowns = ["crowns"] if CHLOROPHYLL.user.crowns else []
    return [results(f"plots/user/input/{name}.json") for name in ["images", *crowns]]


SUN = plot_file("light/sun.json")
SKYLIGHT = plot_file("light/sky.json")

WORLD = CHLOROPHYLL.world
SIZES = {"height_m", "height_sd_m", "crown_radius_m", "crown_radius_sd_m"}
SHOOTS = {"shoot_length_m", "strip_width_m", "strips_per_shoot"}
WORLD_SHOOTS = WORLD.model_dump(include=SHOOTS)
WORLD_LCC = {
    "mean_ug_cm2": WORLD.lcc_mean_ug_cm2,
    "sd_ug_cm2": WORLD.lcc_sd_ug_cm2,
    "range_ug_cm2": WORLD.lcc_range_ug_cm2,
}
WORLD_FLIGHT = {
    "height_m": WORLD.lidar_height_m,
    "line_spacing_m": WORLD.lidar_line_spacing_m,
    "half_swath_deg": WORLD.lidar_half_swath_deg,
    "pulses_per_m2": WORLD.lidar_pulses_per_m2,
    "beam_divergence_mrad": WORLD.lidar_divergence_mrad,
    "range_noise_m": WORLD.lidar_range_noise_m,
    "min_separation_m": WORLD.lidar_separation_m,
    "max_returns": WORLD.lidar_returns,
}
WORLD_CHEMISTRY = {
    "structure_n": WORLD.needle_structure,
    "dry_matter_g_cm2": WORLD.dry_matter_g_cm2,
    "brown": WORLD.brown,
    "chlorophyll_per_carotenoid": WORLD.chlorophyll_per_carotenoid,
    "water_cm": WORLD.water_cm,
}
CROWN_KEYS = {
    "lowest_to_highest_lcc",
    "lcc_layers",
    "leaves_per_layer",
    "within_tree_sd",
}
WORLD_CROWN = WORLD.model_dump(include=CROWN_KEYS)
WORLD_CAMERA = {
    "centre_sd_nm": WORLD.band_centre_sd_nm,
    "width_sd": WORLD.band_width_sd,
}
WORLD_GROUND = {
    "brightness": WORLD.soil_brightness,
    "moisture": WORLD.soil_moisture,
    "litter_share": WORLD.litter_share,
    "variation": WORLD.ground_variation,
}


def grown_files(part):
    """Leaves or wood of the trees of a virtual plot that all others are copies of."""
    return [plot_file(f"world/grown_{part}_{k}.ply") for k in range(WORLD.grown_trees)]


def plot_tree(wildcards):
    """What a tree is like, apart from its size."""
    plot = plot_of(wildcards)
    return WORLD_SHOOTS | {
        "crown_base_share": plot.crown_base_share,
        "dbh_m": plot.dbh_m,
    }


def plot_light(wildcards):
    """What is stated of the sun and sky of a plot's images."""
    stated = {"sun_zenith_deg", "sun_azimuth_deg", "diffuse_share", "time", "timezone"}
    return {"diffuse_share": ()} | plot_of(wildcards).model_dump(include=stated)


def plot_planting(wildcards):
    """Where trees may stand, and what they have to cover."""
    plot = plot_of(wildcards)
    return {
        "size_m": plot.size_m,
        "margin_m": CHLOROPHYLL.margin_m,
        "cover_share": plot.cover,
        "core_share": WORLD.core_share,
    }


RANGES = (
    "n",
    "chlorophyll_ug_cm2",
    "dry_matter_g_cm2",
    "brown",
    "soil_brightness",
    "soil_moisture",
    "chlorophyll_per_carotenoid",
    "water_cm",
    "shoot_recollision",
    "aerosol_optical_depth",
)
LEAVES_AND_SOILS = {
    "ranges": {name: getattr(RETRIEVAL, name) for name in RANGES},
    "combinations": RETRIEVAL.combinations,
    "jitter_steps": RETRIEVAL.jitter_steps,
    "anthocyanin_per_chlorophyll": RETRIEVAL.anthocyanin_per_chlorophyll,
    "prospect_version": RETRIEVAL.prospect_version,
    "soil_vectors": RETRIEVAL.soil_vectors
    and str(Path(settings.data_dir) / RETRIEVAL.soil_vectors),
}

SELECTION = {
    "cell_m": RETRIEVAL.map_pixel_m,
    "sunlit_nir": RETRIEVAL.sunlit_nir,
    "min_share": RETRIEVAL.min_share,
    "canopy_height_m": RETRIEVAL.canopy_height_m,
}
NETWORK = {
    key: getattr(RETRIEVAL, key)
    for key in (
        "hidden",
        "block",
        "learning_rate",
        "last_rate_share",
        "weight_decay",
        "batch",
        "max_epochs",
        "patience",
    )
}
SPLIT = {"test_share": RETRIEVAL.test_share, "held_share": RETRIEVAL.held_share}
ERRORS = {
    "relative": RETRIEVAL.relative_noise,
    "relative_common": RETRIEVAL.common_noise,
    "absolute": RETRIEVAL.absolute_noise,
    "absolute_common": RETRIEVAL.absolute_noise,
}
TAUGHT = [
    {"model": model, "mask": mask, "network": network}
    for model, mask, network in product(
        RETRIEVAL.models, RETRIEVAL.masks, RETRIEVAL.networks
    )
]


def retrieval_files(name, plots=CHLOROPHYLL.plots, **only):
    """A file of every plot, model, mask and network, or only of some."""
    return [
        results(f"plots/{plot}/retrieval/{name.format(**taught)}")
        for plot in plots
        for taught in TAUGHT
        if only.items() <= taught.items()
    ]


def of_plot(name):
    """A file of every model, mask and network of the plot of a job."""
    return lambda wildcards: retrieval_files(name, [wildcards.plot])


def of_model(name):
    """A file of every mask and network of the plot and model of a job."""
    return lambda wildcards: retrieval_files(
        name, [wildcards.plot], model=wildcards.model
    )


def taught_by(model):
    """Masks and networks of a model, in the order of its files."""
    return [taught for taught in TAUGHT if taught["model"] == model]


def made_of_model(name):
    """Patterns of the files of every mask and network of a model."""
    return [
        plot_file(f"retrieval/{name.format(**taught)}")
        for taught in (
            {"model": "{model}", "mask": mask, "network": network}
            for mask, network in product(RETRIEVAL.masks, RETRIEVAL.networks)
        )
    ]


def networks_of_model(wildcards):
    """Networks of a model: those of all seeds of a mask and kind together."""
    return [
        results(
            f"plots/{wildcards.plot}/retrieval/"
            f"network_{taught['model']}_{taught['mask']}_{taught['network']}_{seed}.npz"
        )
        for taught in taught_by(wildcards.model)
        for seed in RETRIEVAL.seeds
    ]


def split_seed(wildcards):
    """Seed of the division of a plot's training sets, the same for all models and networks."""
    return stream("split", wildcards.plot)


def simulation(wildcards):
    """What the images of a model are made from."""
    made = {
        "collision_orders": ["images/coefficients.nc"],
        "semi_less": ["images/semiless.nc"],
        "prosail": ["scene/leaves.ply", "scene/wood.ply"],
    }[wildcards.model]
    paths = [plot_file(path).format(plot=wildcards.plot) for path in made]
    return {"simulation": paths}


IMAGES = CHLOROPHYLL.images
BARK = CAMERA.at_centres(IMAGES.bark_reflectance)
