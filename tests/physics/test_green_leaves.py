"""Which leaf model meets green leaves: PROSPECT-5, or PROSPECT-D with a little anthocyanin."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

from dapple.config.chlorophyll import Retrieval
from dapple.optics.leaf import leaf_spectra

SPECTRA = Path(os.environ.get("DAPPLE_DATA_DIR", "../shared/data")) / "spectra"
BANDS = np.arange(440.0, 901.0, 5.0)


def leaf(chlorophyll, share=0.0, version="D", **properties):
    """Reflectance and transmittance, with `share` of chlorophyll as anthocyanin."""
    return leaf_spectra(
        BANDS,
        chlorophyll_ug_cm2=chlorophyll,
        carotenoids_ug_cm2=chlorophyll / 4,
        anthocyanin_ug_cm2=chlorophyll * share,
        prospect_version=version,
        **properties,
    )


@pytest.mark.parametrize("chlorophyll", [20.0, 40.0, 60.0])
def test_without_anthocyanin_prospect_d_is_brighter_in_green_than_prospect_5(chlorophyll):
    def green(*model):
        return np.sum(leaf(chlorophyll, *model), axis=0)[BANDS == 560.0].item()

    of_five = green(0.0, "5")
    assert green(0.0) > 1.1 * of_five
    with_anthocyanin = green(Retrieval().anthocyanin_per_chlorophyll)
    assert abs(with_anthocyanin / of_five - 1) < 0.5 * (green(0.0) / of_five - 1)


@pytest.mark.parametrize("species", ["larch", "birch"])
def test_a_green_leaf_of_the_less_database_holds_that_share(species):
    path = SPECTRA / f"spectrum_{species}_leaf_green.csv"
    if not path.is_file():
        pytest.skip(f"no {path}: set DAPPLE_DATA_DIR to the folder of the real data")
    table = pd.read_csv(path)
    seen = [
        np.interp(BANDS, table["wavelength_nm"], table[side])
        for side in ("front_reflectance", "transmittance")
    ]

    def error(x):
        n, chlorophyll, share, dry_matter = x
        found = leaf(chlorophyll, share, n=n, dry_matter_g_cm2=dry_matter, water_cm=0.015)
        return np.ravel(found) - np.ravel(seen)

    bounds = ([1.0, 5.0, 0.0, 0.0], [3.0, 100.0, 0.2, 0.05])
    fit = least_squares(error, [1.5, 40.0, 0.02, 0.005], bounds=bounds, x_scale=[1, 30, 0.05, 0.01])
    assert fit.x[2] == pytest.approx(Retrieval().anthocyanin_per_chlorophyll, abs=0.005)
