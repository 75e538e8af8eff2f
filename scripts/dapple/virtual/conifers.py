"""Virtual conifers: a stem, branches, twigs, and needles gathered in shoots."""

from dataclasses import dataclass

import numpy as np

from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.streams import stream_seed
from dapple.virtual.crown_outlines import area_m2, outline
from dapple.virtual.plant_skeleton import unit
from dapple.virtual.plant_tubes import Axes, tubes


@dataclass(frozen=True)
class Habit:
    """How a species builds its crown.

    Attributes
    ----------
    whorl_step_m : float
        Distance between whorls up the stem [m].
    whorl_scatter : float
        How far branches stray from their whorl, in steps; 0.5 leaves no whorl to see.
    branches_per_whorl : int
    taper : float
        Branches are as long as the crown's radius times (1 - t)^taper, t from 0 at the crown's
        base to 1 at the top.
    round_base : float
        Share of the crown's length over which branches grow to their full length from below.
    rise_base_deg, rise_top_deg : float
        Angle of branches above the horizontal where they leave the stem, at base and top.
    droop : float
        By this share of its length the tip of a branch hangs below the straight line.
    twig_step_m : float
        Distance between twigs along a branch [m].
    twig_share : float
        Length of the longest twig, as a share of its branch.
    twig_angle_deg : float
        Between twig and branch.
    twig_droop : float
        By this share of its length the tip of a twig hangs.
    bare_share : float
        Inner share of branches without twigs and needles.
    spread_deg : float
        Angle between a strip of needles and the axis of its shoot: 0 is a brush along the axis,
        60 a tuft.
    shoot_angle_deg : float
        Mean angle between shoot and twig.
    """

    whorl_step_m: float
    whorl_scatter: float
    branches_per_whorl: int
    taper: float
    round_base: float
    rise_base_deg: float
    rise_top_deg: float
    droop: float
    twig_step_m: float
    twig_share: float
    twig_angle_deg: float
    twig_droop: float
    bare_share: float
    spread_deg: float
    shoot_angle_deg: float


HABITS = {
    # Open crown without clear whorls, tufts of soft needles on short shoots (Larix).
    "larch": Habit(
        whorl_step_m=0.42,
        whorl_scatter=0.5,
        branches_per_whorl=4,
        taper=0.72,
        round_base=0.18,
        rise_base_deg=0.0,
        rise_top_deg=50.0,
        droop=0.18,
        twig_step_m=0.17,
        twig_share=0.36,
        twig_angle_deg=60.0,
        twig_droop=0.25,
        bare_share=0.22,
        spread_deg=55.0,
        shoot_angle_deg=50.0,
    ),
    # Dense cone with whorls, branches in flat sprays, needles all along the shoots (Picea).
    "spruce": Habit(
        whorl_step_m=0.38,
        whorl_scatter=0.12,
        branches_per_whorl=6,
        taper=0.95,
        round_base=0.06,
        rise_base_deg=-12.0,
        rise_top_deg=45.0,
        droop=0.10,
        twig_step_m=0.12,
        twig_share=0.42,
        twig_angle_deg=50.0,
        twig_droop=0.35,
        bare_share=0.15,
        spread_deg=12.0,
        shoot_angle_deg=30.0,
    ),
}
"""Plausible habits of both genera; not fitted to any tree."""


@dataclass(frozen=True)
class Conifer:
    """A tree on the origin of the local frame.

    Attributes
    ----------
    leaves : Mesh
        Strips of needles, two triangles each; one element a shoot. Areas are one-sided.
    wood : Mesh
        One element a segment of stem, branch or twig.
    """

    leaves: Mesh
    wood: Mesh

    @property
    def height_m(self) -> float:
        return float(max(self.leaves.vertices_m[:, 2].max(), self.wood.vertices_m[:, 2].max()))

    @property
    def crown_base_m(self) -> float:
        return float(self.leaves.vertices_m[:, 2].min())


def grow(
    species: str | Habit,
    *,
    height_m: float = 15.0,
    crown_radius_m: float = 2.5,
    crown_base_share: float = 0.3,
    dbh_m: float = 0.2,
    leaf_area_m2: float = 60.0,
    shoot_length_m: float = 0.16,
    strip_width_m: float = 0.02,
    strips_per_shoot: int = 4,
    seed: int,
) -> Conifer:
    """Grow a conifer.

    Parameters
    ----------
    species : str or Habit
        A key of `HABITS`, or another habit.
    height_m, crown_radius_m : float
        Height of the tip; radius of the circle as large as the crown's outline seen from above,
        met within a few percent [m].
    crown_base_share : float
        Height of the lowest branch as a share of the tree's.
    dbh_m : float
        Stem diameter at 1.3 m [m].
    leaf_area_m2 : float
        One-sided area of all needles, met to within half a shoot [m²].
    shoot_length_m, strip_width_m : float
        Size of the strips that stand for rows of needles [m].
    strips_per_shoot : int
        Strips around the axis of each shoot.
    seed : int
        Same seed, same tree.

    Raises
    ------
    InputError
        An unknown species, or a size that no tree can have.
    """
    if isinstance(species, str) and species not in HABITS:
        raise InputError("species", species, ", ".join(HABITS), "Name a conifer dapple can grow.")
    habit = HABITS[species] if isinstance(species, str) else species
    name = species if isinstance(species, str) else "of its own"
    _check(height_m, crown_radius_m, crown_base_share, dbh_m, leaf_area_m2)
    n_shoots = max(round(leaf_area_m2 / (strips_per_shoot * shoot_length_m * strip_width_m)), 1)
    wide_m = crown_radius_m
    for _ in range(4):  # branches and twigs as long as the outline asks
        # The same seed each time: only the width changes.
        rng = np.random.default_rng(stream_seed(seed, "conifer", name))
        tree = _grow(
            habit, height_m, crown_base_share * height_m, wide_m, dbh_m, n_shoots,
            (shoot_length_m, strip_width_m, strips_per_shoot), rng,
        )  # fmt: skip
        wide_m *= crown_radius_m / np.sqrt(area_m2(outline(tree.leaves.vertices_m)) / np.pi)
    return tree


def _grow(
    habit, height_m, base_m, radius_m, dbh_m, n_shoots, shoot: tuple[float, float, int], rng
) -> Conifer:
    stem = _stem(height_m, dbh_m, rng)
    branches = _branches(habit, stem, height_m, base_m, radius_m, rng)
    twigs = _twigs(habit, branches, rng)
    base, axis = _shoots(habit, branches, twigs, n_shoots, rng)
    leaves = _strips(base, axis, *shoot, habit.spread_deg, rng)
    return Conifer(leaves, tubes(_joined(stem, branches, twigs)))


@dataclass(frozen=True)
class _Lines:
    """Branches or twigs: n polylines of k points each, with a radius at every point."""

    xyz_m: np.ndarray
    radius_m: np.ndarray

    @property
    def length_m(self) -> np.ndarray:
        return np.linalg.norm(np.diff(self.xyz_m, axis=1), axis=2).sum(axis=1)

    def at(self, line: np.ndarray, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Points and unit directions at shares (0 to 1) of the length of lines."""
        n_segments = self.xyz_m.shape[1] - 1
        place = np.clip(share, 0.0, 1.0) * n_segments
        segment = np.minimum(place.astype(np.int64), n_segments - 1)
        begin, end = self.xyz_m[line, segment], self.xyz_m[line, segment + 1]
        part = (place - segment)[:, None]
        return begin + part * (end - begin), unit(end - begin)


def _stem(height_m: float, dbh_m: float, rng) -> _Lines:
    """A slightly crooked stem that tapers to its tip."""
    z = np.linspace(0.0, height_m, 13)
    lean = np.cumsum(rng.normal(0.0, 0.004 * height_m / 12, (13, 2)), axis=0) * (z > 0)[:, None]
    at_base = 0.5 * dbh_m / (1.0 - min(1.3, 0.5 * height_m) / height_m) ** 0.8
    radius = np.maximum(at_base * (1.0 - z / height_m) ** 0.8, 0.004)
    return _Lines(np.column_stack([lean, z])[None], radius[None])


def _branches(habit: Habit, stem: _Lines, height_m, base_m, radius_m, rng) -> _Lines:
    n_whorls = max(int((height_m - base_m - 0.25) / habit.whorl_step_m), 2)
    whorl = np.repeat(np.arange(n_whorls), habit.branches_per_whorl)
    n = len(whorl)
    stray = habit.whorl_scatter * rng.uniform(-1.0, 1.0, n)
    z = np.clip(base_m + (whorl + 0.5 + stray) * habit.whorl_step_m, base_m, height_m - 0.15)
    t = (z - base_m) / (height_m - base_m)
    # The golden angle turns successive branches about the stem without repeating.
    azimuth = np.arange(n) * np.pi * (3 - np.sqrt(5)) + rng.normal(0.0, 0.25, n)
    if habit.whorl_scatter < 0.3:
        azimuth = 2 * np.pi * np.arange(n) / habit.branches_per_whorl
        azimuth = azimuth + whorl * 0.9 + rng.normal(0.0, 0.15, n)
    shape = (1.0 - t) ** habit.taper * np.clip(0.6 + 0.4 * t / habit.round_base, 0.6, 1.0)
    # Reach is across; twigs at the tips add a little, so branches stop short of the radius.
    reach = np.maximum(0.93 * radius_m * shape * rng.uniform(0.75, 1.08, n), 0.12)
    rise = np.radians(habit.rise_base_deg + t * (habit.rise_top_deg - habit.rise_base_deg))
    rise = rise + rng.normal(0.0, np.radians(6.0), n)
    s = np.linspace(0.0, 1.0, 6)
    across = reach[:, None] * s
    # Branches sag, and their tips turn up again a little.
    up = across * np.tan(rise)[:, None] - reach[:, None] * habit.droop * (1.6 * s**2 - 0.6 * s**3)
    sway = azimuth[:, None] + 0.15 * rng.normal(0.0, 1.0, n)[:, None] * s
    begin, _ = stem.at(np.zeros(n, np.int64), z / height_m)
    offset = np.stack([across * np.sin(sway), across * np.cos(sway), up], axis=2)
    thick = 0.004 + 0.006 * reach
    return _Lines(begin[:, None] + offset, thick[:, None] * (1.0 - 0.8 * s))


def _twigs(habit: Habit, branches: _Lines, rng) -> _Lines:
    """Twigs left and right of every branch, in its plane, hanging a little."""
    length = branches.length_m
    count = np.maximum((length * (1 - habit.bare_share) / habit.twig_step_m).astype(np.int64), 2)
    line = np.repeat(np.arange(len(length)), count)
    rank = np.arange(len(line)) - np.repeat(np.cumsum(count) - count, count)
    even = (rank + rng.uniform(0.2, 0.8, len(line))) / count[line]
    share = habit.bare_share + (1 - habit.bare_share) * even
    begin, along = branches.at(line, share)
    aside = unit(np.cross(along, [0.0, 0.0, 1.0]) + 1e-9)
    aside *= np.where(rank % 2, 1.0, -1.0)[:, None]
    angle = np.radians(habit.twig_angle_deg) + rng.normal(0.0, np.radians(10.0), len(line))
    way = np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * aside
    # Longest below the middle, short again near the tip: a spray is lance-shaped.
    size = habit.twig_share * length[line] * np.minimum(1.0, 1.6 * (1.0 - share)) + 0.08
    size = size * rng.uniform(0.7, 1.15, len(line))
    s = np.linspace(0.0, 1.0, 3)[None, :, None]
    sag = np.zeros_like(way)
    sag[:, 2] = -habit.twig_droop
    xyz = begin[:, None] + size[:, None, None] * (s * way[:, None] + s**2 * sag[:, None])
    return _Lines(xyz, np.full(xyz.shape[:2], 0.0013))


def _shoots(habit: Habit, branches: _Lines, twigs: _Lines, n: int, rng):
    """Base and axis of shoots, evenly spread along twigs and the outer part of branches."""
    outer = branches.length_m * (1 - habit.bare_share)
    ends = np.cumsum(np.concatenate([twigs.length_m, outer]))
    place = (np.arange(n) + rng.uniform(0.0, 1.0, n)) / n * ends[-1]
    carrier = np.minimum(np.searchsorted(ends, place, side="right"), len(ends) - 1)
    begins = np.r_[0.0, ends[:-1]]
    share = (place - begins[carrier]) / (ends - begins)[carrier]
    on_twig = carrier < len(twigs.xyz_m)
    base, along = np.empty((n, 3)), np.empty((n, 3))
    base[on_twig], along[on_twig] = twigs.at(carrier[on_twig], share[on_twig])
    rest = carrier[~on_twig] - len(twigs.xyz_m)
    inner = habit.bare_share + (1 - habit.bare_share) * share[~on_twig]
    base[~on_twig], along[~on_twig] = branches.at(rest, inner)
    aside = unit(np.cross(along, rng.normal(size=(n, 3))))
    angle = np.radians(habit.shoot_angle_deg) * rng.uniform(0.3, 1.7, n)
    return base, np.cos(angle)[:, None] * along + np.sin(angle)[:, None] * aside


def _strips(base, axis, length_m, width_m, per_shoot, spread_deg, rng) -> Mesh:
    """Strips of needles around the axis of each shoot."""
    n = len(base)
    first = unit(np.cross(axis, rng.normal(size=(n, 3))))
    second = np.cross(axis, first)
    turn = rng.uniform(0, 2 * np.pi, (n, 1)) + 2 * np.pi * np.arange(per_shoot) / per_shoot
    turn = turn + rng.normal(0.0, 0.3, turn.shape)
    out = np.cos(turn)[..., None] * first[:, None] + np.sin(turn)[..., None] * second[:, None]
    spread = np.radians(spread_deg + rng.normal(0.0, 8.0, turn.shape))[..., None]
    axis = axis[:, None]
    along = np.cos(spread) * axis + np.sin(spread) * out
    # The strip's width lies between 'away from the axis' and 'around it', by chance.
    tilt = rng.uniform(0, np.pi, turn.shape)[..., None]
    across = np.cos(tilt) * unit(np.cos(spread) * out - np.sin(spread) * axis) + np.sin(
        tilt
    ) * np.cross(axis, out)
    across = unit(across - (across * along).sum(-1, keepdims=True) * along)
    begin = base[:, None] + 0.2 * width_m * out
    low, high = begin - 0.5 * width_m * across, begin + 0.5 * width_m * across
    far = length_m * along
    vertices = np.stack([low, high, high + far, low + far], axis=2).reshape(-1, 3)
    corner = 4 * np.arange(n * per_shoot)[:, None, None]
    faces = (corner + np.array([[0, 1, 2], [0, 2, 3]])).reshape(-1, 3)
    element = np.repeat(np.arange(n), 2 * per_shoot)
    return Mesh(vertices, faces.astype(np.int32), element.astype(np.int32))


def _joined(*lines: _Lines) -> Axes:
    xyz = [each.xyz_m.reshape(-1, 3) for each in lines]
    axis, count = [], 0
    for each in lines:
        n, k = each.radius_m.shape
        axis.append(count + np.repeat(np.arange(n), k))
        count += n
    radius = np.concatenate([each.radius_m.ravel() for each in lines])
    return Axes(np.concatenate(xyz), radius, np.concatenate(axis))


def _check(height_m, crown_radius_m, crown_base_share, dbh_m, leaf_area_m2) -> None:
    sizes = {
        "height_m": height_m,
        "crown_radius_m": crown_radius_m,
        "dbh_m": dbh_m,
        "leaf_area_m2": leaf_area_m2,
    }
    for name, size in sizes.items():
        if not (np.isfinite(size) and size > 0):
            raise InputError(name, f"{size:g}", "a number above 0", "Give the size of a tree.")
    if not 0 < crown_base_share < 0.9 or height_m < 1.5 or dbh_m > 0.2 * height_m:
        raise InputError(
            "crown_base_share",
            f"{crown_base_share:g} of {height_m:g} m, stem {dbh_m:g} m thick",
            "0 to 0.9 of a tree at least 1.5 m high and five times as high as thick",
            "Correct the sizes.",
        )
