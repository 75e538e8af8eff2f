"""Seeds of stages: derived from one, the same wherever they are derived."""

import zlib

import numpy as np
import pytest

from dapple.streams import stream_seed


@pytest.mark.parametrize("seed", [0, 1, 42, 2**31, 2**32, 2**70 + 5])
@pytest.mark.parametrize("names", [(), ("scan",), ("light", 3), ("a", "b", "c", "d", 5)])
def test_a_stream_has_the_seed_that_numpy_derives(seed, names):
    words = [seed, *(zlib.crc32(str(name).encode()) for name in names)]
    expected = np.random.SeedSequence(words).generate_state(1)[0] >> 1
    assert stream_seed(seed, *names) == expected


def test_no_two_stages_or_runs_share_a_stream():
    seeds = {stream_seed(seed, stage) for seed in range(50) for stage in ("scan", "light", "plant")}
    assert len(seeds) == 150
