"""Leaves as small discs on the surfaces that points lie on, as large as shots allow."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from dapple import findings
from dapple.errors import EmptyCloudError
from dapple.findings import Finding
from dapple.formats import meshes
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.structure import local_planes, shot_evidence

NEIGHBOURS = 30
"""Points around a point that its plane is fitted to, at most."""
LEAST_REACH_NOISES, LARGEST_REACH_M = 5.0, 0.05
"""Bounds of the distance within which a point's surface is looked for."""
RING = 6
"""The distance of so many neighbours on its surface tells how large a point's share of it is."""
AGREEMENT_NOISES = 2.0
"""Width of the agreement of points with a plane, in standard deviations of the noise."""
ON_SURFACE_NOISES = 2.0
"""Points this near to a plane, in the same, are on its surface."""
HIT_NOISES = 3.0
"""Returns this near to a disc, in the same, end at it."""
WIDTH = 0.5
"""Standard deviation of the distance within which shots tell of a disc, in its radii."""
BEAM_SHARE = 0.5
"""A target must reach this far into the beam to end it, as a share of the beam's radius."""
LARGEST = 1.5
"""Largest radius, in medians of all radii: points that stand alone say little of an area."""
EDGE_ON = 0.5
"""Largest cosine of incidence at which a scanner sees a surface edge on: 30° to it."""
MOST_EDGE_ON = 0.2
"""Share of the discs' area seen edge on above which leaves lie flat: 0.25 to 0.26 in six virtual
trees of planophile leaves, whose area came out 20 to 24 % too small, and at most 0.13 with other
leaf angles (`benchmarks/surfels.py --angles`)."""
SIDES = 4
"""Of the polygons that discs are drawn as, equal in area."""


def reconstruct(
    points_m: np.ndarray,
    shots: Iterable[Shots] | None,
    *,
    reach_spacings: float,
    noise_m: float,
    spacing_m: float,
    overlap: float,
    beam_diameter_m: float,
    beam_divergence_mrad: float,
    max_deviation: float,
    seed: int,
) -> tuple[Mesh, dict[str, Any]]:
    """Lay a disc on the local surface at each of the thinned points.

    Points are drawn onto planes that the points around them agree on, and thinned. A disc is as
    large as the point's share of the surface, times `overlap`. Where shots are known, its area is
    multiplied by the share of the shots around it that ended at it: what later returns and misses
    passed is open, and a beam that passed was clear of targets all across. Without shots the
    distance of points alone decides, and facts say so.

    Parameters
    ----------
    points_m : (n, 3) float64
        Leaf points in the local frame [m].
    shots : iterable of Shots or None
        The whole scan in the same frame, misses included.
    reach_spacings : float
        Farthest points that tell of a point's surface, in median distances of nearest points.
    noise_m : float
        Standard deviation of points across their surface [m].
    spacing_m : float
        Of the thinned points [m].
    overlap : float
        Area of a disc over the point's share of the surface: discs that leave no gaps overlap.
    beam_diameter_m : float
        Of the beam at the scanner [m].
    beam_divergence_mrad : float
        Full angle of the beam [mrad].
    max_deviation : float
        Returns at or above are mixed of several targets, and what is near them is not known.
    seed : int
        Turns the discs of points without a surface.

    Returns
    -------
    leaves : Mesh
        One element a disc.
    facts : dict
        `reach_m`, `point_spacing_m` (median, of the thinned points), `with_shots`,
        `without_surface` (share of discs whose direction is chance), `shots_per_disc` (sum of
        their weights), `hit_share` (means) and `edge_on_share` (of the discs' area, what every scan
        position sees edge on; all three None without shots).

    Raises
    ------
    EmptyCloudError
        No point at all.
    """
    points_m = np.ascontiguousarray(points_m, np.float64).reshape(-1, 3)
    if not len(points_m):
        raise EmptyCloudError(
            "surfels", "no leaf points in the cloud", "at least one", "Check the classes."
        )
    reach_m = _reach_m(points_m, reach_spacings, noise_m)
    normal, offset, support = local_planes.fit(
        points_m, NEIGHBOURS, reach_m, AGREEMENT_NOISES * noise_m
    )
    drawn_m = points_m + offset[:, None] * normal
    del points_m, offset  # of large clouds, arrays go when they are done with
    kept = _thinned(drawn_m, support, spacing_m)
    centre, normal, is_alone = drawn_m[kept], normal[kept], support[kept] == 0
    del drawn_m, support, kept
    chance = np.random.default_rng(seed).normal(size=(int(is_alone.sum()), 3))
    normal[is_alone] = chance / np.linalg.norm(chance, axis=1, keepdims=True)
    radius = _radius(centre, normal, reach_m, ON_SURFACE_NOISES * noise_m, spacing_m)
    radius *= np.sqrt(overlap)
    known = None if shots is None else shot_evidence.build(shots, max_deviation)
    facts = {
        "reach_m": reach_m,
        "point_spacing_m": float(np.median(radius) * np.sqrt(np.pi / overlap)),
        "with_shots": known is not None,
        "without_surface": float(is_alone.mean()),
        "shots_per_disc": None,
        "hit_share": None,
        "edge_on_share": None,
    }
    if known is not None:
        beam = np.array([beam_diameter_m, 1e-3 * beam_divergence_mrad]) * 0.5 * BEAM_SHARE
        share, weight = shot_evidence.hit_shares(
            known.arrays, centre, normal, WIDTH * radius, HIT_NOISES * noise_m, beam
        )
        share = np.where(np.isnan(share), 1.0, share)
        facts |= {"shots_per_disc": float(weight.mean()), "hit_share": float(share.mean())}
        radius *= np.sqrt(share)
        facts["edge_on_share"] = _edge_on_share(centre, normal, radius, known.position_m)
    discs = np.column_stack([radius, centre, normal])
    del centre, normal
    is_there = radius > 0
    return meshes.of_discs(discs if is_there.all() else discs[is_there], SIDES), facts


def doubts(facts: Mapping[str, Any], where: str | Path) -> list[Finding]:
    """A warning where leaves lie flat, so that scans from the ground miss a part of their area.

    Parameters
    ----------
    facts : mapping
        As of `reconstruct`.
    where : str or Path
        The cloud, for the message.
    """
    share = facts["edge_on_share"]
    if share is None or share < MOST_EDGE_ON:
        return []
    return [
        findings.warning(
            where,
            f"{share:.0%} of the surfels' area that every scan position sees at less than 30°",
            f"less than {MOST_EDGE_ON:.0%}: flat leaves that are seen edge on come out too small",
            "Take the leaf area of voxels, or scan from above as well.",
        )
    ]


def _edge_on_share(
    centre: np.ndarray, normal: np.ndarray, radius: np.ndarray, position_m: np.ndarray
) -> float:
    """Share of the area of discs that no scan position sees at more than 30° to its surface."""
    best = np.zeros(len(centre))
    for place_m in position_m:
        to = place_m - centre
        cosine = np.abs(np.einsum("nk,nk->n", to, normal)) / np.linalg.norm(to, axis=1)
        np.maximum(best, cosine, out=best)
    area = radius**2
    return float(area[best < EDGE_ON].sum() / max(area.sum(), 1e-300))


def _reach_m(points_m: np.ndarray, spacings: float, noise_m: float) -> float:
    """How far the surface of a point is looked for: farther than noise, not farther than leaves."""
    found = local_planes.neighbours(points_m, 1, LARGEST_REACH_M)
    usual_m = float(np.median(np.concatenate([nearest_m for *_, nearest_m in found])))
    return min(max(spacings * usual_m, LEAST_REACH_NOISES * noise_m), LARGEST_REACH_M)


def _thinned(points_m: np.ndarray, support: np.ndarray, spacing_m: float) -> np.ndarray:
    """Indices of the points of most support in each voxel, in their order."""
    voxel = np.floor(points_m / spacing_m).astype(np.int64)
    voxel -= voxel.min(axis=0)
    cell = np.ravel_multi_index(tuple(voxel.T), tuple(voxel.max(axis=0) + 1))
    order = np.argsort(-support, kind="stable")
    _, first = np.unique(cell[order], return_index=True)
    return np.sort(order[first])


def _radius(
    points_m: np.ndarray, normal: np.ndarray, reach_m: float, near_m: float, spacing_m: float
) -> np.ndarray:
    """Radius of the circle as large as each point's share of its surface [m]."""
    number, ring_m = np.empty(len(points_m), np.int64), np.empty(len(points_m))
    for piece, index, distance in local_planes.neighbours(points_m, 2 * RING, reach_m):
        found = index < len(points_m)
        to = points_m[np.where(found, index, 0)] - points_m[piece, None]
        on_surface = found & (np.abs(np.einsum("nkj,nj->nk", to, normal[piece])) < near_m)
        rank = np.cumsum(on_surface, axis=1)
        number[piece] = np.minimum(rank[:, -1], RING)
        at = np.argmax(rank >= np.maximum(number[piece], 1)[:, None], axis=1)
        ring_m[piece] = distance[np.arange(len(at)), at]
    # The circle through neighbour k holds the point, k - 1 neighbours and half of the last.
    radius = np.where(number > 0, ring_m / np.sqrt(number + 0.5), np.nan)
    usual = np.nanmedian(radius) if (number > 0).any() else spacing_m / np.sqrt(np.pi)
    return np.minimum(np.where(number == RING, radius, usual), LARGEST * usual)
