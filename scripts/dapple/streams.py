"""One seed for a run, one stream of random numbers for every stage."""

import zlib

import numpy as np


def stream_seed(seed: int, *names: str | int) -> int:
    """Derive the seed of one stage from the seed of the run.

    Parameters
    ----------
    seed : int
        The seed in the configuration.
    *names : str or int
        What the stream is for, from the stage down, as in ``("scan", 3)``.

    Returns
    -------
    int
        A seed in 0 to 2**31 - 1; different names give independent streams.
    """
    words = [seed, *(zlib.crc32(str(name).encode()) for name in names)]
    return int(np.random.SeedSequence(words).generate_state(1)[0] >> 1)
