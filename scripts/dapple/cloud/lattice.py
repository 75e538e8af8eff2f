"""The regular frame of directions in which a scanner fires, found back from its points.

A panorama scanner turns a mirror about a level axis (one line of shots, from zenith down) while its
head turns about the vertical (line after line). Seen from the points alone the lattice is bent: the
sight line is not square to the mirror's axis (collimation), the mirror's axis is not square to the
head's (trunnion), the head turns while a line is fired, the tilt is known to some hundredths of a
degree, and the origin to some millimetres. All of these are small and smooth, so they are fitted
together with the steps, and what remains are whole numbers: the line and the row of every shot.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numba import njit
from scipy.optimize import minimize

from dapple import frames

COORDINATE_NOISE_M = 5e-4
"""Scatter of a coordinate across the beam: half of the millimetre to which files round."""
SUBSET = 40_000
WORST_MEDIAN = 0.17
"""Points that do not fit a lattice at all have a median residual of 0.25 steps."""


@dataclass(frozen=True)
class ScanFrame:
    """The frame as the scanner's settings tell it; the fit refines it.

    Attributes
    ----------
    n_zenith, n_azimuth : int
        Shots in a line; lines.
    zenith_deg, azimuth_deg : (first, last)
        In the scanner's own frame: zenith from its z, azimuth counter-clockwise from its x [°].
    tilt_deg : (roll, pitch, yaw)
        Attitude of the scanner, see `frames.scanner_rotation` [°].
    """

    n_zenith: int
    n_azimuth: int
    zenith_deg: tuple[float, float]
    azimuth_deg: tuple[float, float]
    tilt_deg: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @cached_property
    def rotation(self) -> np.ndarray:
        """(3, 3), local = rotation @ scanner."""
        return frames.scanner_rotation(*self.tilt_deg)

    @property
    def zenith_step(self) -> float:
        """Between neighbouring shots of a line [rad]."""
        return np.radians(np.ptp(self.zenith_deg)) / (self.n_zenith - 1)

    @property
    def azimuth_step(self) -> float:
        """Between neighbouring lines [rad]."""
        return np.radians(np.ptp(self.azimuth_deg)) / (self.n_azimuth - 1)

    @property
    def full_circle(self) -> bool:
        return np.ptp(self.azimuth_deg) > 350


@dataclass(frozen=True)
class Lines:
    """Azimuth: which line each point belongs to (0 to n - 1) and how lines run."""

    coefficients: np.ndarray
    step: float
    first: int
    n: int
    line: np.ndarray
    residual: np.ndarray  # steps

    def azimuth(self, line: np.ndarray, zenith: np.ndarray) -> np.ndarray:
        """Azimuth of shots without parallax, in the scanner's frame [rad]."""
        azimuth = (line + self.first) * self.step
        for _ in range(4):  # the small terms depend on the azimuth itself
            bent = _azimuth_terms(zenith, azimuth, np.inf) @ self.coefficients
            azimuth = (line + self.first) * self.step + bent
        return azimuth


@dataclass(frozen=True)
class Rows:
    """Zenith: the position of each point along its line, in steps."""

    step: float
    bend: np.ndarray  # quadratic and cubic term [rad], then radial and vertical parallax [m]
    phase: np.ndarray  # of each line [steps]
    position: np.ndarray
    residual: np.ndarray  # steps

    def zenith(self, line: np.ndarray, row: np.ndarray) -> np.ndarray:
        """Zenith angle of shots without parallax, in the scanner's frame [rad]."""
        straight = (row + self.phase[line]) * self.step
        zenith = straight
        for _ in range(4):
            zenith = straight + _zenith_terms(zenith, np.inf) @ self.bend
        return zenith

    def position_of(self, zenith: float) -> float:
        """Where a zenith angle lies along a line of phase 0 [steps]."""
        return float((zenith - _zenith_terms(zenith, np.inf) @ self.bend) / self.step)


def spherical(xyz_m: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Zenith, azimuth (counter-clockwise from x) [rad] and range [m] in the scanner's frame."""
    x, y, z = xyz_m.T
    across = np.hypot(x, y)
    return np.arctan2(across, z), np.arctan2(y, x), np.hypot(across, z)


def _azimuth_terms(zenith: np.ndarray, azimuth: np.ndarray, range_m) -> np.ndarray:
    """(n, 10) how small errors of the axes and the origin shift the azimuth.

    Collimation 1/sin θ, trunnion cot θ, turn during a line θ - 90°, tilt cot θ (cos φ, sin φ),
    step φ, and parallax of an origin off by a millimetre in three ways.
    """
    sine = np.maximum(np.sin(zenith), 0.05)
    cot, near = np.cos(zenith) / sine, 1.0 / (range_m * sine)
    c, s = np.cos(azimuth), np.sin(azimuth)
    one, near = np.ones_like(sine), near * np.ones_like(sine)
    terms = (one, 1 / sine, cot, zenith - np.pi / 2, c * cot, s * cot, azimuth)
    return np.stack([*terms, near, -s * near, c * near], axis=1)


def _zenith_terms(zenith, range_m) -> np.ndarray:
    """(..., 4) how the zenith angle bends: quadratic, cubic, radial and vertical parallax."""
    level = np.asarray(zenith - np.pi / 2)
    radial, vertical = np.cos(zenith) / range_m, -np.sin(zenith) / range_m
    return np.stack([level * level, level * level * level, radial, vertical], axis=-1)


def _wrapped(steps: np.ndarray) -> np.ndarray:
    return (steps + 0.5) % 1.0 - 0.5


def _coherence(phase: np.ndarray, weight=None) -> float:
    """1 where all phases [steps] are alike, 0 where they are spread evenly."""
    return float(abs(np.average(np.exp(2j * np.pi * phase), weights=weight)))


def _spread(n: int, most: int = SUBSET) -> np.ndarray:
    """Evenly spread indices, so that the fit needs no random numbers."""
    return np.unique(np.linspace(0, n - 1, min(n, most)).astype(np.int64))


# --- lines ----------------------------------------------------------------------------------


def fit_lines(zenith: np.ndarray, azimuth: np.ndarray, range_m: np.ndarray, frame: ScanFrame):
    """Find the line of every point.

    Parameters
    ----------
    zenith, azimuth, range_m : (n,) float64
        In the scanner's frame [rad, rad, m].
    frame : ScanFrame

    Returns
    -------
    Lines
        With residuals in steps; the caller judges them.
    """
    step, start = frame.azimuth_step, np.radians(frame.azimuth_deg[0])
    margin = 0.0 if frame.full_circle else np.pi - np.radians(np.ptp(frame.azimuth_deg)) / 2
    azimuth = start - margin + (azimuth - start + margin) % (2 * np.pi)
    some = _spread(len(zenith))
    coefficients = _fit_azimuth(zenith[some], azimuth[some], range_m[some], step)
    position = np.empty(len(zenith))
    for at in range(0, len(zenith), 200_000):  # ten terms a point: not all at once
        part = slice(at, at + 200_000)
        terms = _azimuth_terms(zenith[part], azimuth[part], range_m[part])
        position[part] = (azimuth[part] - terms @ coefficients) / step
    turn = 2 * np.pi * (1 - coefficients[6]) / step if frame.full_circle else 0.0
    return _number_lines(position, turn, coefficients, step, frame.n_azimuth)


def _fit_azimuth(zenith, azimuth, range_m, step: float) -> np.ndarray:
    terms = _azimuth_terms(zenith, azimuth, range_m)
    # A millimetre at 2 m is a hundredth of a degree more than at 10 m.
    weight = 1 / np.hypot(COORDINATE_NOISE_M / (range_m * np.sin(zenith) + 1e-9), 1e-4)
    coefficients = _coarse_azimuth(terms, azimuth, weight, step)
    stages = [([0], 2), ([0, 6], 10), ([0, 4, 5, 6], 20), (range(7), 30), (range(10), 30)]
    for active, rounds in [*((list(a), n) for a, n in stages), (list(range(10)), 20)]:
        cut = 0.5 if len(active) < 10 else 0.25
        for _ in range(rounds):
            residual = _wrapped((azimuth - terms @ coefficients) / step) * step
            good = np.abs(residual) < cut * step
            part = terms[good][:, active] * weight[good, None]
            # A prior of a centimetre and of 1 % keeps parallax and step apart from collimation
            # where all ranges are alike. Sums by einsum: BLAS may depend on the threads.
            prior = np.array([1, 1, 1, 1, 1, 1, 1e-2, 1e-2, 1e-2, 1e-2])[active] ** -2.0
            normal = np.einsum("ni,nj->ij", part, part) + np.diag(prior)
            right = np.einsum("ni,n->i", part, residual[good] * weight[good])
            change = np.linalg.solve(normal, right - prior * coefficients[active])
            coefficients[active] += change
            if np.abs(change).max() < 1e-8:
                break
    return coefficients


def _coarse_azimuth(terms, azimuth, weight, step: float) -> np.ndarray:
    """Collimation and trunnion on a grid, then the step, until phases agree roughly."""
    some = _spread(len(azimuth), 8000)
    phase, weight = azimuth[some] / step, weight[some]
    best = (-1.0, 0.0, 0.0)
    for collimation in np.radians(np.arange(-2.5, 2.51, 0.1)):
        for trunnion in np.radians(np.arange(-2.5, 2.51, 0.25)):
            bent = terms[some, 1] * collimation + terms[some, 2] * trunnion
            agreement = _coherence(phase - bent / step, weight)
            # Straight lines win unless bent ones are clearly better.
            agreement -= 0.01 * (abs(collimation) + abs(trunnion)) / np.radians(2.5)
            best = max(best, (agreement, collimation, trunnion))
    coefficients = np.zeros(terms.shape[1])
    coefficients[1:3] = best[1:]
    phase = phase - terms[some, 1:3] @ coefficients[1:3] / step
    stretch = np.linspace(-2e-3, 2e-3, 41)
    by_stretch = [_coherence(phase - azimuth[some] * s / step, weight) for s in stretch]
    coefficients[6] = stretch[int(np.argmax(by_stretch))]
    phase = phase - azimuth[some] * coefficients[6] / step
    coefficients[0] = step * np.angle((weight * np.exp(2j * np.pi * phase)).sum()) / (2 * np.pi)
    return coefficients


def _number_lines(position, turn: float, coefficients, step: float, n: int) -> Lines:
    """Round to lines; at the seam of a full circle a point may be one turn on."""
    turns = np.array([0.0, turn, -turn]) if turn else np.zeros(1)
    number = np.rint(position).astype(np.int64)
    inside = np.abs(position - number) < 0.25
    low = int(number[inside].min()) if inside.any() else int(number.min())
    count = np.bincount(np.maximum(number[inside] - low, 0), minlength=n)
    total = np.concatenate([[0], np.cumsum(count)])
    first = low + int(np.argmax(total[n:] - total[:-n]))
    options = position[:, None] + turns
    numbers = np.clip(np.rint(options), first, first + n - 1)
    best = np.argmin(np.abs(options - numbers), axis=1)[:, None]
    chosen = np.take_along_axis(numbers, best, axis=1)[:, 0]
    residual = np.take_along_axis(options, best, axis=1)[:, 0] - chosen
    return Lines(coefficients, step, first, n, chosen.astype(np.int64) - first, residual)


# --- rows -----------------------------------------------------------------------------------


def fit_rows(zenith: np.ndarray, range_m: np.ndarray, lines: Lines, step: float) -> Rows:
    """Find the place of every point along its line.

    Every line starts at a phase of its own (the mirror is not locked to the head), so the step is
    what makes the phases within each line agree.

    Parameters
    ----------
    zenith, range_m : (n,) float64
        In the scanner's frame [rad, m].
    lines : Lines
    step : float
        Nominal step [rad]; the true one is looked for within 1.5 %.
    """
    groups = _well_filled_lines(lines.line, lines.n)
    some = np.concatenate(groups)
    which = np.repeat(np.arange(len(groups)), [len(group) for group in groups])
    weight = 1 / (0.1**2 + (COORDINATE_NOISE_M / (range_m[some] * step)) ** 2)
    total = np.bincount(which, weight)
    terms = _zenith_terms(zenith[some], range_m[some])

    def disagreement(guess: np.ndarray) -> float:
        straight = zenith[some] - terms @ (guess[1:] * 1e-2)
        angle = straight * (2 * np.pi / (step * (1 + guess[0] * 1e-2)))
        real = np.bincount(which, weight * np.cos(angle))
        sums = real + 1j * np.bincount(which, weight * np.sin(angle))
        return -float(np.mean(np.abs(sums) / total))

    stretches = np.arange(-1.5, 1.5001, 0.02)
    agreement = [disagreement(np.array([stretch, 0, 0, 0, 0])) for stretch in stretches]
    guess = np.array([stretches[int(np.argmin(agreement))], 0, 0, 0, 0])
    scale = np.array([0.02, 0.05, 0.05, 0.2, 0.2])
    for _ in range(3):
        simplex = np.vstack([guess, guess + np.diag(scale)])
        options = {"initial_simplex": simplex, "maxiter": 400, "xatol": 1e-4, "fatol": 1e-6}
        guess = minimize(disagreement, guess, method="Nelder-Mead", options=options).x
    return _place(zenith, range_m, lines, step * (1 + guess[0] * 1e-2), guess[1:] * 1e-2)


def _well_filled_lines(line: np.ndarray, n: int, lines: int = 20, points: int = 1000) -> list:
    """Indices of points of some lines with many of them, spread over the circle."""
    count = np.bincount(line, minlength=n)
    order = np.argsort(line, kind="stable")
    start = np.concatenate([[0], np.cumsum(count)])
    sectors = np.array_split(np.arange(n), min(lines, n))
    best = [int(sector[np.argmax(count[sector])]) for sector in sectors]
    groups = [order[start[k] : start[k + 1]] for k in best if count[k]]
    return [group[_spread(len(group), points)] for group in groups]


def _place(zenith, range_m, lines: Lines, step: float, bend: np.ndarray) -> Rows:
    straight = (zenith - _zenith_terms(zenith, range_m) @ bend) / step
    weight = 1 / (0.1**2 + (COORDINATE_NOISE_M / (range_m * step)) ** 2)
    angle = 2 * np.pi * straight
    real, imaginary = (
        np.bincount(lines.line, weight * wave(angle), lines.n) for wave in (np.cos, np.sin)
    )
    phase = np.arctan2(imaginary, real) / (2 * np.pi)
    position = straight - phase[lines.line]
    return Rows(step, bend, phase, position, _wrapped(position))


# --- shots ----------------------------------------------------------------------------------


@njit(cache=True)
def group_returns(line, n_returns, number, position, reach):  # pragma: no cover (compiled)
    """Give the returns of one shot one number; input sorted by line, n_returns and position.

    Returns belong together where line and count agree, the return numbers differ and the
    positions lie within `reach` steps.
    """
    shot = np.empty(len(line), np.int64)
    current, start, used = -1, -np.inf, 0
    for i in range(len(line)):
        bit = 1 << number[i]
        same = i > 0 and line[i] == line[i - 1] and n_returns[i] == n_returns[i - 1]
        if not (same and n_returns[i] > 1 and position[i] - start < reach and not used & bit):
            current, start, used = current + 1, position[i], 0
        used |= bit
        shot[i] = current
    return shot


@njit(cache=True)
def distinct_rows(line, position, weight):  # pragma: no cover (compiled)
    """Nearest whole numbers, each taken once in a line; input sorted by line and position.

    Rounding to millimetres moves near points by half a step, so that two shots may fall on one
    row. Weighted isotonic regression of position - rank moves them apart as little as possible.
    """
    n = len(line)
    row = np.empty(n, np.int64)
    mean, mass, size = np.empty(n), np.empty(n), np.empty(n, np.int64)
    begin = 0
    while begin < n:
        end = begin
        blocks = 0
        while end < n and line[end] == line[begin]:
            mean[blocks], mass[blocks] = position[end] - (end - begin), weight[end]
            size[blocks] = 1
            blocks += 1
            while blocks > 1 and mean[blocks - 2] >= mean[blocks - 1]:
                a, b = blocks - 2, blocks - 1
                both = mass[a] + mass[b]
                mean[a] = (mean[a] * mass[a] + mean[b] * mass[b]) / both
                mass[a] = both
                size[a] += size[b]
                blocks -= 1
            end += 1
        at = begin
        for k in range(blocks):
            level = int(np.floor(mean[k] + 0.5))
            for _ in range(size[k]):
                row[at] = level + (at - begin)
                at += 1
        begin = end
    return row
