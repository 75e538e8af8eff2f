"""What the retrieval of chlorophyll is told is not what is true in the virtual plots.

A campaign knows its LiDAR, its images, the time of its flight, the camera's data sheet and the
literature. A virtual plot that hands the retrieval more than that is easier than any real one.
"""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import nnls

from dapple.config.settings import Settings
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import ZHAO
from dapple.optics.default_spectra import CONIFER_BARK, FOREST_SOIL
from dapple.optics.soil import two_soils
from dapple.retrieval import flight_light
from dapple.sky import spectrum
from dapple.virtual import plot_optics

RULES = Path(__file__).parents[2] / "rules" / "chlorophyll"
CONFIGURED = Settings(experiment="told", study="chlorophyll").chlorophyll
WORLD, RETRIEVAL = CONFIGURED.world, CONFIGURED.retrieval
# Needle structure has a name of its own in the world.
TRUTHS = {"n": WORLD.needle_structure, "chlorophyll_ug_cm2": WORLD.lcc_range_ug_cm2} | {
    name: getattr(WORLD, name)
    for name in type(WORLD).model_fields.keys() & type(RETRIEVAL).model_fields.keys()
}
NOISE = ("relative_noise", "absolute_noise")


@pytest.mark.parametrize("name", sorted(TRUTHS.keys() - set(NOISE)))
def test_quantities_of_the_world_are_drawn_from_wide_priors_that_do_not_centre_on_the_truth(name):
    low, high, levels = getattr(RETRIEVAL, name)
    true = np.mean(TRUTHS[name]) if name == "chlorophyll_ug_cm2" else np.ravel(TRUTHS[name])[0]
    assert levels > 1
    assert high > low + 0.5 * abs(true)
    if name.startswith("soil"):
        return  # of other soils: see below
    assert low < true < high
    assert abs(true - 0.5 * (low + high)) > 0.05 * (high - low)


def test_noise_of_the_images_is_not_that_of_the_training_set():
    assert [getattr(WORLD, name) for name in NOISE] != [getattr(RETRIEVAL, name) for name in NOISE]


def test_no_chlorophyll_of_the_retrieval_ends_where_that_of_trees_does():
    assert not set(RETRIEVAL.chlorophyll_ug_cm2[:2]) & set(WORLD.lcc_range_ug_cm2)


def test_needles_vary_within_a_tree_where_the_retrieval_has_one_leaf():
    assert WORLD.lowest_to_highest_lcc != 1
    assert WORLD.lcc_layers * WORLD.leaves_per_layer > 1
    assert WORLD.within_tree_sd > 0


def test_bands_of_the_camera_are_not_the_windows_of_its_data_sheet():
    nm = np.arange(400.0, 1000.0)
    built = plot_optics.as_built(
        ZHAO, centre_sd_nm=WORLD.band_centre_sd_nm, width_sd=WORLD.band_width_sd, seed=1
    )
    edge = np.where(nm < 715.0, 0.1, 0.5)
    assert np.abs(camera_mean(nm, edge, built) - camera_mean(nm, edge, ZHAO)).max() > 0.01


def test_soil_and_bark_of_the_world_are_no_mixture_that_the_retrieval_can_make():
    soil = plot_optics.in_bands(FOREST_SOIL, ZHAO)
    ends = np.stack([two_soils(ZHAO)(np.ones(1), np.array([wet]))[0] for wet in (0.0, 1.0)], axis=1)
    _, left = nnls(ends / soil[:, None], np.ones(5))
    assert left / np.sqrt(5) > 0.05
    bark = plot_optics.in_bands(CONIFER_BARK, ZHAO)
    known = np.array(ZHAO.at_centres(CONFIGURED.images.bark_reflectance))
    assert np.abs(known / bark - 1).max() > 0.1


@pytest.mark.parametrize("name", ["larch", "spruce"])
def test_the_share_of_skylight_is_within_what_a_clear_day_may_have_and_not_its_usual_value(name):
    zenith_deg = getattr(CONFIGURED, name).sun_zenith_deg
    sky = flight_light.diffuse_share((), zenith_deg, ZHAO)
    true = camera_mean(
        *spectrum.cloudless_diffuse_share(
            zenith_deg, aerosol_optical_depth_500nm=WORLD.aerosol_optical_depth
        ),
        ZHAO,
    )
    low, high = flight_light.shares(sky, np.array(RETRIEVAL.aerosol_optical_depth[:2]))
    assert (low < true).all()
    assert (true < high).all()
    assert (np.abs(np.array(sky["diffuse_share"]) / true - 1) > 0.1).all()


@pytest.mark.parametrize("part", ["crowns", "images", "retrieval"])
def test_rules_of_the_retrieval_see_no_setting_and_no_file_of_the_world(part):
    """But for LiDAR and images, and crowns with true chlorophyll where maps are scored."""
    _, _, rules = re.split('"""', (RULES / f"{part}.smk").read_text(), maxsplit=2)
    assert "WORLD" not in rules
    assert "world/" not in rules
    for rule in re.split(r"^rule ", rules, flags=re.MULTILINE)[1:]:
        scored = re.match(r"\w+", rule)[0] in ("accuracy", "chlorophyll_figures")
        assert scored or "crowns=plot_crowns" not in rule
