"""What was traced survives being written."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

from dapple.errors import InputError
from dapple.formats import netcdf
from dapple.light import transport_files as files
from dapple.light.tensor import Transport
from dapple.optics.responses import COSINE
from dapple.scene.counters import Counters

IDENTITIES = np.array([2**64 - 1, 0, 7], np.uint64)


def traced(rows=50):
    rng = np.random.default_rng(1)
    return Transport(
        sky_seen=rng.random((3, 16, 577), np.float32),
        sensor=np.sort(rng.integers(3, size=rows).astype(np.int32)),
        replicate=rng.integers(16, size=rows).astype(np.int32),
        patch=rng.integers(577, size=rows).astype(np.int32),
        orders=rng.integers(255, size=(rows, 4)).astype(np.uint8),
        count=rng.integers(1, 2**40, size=rows),
        n_paths=np.array([64, 128, 64]),
        cut=np.array([0, 3, 1]),
        max_orders=250,
        counters=Counters(("leaf",), ("wood", "ground")),
    )


@pytest.mark.parametrize("rows", [0, 50])
def test_counted_paths_come_back_as_they_were(tmp_path, rows):
    before = traced(rows)
    files.write(tmp_path / "paths.nc", before, IDENTITIES)
    identities, after = files.read(tmp_path / "paths.nc")
    np.testing.assert_array_equal(identities, IDENTITIES)
    for name, value in vars(before).items():
        np.testing.assert_array_equal(getattr(after, name), value)
        assert np.asarray(getattr(after, name)).dtype == np.asarray(value).dtype


@pytest.mark.parametrize("response", [COSINE, ((0.0, 1.0), (60.0, 0.4), (90.0, 0.1))])
def test_a_file_says_how_its_sensors_respond(tmp_path, response):
    files.write(tmp_path / "paths.nc", replace(traced(), response=response), IDENTITIES)
    assert files.read(tmp_path / "paths.nc")[1].response == response


def test_the_same_paths_give_the_same_bytes(tmp_path):
    for name in ("a.nc", "b.nc"):
        files.write(tmp_path / name, traced(), IDENTITIES)
    assert (tmp_path / "a.nc").read_bytes() == (tmp_path / "b.nc").read_bytes()


def test_a_file_of_another_kind_is_named(tmp_path):
    netcdf.write(tmp_path / "sky.nc", xr.Dataset())
    with pytest.raises(InputError, match=r"sky\.nc.*no sensor"):
        files.read(tmp_path / "sky.nc")
