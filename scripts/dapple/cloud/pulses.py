"""Pulses of an airborne laser from their returns: who belongs together, from where, how strong."""

from dataclasses import dataclass

import numpy as np

from dapple.formats.clouds import Cloud

MIN_LINES = 20
"""Pulses with several returns that a place of the sensor needs at least."""

MIN_SEPARATION_M = 1.0
"""Between first and last return: nearer ones do not show where a pulse came from."""

MOST_LINES = 500
"""Pulses with several returns that a window takes at most: more do not place it better."""


@dataclass(frozen=True)
class Pulses:
    """Returns ordered by pulse, near to far.

    Attributes
    ----------
    point : (m,) int64
        Index of each return in the cloud.
    first : (n + 1,) int64
        Returns of pulse i are `first[i]` to `first[i + 1] - 1`.
    direction : (n, 3) float64
        Unit vectors along which the light travels, local frame.
    range_m : (m,) float64 or None
        Distance from the sensor, NaN where that one's place is not known [m].
    facts : dict
        How pulses and directions were found, for a summary.
    """

    point: np.ndarray
    first: np.ndarray
    direction: np.ndarray
    range_m: np.ndarray | None
    facts: dict

    def __len__(self) -> int:
        return len(self.first) - 1

    @property
    def pulse(self) -> np.ndarray:
        """(m,) pulse of each return."""
        return np.repeat(np.arange(len(self)), np.diff(self.first))


def assemble(cloud: Cloud, *, window_s: float) -> Pulses:
    """Put the returns of a cloud together to pulses and find where each came from.

    Pulses are found by `GpsTime`, `PointSourceId` and `ReturnNumber`. Where several pulses share
    one time (a clock coarser than the laser) their order in the file tells them apart. Clouds of
    single returns, or without these fields, give one pulse a point.

    The sensor's path is where the lines through first and last returns meet (`trajectory`). Pulses
    of flight lines that do not show it come along their own returns, single ones from straight
    above.

    Parameters
    ----------
    cloud : Cloud
    window_s : float
        Time over which the sensor flies straight [s].

    Notes
    -----
    Only pulses all of whose returns are there are used, if they are half or more: where a file was
    clipped or thinned return by return, the rest would be taken for whole pulses.
    """
    point, first = group(cloud)
    facts: dict = {"n_returns": len(point), "n_pulses": len(first) - 1}
    number = cloud.attributes.get("NumberOfReturns")
    counts = np.diff(first)
    if counts.max() > 1 and number is not None:
        whole = counts == number[point[first[:-1]]]
        facts["whole_pulses_share"] = float(whole.mean())
        if whole.mean() >= 0.5:
            point = point[np.repeat(whole, counts)]
            counts = counts[whole]
            first = np.concatenate([[0], np.cumsum(counts)])
    facts["returns"] = "several" if counts.max() > 1 else "single"
    return _aim(cloud, point, first, window_s, facts)


def group(cloud: Cloud) -> tuple[np.ndarray, np.ndarray]:
    """Order of the returns by pulse, and where each pulse begins (see `Pulses`)."""
    fields = cloud.attributes
    number, time = fields.get("ReturnNumber"), fields.get("GpsTime")
    n = len(cloud)
    if number is None or time is None or number.max() <= 1:
        return np.arange(n), np.arange(n + 1)
    source = fields.get("PointSourceId", np.zeros(n, np.uint16))
    order = np.lexsort((number, time, source))
    same = _same(source[order], time[order])
    if (same & (number[order][1:] == number[order][:-1])).any():
        # Several pulses at one time: lexsort is stable, so that the file's order is kept.
        order = np.lexsort((time, source))
        same = _same(source[order], time[order]) & (number[order][1:] > number[order][:-1])
        if "NumberOfReturns" in fields:
            total = fields["NumberOfReturns"][order]
            same &= total[1:] == total[:-1]
    begins = np.flatnonzero(np.concatenate([[True], ~same]))
    return order, np.concatenate([begins, [n]])


def _same(source: np.ndarray, time: np.ndarray) -> np.ndarray:
    return (source[1:] == source[:-1]) & (time[1:] == time[:-1])


def _aim(cloud, point, first, window_s, facts) -> Pulses:
    """Directions of pulses whose returns are known."""
    start, end = cloud.xyz_m[point[first[:-1]]], cloud.xyz_m[point[first[1:] - 1]]
    direction = np.tile([0.0, 0.0, -1.0], (len(start), 1))
    along = end - start
    length = np.linalg.norm(along, axis=1)
    own = (length >= MIN_SEPARATION_M) & (along[:, 2] < 0)
    direction[own] = along[own] / length[own, None]
    range_m, placed = None, np.zeros(len(start), bool)
    if own.any() and "GpsTime" in cloud.attributes:
        lead = point[first[:-1]]
        time = cloud.attributes["GpsTime"][lead]
        source = cloud.attributes.get("PointSourceId", np.zeros(len(cloud), np.uint16))[lead]
        sensor = trajectory(start, along, own, time, source, window_s=window_s)
        placed = np.isfinite(sensor[:, 0])
        seen = start - sensor
        distance = np.linalg.norm(seen, axis=1)
        if placed.any():
            both = placed & own
            cosine = (direction[both] * seen[both]).sum(axis=1) / distance[both]
            facts["beam_deviation_deg"] = float(
                np.degrees(np.median(np.arccos(np.clip(cosine, -1, 1))))
            )
            facts["median_range_m"] = float(np.median(distance[placed]))
            direction[placed] = seen[placed] / distance[placed, None]
            pulse = np.repeat(np.arange(len(start)), np.diff(first))
            range_m = np.linalg.norm(cloud.xyz_m[point] - sensor[pulse], axis=1)
    facts["directions"] = {
        "from_sensor": float(placed.mean()),
        "from_returns": float((own & ~placed).mean()),
        "vertical": float((~own & ~placed).mean()),
    }
    return Pulses(point, first, direction, range_m, facts)


def trajectory(
    start_m: np.ndarray,
    along_m: np.ndarray,
    own: np.ndarray,
    time_s: np.ndarray,
    source: np.ndarray,
    *,
    window_s: float,
) -> np.ndarray:
    """Where the sensor was at each pulse: the place from which the pulses of a moment diverge.

    Parameters
    ----------
    start_m, along_m : (n, 3) float64
        First return of each pulse, and the way from there to the last [m].
    own : (n,) bool
        Pulses whose two returns lie far enough apart to show a direction.
    time_s : (n,) float64
        Time of each pulse [s].
    source : (n,)
        Flight line.
    window_s : float
        Time over which the sensor flies straight and at one speed [s].

    Returns
    -------
    (n, 3) float64
        NaN on flight lines too short, or too narrow, to tell.

    Notes
    -----
    Gatziolis and McGaughey (2019), Remote Sensing 11, 2389: least squares over lines through
    first and last returns. Here each window solves place and velocity at once.
    """
    sensor = np.full(start_m.shape, np.nan)
    for line in np.unique(source):
        on_line = source == line
        lines = np.flatnonzero(on_line & own)
        knots = _knots(start_m, along_m, time_s, lines, window_s)
        if knots is None:
            continue
        times, places = knots
        for axis in range(3):
            sensor[on_line, axis] = np.interp(time_s[on_line], times, places[:, axis])
    return sensor


def _knots(start_m, along_m, time_s, lines, window_s):
    """Times and places that the sensor passed, two for each window that shows them."""
    times, places = [], []
    if not len(lines):
        return None
    lines = lines[np.argsort(time_s[lines], kind="stable")]
    window = np.floor((time_s[lines] - time_s[lines[0]]) / window_s).astype(np.int64)
    for members in np.split(lines, np.flatnonzero(np.diff(window)) + 1):
        if len(members) < MIN_LINES:
            continue
        chosen = members[:: max(1, len(members) // MOST_LINES)]
        middle = 0.5 * (time_s[members[0]] + time_s[members[-1]])
        half = max(0.5 * (time_s[members[-1]] - time_s[members[0]]), 1e-9)
        found = _meet(start_m[chosen], along_m[chosen], (time_s[chosen] - middle) / half)
        if found is None:
            continue
        place, step = found
        times += [middle - half, middle + half]
        places += [place - step, place + step]
    return (np.array(times), np.array(places)) if times else None


def _meet(start_m, along_m, at) -> tuple[np.ndarray, np.ndarray] | None:
    """Place and step nearest to all lines, at + step·t, or None if they do not show it."""
    length = np.linalg.norm(along_m, axis=1)
    unit = along_m / length[:, None]
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]
    weight = length**2  # the farther apart its returns, the better a line's direction is known
    for _ in range(3):
        w = weight[:, None, None] * across
        t = at[:, None, None]
        normal = (
            np.block([[w.sum(0), (w * t).sum(0)], [(w * t).sum(0), (w * t * t).sum(0)]])
            / weight.sum()
        )
        target = np.einsum("ijk,ik->ij", w, start_m) / weight.sum()
        right = np.concatenate([target.sum(0), (target * at[:, None]).sum(0)])
        # Lines that hardly diverge meet anywhere: 1e-4 is a spread of about half a degree.
        if np.linalg.eigvalsh(normal[:3, :3])[0] < 1e-4:
            return None
        normal[3:, 3:] += 1e-9 * np.eye(3)
        solution = np.linalg.solve(normal, right)
        place, step = solution[:3], solution[3:]
        offset = np.einsum("ijk,ik->ij", across, start_m - place - at[:, None] * step)
        miss = np.linalg.norm(offset, axis=1) * length
        weight = length**2 * (miss <= 4 * max(np.median(miss), 1e-6))
    above = place[2] - np.abs(step[2]) > start_m[:, 2].max()
    return (place, step) if above else None


def energies(
    pulses: Pulses,
    intensity: np.ndarray | None,
    is_ground: np.ndarray,
    *,
    range_exponent: float,
    ground_factor: float | None,
) -> tuple[np.ndarray, dict]:
    """Share of each pulse's light that each return stopped.

    Ground and canopy differ in reflectance: a return's intensity over that of a whole pulse on
    the same surface is the share that it stopped. Of that only the ratio ground to canopy matters,
    because shares of a pulse add up to 1.

    Parameters
    ----------
    pulses : Pulses
    intensity : (n,) or None
        Of the cloud's points, linear in energy; None: returns of a pulse share evenly.
    is_ground : (n,) bool
    range_exponent : float
        Intensity falls with range to this power; 0 where the instrument corrects it.
    ground_factor : float or None
        Intensity of a pulse that only met ground over that of one that only met canopy; None
        finds it from pulses that met both, and from those that met ground alone.

    Returns
    -------
    share : (m,) float64
        In the order of `pulses.point`.
    facts : dict
        `ground_to_canopy_intensity` and where it comes from.

    Notes
    -----
    After Armston et al. (2013), Remote Sensing of Environment 134, 24-38: what a pulse's ground
    return lacks of a whole pulse's on bare ground, its canopy returns took. Over all pulses that
    met both, mean(canopy) / canopy₀ = 1 - mean(ground) / ground₀ gives canopy₀. Pulses with one
    return from the canopy would not do: part of their light went by and came back too weak.
    """
    n_of_pulse = np.diff(pulses.first)
    if intensity is None or not intensity.any():
        return np.repeat(1.0 / n_of_pulse, n_of_pulse), {"intensity": "none"}
    energy = np.maximum(intensity[pulses.point].astype(np.float64), 1e-9)
    if pulses.range_m is not None and range_exponent:
        far = pulses.range_m / np.nanmedian(pulses.range_m)
        energy *= np.where(np.isnan(far), 1.0, far) ** range_exponent
    ground = is_ground[pulses.point]
    facts: dict[str, str | float] = {"intensity": "configured ratio"}
    if ground_factor is None:
        ground_factor, facts["intensity"] = _ground_factor(energy, ground, pulses.first)
    facts["ground_to_canopy_intensity"] = ground_factor
    energy[ground] /= ground_factor
    total = np.add.reduceat(energy, pulses.first[:-1])
    return energy / np.repeat(total, n_of_pulse), facts


def _ground_factor(energy: np.ndarray, ground: np.ndarray, first: np.ndarray) -> tuple[float, str]:
    """Intensity of whole pulses on ground over that of whole pulses on canopy."""
    on_ground = np.add.reduceat(np.where(ground, energy, 0.0), first[:-1])
    on_canopy = np.add.reduceat(np.where(ground, 0.0, energy), first[:-1])
    alone, both = (on_canopy == 0), (on_canopy > 0) & (on_ground > 0)
    canopy_alone = on_ground == 0
    if alone.sum() < MIN_LINES or both.sum() + canopy_alone.sum() < MIN_LINES:
        return 1.0, "no ratio: taken as 1"
    whole = on_ground[alone].mean()
    if both.sum() >= MIN_LINES:
        taken = 1 - on_ground[both].mean() / whole
        if taken > 0:
            return float(whole * taken / on_canopy[both].mean()), "ratio of pulses that met both"
    return float(whole / on_canopy[canopy_alone].mean()), "ratio of pulses that met one"
