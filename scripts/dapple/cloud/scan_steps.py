"""The steps between the shots of a scan, read from the directions of its points."""

import numpy as np

SUBSET = 40_000
AZIMUTH_BINS = 1 << 19
SMALLEST_STEP_DEG, LARGEST_STEP_DEG = 0.01, 10.0
LARGEST_IN_SPECTRUM_DEG = 2.0
"""Below this many turns a spectrum shows the widths of trunks and crowns as well as steps."""
LEAST_COHERENCE = 0.2
LEAST_LINES = 10
"""Fewer may fall on every second line by chance."""


def find_azimuth_step(azimuth: np.ndarray) -> float:
    """The step between lines of shots, from the azimuths of their points alone [rad].

    The largest step to whose multiples the azimuths keep, by the spectrum of their histogram.

    Parameters
    ----------
    azimuth : (n,) float64
        In the frame of a scanner that stands level [rad].

    Returns
    -------
    float
        NaN where no step stands out: a scanner that was tilted, a wrong place, a thinned cloud.
    """
    turned = np.asarray(azimuth) % (2 * np.pi)
    count, _ = np.histogram(turned, bins=AZIMUTH_BINS, range=(0.0, 2 * np.pi))
    # Padded: a window of azimuths is no full turn, and its steps no whole part of one.
    spectrum = np.abs(np.fft.rfft(count, 4 * AZIMUTH_BINS)) / len(turned)
    cycles = np.arange(len(spectrum)) / 4.0
    first, last = (int(4 * 360.0 / step) for step in (LARGEST_IN_SPECTRUM_DEG, SMALLEST_STEP_DEG))
    spectrum = spectrum[: last + 1]
    highest = float(spectrum[first:].max())
    if highest < LEAST_COHERENCE:
        return float("nan")
    strong = first + int(np.argmax(spectrum[first:] > 0.6 * highest))
    # The first strong one begins a peak: its top lies within a turn's share of the window.
    width = max(4, int(4 * 2 * np.pi / max(_span(turned), 0.05)))
    top = strong + int(np.argmax(spectrum[strong : strong + width]))
    return _of_lines_in_use(turned, float(2 * np.pi / cycles[top]))


def _of_lines_in_use(turned: np.ndarray, step: float) -> float:
    """The step between lines that hold points, where that is a multiple of `step` [rad].

    A step beyond the spectrum shows there by its half, third and so on, the largest within it.
    """
    if step < np.radians(0.45 * LARGEST_IN_SPECTRUM_DEG):
        return step
    phase = np.angle(np.exp(2j * np.pi * turned / step).mean()) / (2 * np.pi)
    line = np.rint(turned / step - phase).astype(np.int64)
    for multiple in range(int(np.radians(LARGEST_STEP_DEG) / step), 1, -1):
        held = np.bincount(line % multiple, minlength=multiple)
        used = np.unique(line[line % multiple == held.argmax()])
        if held.max() > 0.95 * len(line) and len(used) >= LEAST_LINES:
            return step * multiple
    return step


def find_zenith_step(zenith: np.ndarray, line: np.ndarray) -> float:
    """The step along lines of shots: the distance of most neighbours in a line [rad].

    Parameters
    ----------
    zenith : (n,) float64
        [rad]
    line : (n,) int64
        Line of each point, as of `find_azimuth_step`.
    """
    order = np.lexsort((zenith, line))
    apart = np.diff(zenith[order])[np.diff(line[order]) == 0]
    least, most = np.radians([SMALLEST_STEP_DEG / 2, LARGEST_STEP_DEG])
    apart = apart[(apart > least) & (apart <= most)]
    if not len(apart):
        return float("nan")
    count, edge = np.histogram(np.log(apart), bins=400, range=(np.log(least), np.log(most)))
    mode = np.exp(edge[int(np.argmax(count))])
    near = apart[(apart > 0.8 * mode) & (apart < 1.25 * mode)]
    return float(np.median(near))


def _span(turned: np.ndarray) -> float:
    """Width of the window that azimuths fill [rad]."""
    ordered = np.sort(turned[:: max(1, len(turned) // SUBSET)])
    gaps = np.diff(ordered, append=ordered[0] + 2 * np.pi)
    return float(2 * np.pi - gaps.max())
