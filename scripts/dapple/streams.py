"""One seed for a run, one stream of random numbers for every stage."""

import zlib
from collections.abc import Iterator

_WORD = 0xFFFFFFFF


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

    Notes
    -----
    The first word of ``numpy.random.SeedSequence([seed, *names])``, without numpy: rules call this
    in Snakemake's own process, which may not have it.
    """
    entropy = [*_words(seed), *(zlib.crc32(str(name).encode()) for name in names)]
    return _first_word(_pool(entropy)) >> 1


def _words(number: int) -> list[int]:
    """A number as 32-bit words, the lowest first."""
    words = [number & _WORD]
    while number := number >> 32:
        words.append(number & _WORD)
    return words


def _multipliers(first: int, factor: int) -> Iterator[tuple[int, int]]:
    """Pairs of neighbours in the geometric series that a hash goes through."""
    while True:
        following = first * factor & _WORD
        yield first, following
        first = following


def _pool(entropy: list[int], size: int = 4) -> list[int]:
    """Words in which every word of the entropy has a part (O'Neill 2015, `seed_seq_fe`)."""
    series = _multipliers(0x43B0D7E5, 0x931E8875)

    def hashed(word: int) -> int:
        before, after = next(series)
        word = (word ^ before) * after & _WORD
        return word ^ word >> 16

    def mixed(x: int, y: int) -> int:
        word = (0xCA01F9DD * x - 0x4973F715 * y) & _WORD
        return word ^ word >> 16

    pool = [hashed(entropy[k] if k < len(entropy) else 0) for k in range(size)]
    for source in range(size):
        for target in range(size):
            if source != target:
                pool[target] = mixed(pool[target], hashed(pool[source]))
    for word in entropy[size:]:
        pool = [mixed(kept, hashed(word)) for kept in pool]
    return pool


def _first_word(pool: list[int]) -> int:
    """The first word that a pool generates."""
    before, after = next(_multipliers(0x8B51F9DD, 0x58F38DED))
    word = (pool[0] ^ before) * after & _WORD
    return word ^ word >> 16
