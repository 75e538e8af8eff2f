"""A scene that the workflow exported comes back through the workflow with the same light."""

import numpy as np
import pandas as pd
import pytest

from dapple.formats import netcdf

pytestmark = pytest.mark.whole


def test_an_exported_scene_is_lit_as_it_was_at_the_highest_sun(small_run, tmp_path):
    project = small_run.clone(tmp_path / "dapple")
    folder = project.result("export/polygons/exchange")
    project.run(folder.relative_to(project.folder))
    scene = folder / "scene.json"
    project.run("exchange", config=[f"exchange={{scene: {scene}}}"])
    found = pd.read_csv(project.result("exchange/light.csv"), dtype={"sensor": str})
    par = found.groupby("sensor")["irradiance"].sum()
    own = netcdf.read(project.result("light/polygons.nc"))
    sky = netcdf.read(project.result("sky/sky.nc"))
    noon = int(np.argmin(sky["sun_zenith_deg"].to_numpy()))
    expected = own["par_umol_m2_s"].isel(time=noon).to_series()
    open_sky = found.groupby("sensor")["open_sky"].sum()
    error = (par - expected.loc[par.index]) / open_sky
    assert np.sqrt((error**2).mean()) < 0.03
    assert abs(error.mean()) < 0.01
