"""Signals of a scan: what beams reached, how scans fit together, whether classes are distinct."""

import math

import numpy as np
import xarray as xr
from scipy.ndimage import gaussian_filter1d
from scipy.spatial import cKDTree

from dapple.formats.clouds import LEAF, Cloud
from dapple.formats.shots import Shots
from dapple.structure import occlusion
from dapple.structure.voxel_data import DENSITY

PATCH_M2 = 0.001
"""Projected patch of leaf whose chance of being met measures coverage: about 4 cm by 5 cm, seen
at the mean projection of one half."""


def scan_count(shots: Shots | None, cloud: Cloud) -> float:
    """Number of scan positions, from the shots or the points' own record; NaN where neither."""
    if shots is not None:
        return float(len(np.unique(shots.scan)))
    source = cloud.attributes.get("PointSourceId")
    if source is None or not source.any():
        return math.nan
    return float(len(np.unique(source)))


def largest_gap_deg(shots: Shots | None, cloud: Cloud) -> float:
    """Largest angle between neighbouring scan positions, seen from the middle of the points [°]."""
    if shots is None or not len(cloud):
        return math.nan
    at = np.unique(shots.scan, return_index=True)[1]
    beside = shots.origin_m[at, :2] - np.median(cloud.xyz_m[:, :2], axis=0)
    azimuth = np.sort(np.degrees(np.arctan2(beside[:, 0], beside[:, 1])))
    return float(np.diff(azimuth, append=azimuth[0] + 360).max())


def shots_per_voxel(voxels: xr.Dataset) -> float:
    """Shots that entered the worst twentieth of the leafy voxels."""
    number = voxels["n_shots"].transpose("x", "y", "z").to_numpy()[in_crown(voxels)]
    return float(np.quantile(number, 0.05)) if number.size else math.nan


def unknown_share(voxels: xr.Dataset) -> float:
    """Share of the crown's volume whose density is unknown."""
    inside = in_crown(voxels)
    unknown = np.isnan(voxels[DENSITY].transpose("x", "y", "z").to_numpy())
    return float(unknown[inside].mean()) if inside.any() else math.nan


def seen_share(voxels: xr.Dataset) -> float:
    """Mean over the crown of the chance that the scan meets a patch of leaf there."""
    coverage = occlusion.coverage_m_m3(voxels)[in_crown(voxels)]
    return float(-np.expm1(-coverage * PATCH_M2).mean()) if coverage.size else math.nan


def in_crown(voxels: xr.Dataset) -> np.ndarray:
    """(nx, ny, nz) True for leafy voxels and for unknown ones among them (`occlusion.in_crown`)."""
    return occlusion.in_crown(voxels[DENSITY].transpose("x", "y", "z").to_numpy())


def on_sun_beams(
    voxels: xr.Dataset,
    sensors_m: np.ndarray,
    sun_zenith_deg: np.ndarray,
    sun_azimuth_deg: np.ndarray,
    rng: np.random.Generator,
    *,
    max_beams: int = 1000,
) -> tuple[float, float]:
    """What beams from sensors to the sun cross inside the crown.

    Returns
    -------
    unknown : float
        Share of their way in the crown that lies in voxels of unknown density.
    seen : float
        Mean chance, over their way in the crown, that the scan meets a patch of leaf there,
        1 - exp(-coverage × patch).
    """
    size = float(voxels.attrs["voxel_size_m"])
    corner = np.array([float(voxels[a][0]) - size / 2 for a in "xyz"])
    inside = in_crown(voxels)
    shape = np.array(inside.shape)
    up = np.flatnonzero(sun_zenith_deg < 89)
    if not len(up) or not inside.any():
        return math.nan, math.nan
    zenith, azimuth = np.radians(sun_zenith_deg[up]), np.radians(sun_azimuth_deg[up])
    towards = np.stack(
        [np.sin(zenith) * np.sin(azimuth), np.sin(zenith) * np.cos(azimuth), np.cos(zenith)], 1
    )
    n = len(sensors_m) * len(up)
    pick = rng.choice(n, max_beams, replace=False) if n > max_beams else np.arange(n)
    origin, direction = sensors_m[pick // len(up)], towards[pick % len(up)]
    reach = float(np.linalg.norm(shape * size) + np.abs(origin - corner).max())
    step = max(size / 2, reach / 200)
    place = origin[:, None] + np.arange(0, reach, step)[:, None] * direction[:, None]
    index = np.floor((place.reshape(-1, 3) - corner) / size).astype(np.int64)
    index = index[((index >= 0) & (index < shape)).all(axis=1)]
    at = tuple(index[inside[tuple(index.T)]].T)
    if not len(at[0]):
        return math.nan, math.nan
    unknown = np.isnan(voxels[DENSITY].transpose("x", "y", "z").to_numpy()[at])
    coverage = occlusion.coverage_m_m3(voxels)[at]
    return float(unknown.mean()), float(-np.expm1(-coverage * PATCH_M2).mean())


def noise_share(
    shots: Shots | None, cloud: Cloud, rng: np.random.Generator, *, voxel_size_m: float = 0.05
) -> float:
    """Share of returns among the cleaned points that the noise filter took away.

    A return counts as taken away where its voxel holds no cleaned point.
    """
    if shots is None or not len(cloud) or not len(shots.range_m):
        return math.nan
    pick = _some(len(shots.range_m), 20_000, rng)
    shot = np.searchsorted(shots.first, pick, side="right") - 1
    place = shots.origin_m[shot] + shots.direction[shot] * shots.range_m[pick, None]
    low, high = cloud.xyz_m.min(axis=0), cloud.xyz_m.max(axis=0)
    place = place[((place >= low) & (place <= high)).all(axis=1)]
    if not len(place):
        return math.nan
    n = np.floor((high - low) / voxel_size_m).astype(np.int64) + 1

    def key(xyz: np.ndarray) -> np.ndarray:
        index = np.floor((xyz - low) / voxel_size_m).astype(np.int64)
        return (index[:, 0] * n[1] + index[:, 1]) * n[2] + index[:, 2]

    return float(1 - np.isin(key(place), key(cloud.xyz_m)).mean())


def scan_fit(
    cloud: Cloud, rng: np.random.Generator, *, points: int = 600, max_scans: int = 8
) -> tuple[float, float]:
    """How points of different scans lie to each other.

    Each scan slides over the others until its points are nearest to theirs (translation alone,
    the nearer two thirds of the pairs, six rounds; Chetverikov et al. 2002).

    Returns
    -------
    shift_m : float
        Root mean square over scans of how far each had to slide [m].
    residual_m : float
        Median distance between points of different scans after that [m].
    """
    source = cloud.attributes.get("PointSourceId")
    if source is None or len(cloud) < 100:
        return math.nan, math.nan
    scans, count = np.unique(source, return_counts=True)
    scans = scans[count > 50]
    if len(scans) < 2:
        return math.nan, math.nan
    pick = _some(len(cloud), 60_000, rng)
    xyz, source = cloud.xyz_m[pick], source[pick]
    shifts, residuals = [], []
    for scan in scans[:max_scans]:
        own = np.flatnonzero(source == scan)
        others = xyz[source != scan]
        if len(own) < 20 or len(others) < 20:
            continue
        moving = xyz[own[_some(len(own), points, rng)]].copy()
        tree = cKDTree(others, balanced_tree=False, compact_nodes=False)
        total = np.zeros(3)
        for _ in range(6):
            distance, near = tree.query(moving)
            good = distance <= np.quantile(distance, 2 / 3)
            move = (others[near] - moving)[good].mean(axis=0)
            moving += move
            total += move
        shifts.append((total**2).sum())
        residuals.append(np.median(tree.query(moving)[0]))
    if not shifts:
        return math.nan, math.nan
    return float(np.sqrt(np.mean(shifts))), float(np.median(residuals))


def reflectance_classes(cloud: Cloud, rng: np.random.Generator) -> dict[str, float]:
    """Whether reflectance has two classes, and whether the classes in use are these.

    Two normal distributions are fitted by expectation and maximisation.

    Returns
    -------
    dict
        `reflectance_separation`, Ashman's D of the two (Ashman et al. 1994: above 2 they are
        distinct); `reflectance_gain`, gain of the Bayesian information criterion of two over one
        normal distribution, per point; `reflectance_valley`, 1 less the density in the valley
        between the two peaks over that of the lower peak, 0 where there is one peak;
        `threshold_height`, how far above the highest peak the classes in use part, in standard
        deviations of the points above the peak; `class_contrast`, difference of the classes'
        mean reflectance over their spread.
    """
    names = ("separation", "gain", "valley")
    found = {f"reflectance_{name}": math.nan for name in names}
    found |= {"threshold_height": math.nan, "class_contrast": math.nan}
    values = cloud.attributes.get("Reflectance")
    if values is None or len(values) < 200 or not np.ptp(np.nan_to_num(values)) > 0:
        return found
    pick = _some(len(values), 20_000, rng)
    values = np.asarray(values[pick], np.float64)
    leaf = np.asarray(cloud.attributes["Classification"])[pick] == LEAF
    known = np.isfinite(values)
    values, leaf = values[known], leaf[known]
    mean, sd, gain = two_normals(values)
    found["reflectance_separation"] = float(math.sqrt(2) * (mean[1] - mean[0]) / np.hypot(*sd))
    found["reflectance_gain"] = gain
    found["reflectance_valley"] = valley_depth(values)
    if 20 < leaf.sum() < len(leaf) - 20:
        dark, bright = values[leaf], values[~leaf]
        spread = math.sqrt(0.5 * (dark.var() + bright.var()))
        found["class_contrast"] = float((bright.mean() - dark.mean()) / max(spread, 1e-6))
        x, smooth = _smooth(values)
        peak = x[np.argmax(smooth)]
        above = math.sqrt(((values[values > peak] - peak) ** 2).mean())
        found["threshold_height"] = float((_parting(values, leaf) - peak) / max(above, 1e-6))
    return found


def two_normals(values: np.ndarray, rounds: int = 60) -> tuple[np.ndarray, np.ndarray, float]:
    """Means and deviations of two normal distributions, and the gain in BIC a point.

    They are fitted to a histogram of 200 bins, which is quick and exact enough for decibels.
    """
    low, high = np.quantile(values, [0.001, 0.999])
    count, edges = np.histogram(values, 200, (low, high))
    x, weight = 0.5 * (edges[1:] + edges[:-1]), count / count.sum()
    mean = np.interp([0.15, 0.85], np.cumsum(weight), x)
    whole_sd = math.sqrt(weight @ (x - weight @ x) ** 2)
    sd, share = np.full(2, 0.5 * whole_sd), np.full(2, 0.5)
    for _ in range(rounds):
        joint = share[:, None] * _normal(x, mean[:, None], sd[:, None])
        belongs = weight * joint / np.maximum(joint.sum(axis=0), 1e-300)
        share = np.maximum(belongs.sum(axis=1), 1e-6)
        mean = belongs @ x / share
        variance = (belongs * (x - mean[:, None]) ** 2).sum(axis=1) / share
        sd = np.sqrt(np.maximum(variance, (0.02 * whole_sd) ** 2))
    two = np.log(
        np.maximum((share[:, None] * _normal(x, mean[:, None], sd[:, None])).sum(0), 1e-300)
    )
    one = np.log(np.maximum(_normal(x, weight @ x, whole_sd), 1e-300))
    order, n = np.argsort(mean), len(values)
    gain = 2 * float(weight @ (two - one)) - 3 * math.log(n) / n
    return mean[order], sd[order], gain


def valley_depth(values: np.ndarray) -> float:
    """How deep the valley between the two highest peaks is, 0 to 1; 0 where there is one peak."""
    smooth = _smooth(values)[1]
    inner = (smooth[1:-1] > smooth[:-2]) & (smooth[1:-1] >= smooth[2:])
    peaks = np.flatnonzero(inner) + 1
    if len(peaks) < 2:
        return 0.0
    first = peaks[np.argmax(smooth[peaks])]
    depths = [
        1 - smooth[min(first, k) : max(first, k) + 1].min() / smooth[k]
        for k in peaks
        if k != first and smooth[k] > 0.02 * smooth[first]
    ]
    return float(max(depths, default=0.0))


def _smooth(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Middles of 80 bins and the number of values in them, smoothed over 0.3 dB."""
    count, edges = np.histogram(values, 80, np.quantile(values, [0.002, 0.998]))
    width = max(0.3 / (edges[1] - edges[0]), 1.0)
    return 0.5 * (edges[1:] + edges[:-1]), gaussian_filter1d(count.astype(float), width)


def _parting(values: np.ndarray, leaf: np.ndarray) -> float:
    """The threshold that gives the classes in use with the fewest exceptions [dB]."""
    order = np.argsort(values)
    wrong = np.cumsum(np.where(leaf[order], -1, 1))
    return float(values[order][np.argmin(wrong)])


def _normal(x: np.ndarray, mean: np.ndarray | float, sd: np.ndarray | float) -> np.ndarray:
    return np.exp(-0.5 * ((x - mean) / sd) ** 2) / (sd * math.sqrt(2 * math.pi))


def _some(n: int, most: int, rng: np.random.Generator) -> np.ndarray:
    """Indices of all of n, or of `most` of them by chance in ascending order."""
    return np.arange(n) if n <= most else np.sort(rng.choice(n, most, replace=False, shuffle=False))
