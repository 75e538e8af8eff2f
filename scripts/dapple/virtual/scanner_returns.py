"""From beams in a world to the returns that a scanner reports."""

from dataclasses import dataclass, fields

import numpy as np

from dapple.virtual.scanner_beam import beam_pattern, merge_hits, sub_rays
from dapple.virtual.scanner_model import Scanner
from dapple.virtual.scanner_world import KINDS, World, trace

NOISE = 7
"""Class code of returns without a target."""


@dataclass(frozen=True)
class Returns:
    """Returns in any order, one entry each.

    Attributes
    ----------
    shot : (m,) int64
        Number of the shot within its chunk.
    range_m, reflectance_db, deviation : (m,) float64
        As measured.
    truth : (m,) uint8
        Class code.
    """

    shot: np.ndarray
    range_m: np.ndarray
    reflectance_db: np.ndarray
    deviation: np.ndarray
    truth: np.ndarray

    def together_with(self, other: "Returns") -> "Returns":
        """These returns and then the others."""
        names = (field.name for field in fields(self))
        return Returns(*(np.concatenate([getattr(self, n), getattr(other, n)]) for n in names))

    def nearest_first(self, n_shots: int, max_returns: int) -> tuple["Returns", np.ndarray]:
        """Sort by shot and range, keep the nearest of each shot; also give `Shots.first`."""
        order = np.lexsort((self.range_m, self.shot))
        count = np.bincount(self.shot, minlength=n_shots)
        rank = np.arange(len(order)) - np.repeat(np.cumsum(count) - count, count)
        order = order[rank < max_returns]
        first = np.concatenate([[0], np.cumsum(np.minimum(count, max_returns), dtype=np.int64)])
        return Returns(*(getattr(self, field.name)[order] for field in fields(self))), first


def echoes(
    world: World,
    scanner: Scanner,
    origin_m: np.ndarray,
    direction: np.ndarray,
    rng: np.random.Generator,
    room: int,
) -> Returns:
    """Fire beams and report the echoes of what they meet.

    Parameters
    ----------
    origin_m, direction : (n, 3) float64
        Beam axes, local frame.
    rng : numpy.random.Generator
        Turns the beams' patterns and draws the noise.
    room : int
        Number of shots that the kernel is made for, at least n: a constant spares compiling.
    """
    n, pattern = len(direction), beam_pattern(scanner.sub_rays)
    rays = np.zeros((6, room * len(pattern)), np.float32)
    rays[5] = 1.0
    sub_rays(
        origin_m - world.shift_m,
        direction,
        2.0 * np.pi * rng.random(n),
        pattern,
        0.5 * scanner.exit_aperture_m,
        0.5e-3 * scanner.beam_divergence_mrad,
        rays,
    )
    hit_range, triangle = trace(world, rays, scanner.max_range_m)
    n_echoes, *found = merge_hits(
        hit_range.reshape(room, -1)[:n],
        triangle.reshape(room, -1)[:n],
        rays,
        world.normal,
        world.brightness,
        world.kind,
        scanner.incidence_exponent,
        scanner.min_range_m,
        scanner.min_separation_m,
        scanner.min_energy,
    )
    taken = np.arange(len(pattern)) < n_echoes[:, None]
    range_m, energy, spread_m, kind = (values[taken] for values in found)
    m = len(range_m)
    return Returns(
        np.repeat(np.arange(n), n_echoes),
        range_m + scanner.range_noise_m * rng.standard_normal(m),
        10.0 * np.log10(energy) + scanner.reflectance_noise_db * rng.standard_normal(m),
        pulse_shape_deviation(spread_m, scanner, rng),
        np.array(list(KINDS.values()), np.uint8)[kind],
    )


def pulse_shape_deviation(
    spread_m: np.ndarray, scanner: Scanner, rng: np.random.Generator
) -> np.ndarray:
    """Deviation of echoes from the shape of the pulse.

    A Gaussian pulse of standard deviation s that is widened by the variance v differs from its
    own shape, in the mean absolute sense, by 2 φ(1) v / s² of its area (first order in v, φ the
    normal density). Deviation is that share in thousandths, on top of the scanner's own. The
    scale is a choice: RIEGL's is not published, but 15, where Frey et al. (2025) cut, then
    means a spread of about 3 cm.

    Parameters
    ----------
    spread_m : (m,) float64
        Standard deviation of range inside each echo [m].

    Returns
    -------
    (m,) float64
        Whole numbers, as RIEGL reports them.
    """
    pulse_sd_m = scanner.pulse_length_m / np.sqrt(8.0 * np.log(2.0))
    widened = 2.0 * np.exp(-0.5) / np.sqrt(2.0 * np.pi) * (spread_m / pulse_sd_m) ** 2
    noise = scanner.clean_deviation_sd * rng.standard_normal(len(spread_m))
    return np.rint(np.abs(scanner.clean_deviation + noise) + 1000.0 * widened)


def false_echoes(leave_m: np.ndarray, scanner: Scanner, rng: np.random.Generator) -> Returns:
    """Returns without a target, evenly along the beam: weak and misshapen.

    Parameters
    ----------
    leave_m : (n,) float64
        Range at which each beam leaves the window [m].
    """
    shot = np.flatnonzero(rng.random(len(leave_m)) < scanner.noise_points_per_shot)
    m = len(shot)
    end_m = np.clip(leave_m[shot], scanner.min_range_m, scanner.max_range_m)
    mean, sd = scanner.noise_reflectance_db
    return Returns(
        shot,
        rng.uniform(scanner.min_range_m, end_m),
        mean + sd * rng.standard_normal(m),
        np.rint(scanner.noise_deviation * rng.standard_exponential(m)),
        np.full(m, NOISE, np.uint8),
    )
