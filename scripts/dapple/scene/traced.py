"""A scene as rays see it: Mitsuba's meshes, an endless ground, turbid voxels."""

from types import ModuleType
from typing import Any

import drjit as dr
import mitsuba
import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.scene import turbid
from dapple.scene.counters import Counters
from dapple.scene.surfaces import Scene, Surface

RAY_OFFSET = 1e-6
"""How far a scattered ray starts from its surface, as a share of the scene's largest coordinate."""
LEAST_EXTENT_M = 10.0
LEAST_SLOPE = 1e-6
"""Of a ray in a repeated cell: a level one would go on for ever. One in a million is lost."""


class TracedScene:
    """What rays can meet; no dataclass, since Dr.Jit would make loop state of it.

    Attributes
    ----------
    variant : str
        Of Mitsuba.
    counters : Counters
        What paths count.
    meshes : mitsuba.Scene or None
        The surfaces of each plant as one mesh, which may stand in many places.
    triangles : Dr.Jit Float
        (4 * triangles,) unit normal and counter of reflections of each; places are shifts and do
        not turn them.
    first : Dr.Jit UInt32 or None
        Number of the first triangle of the plant of each of Mitsuba's instances; None: one plant.
    grid : TurbidVoxels or None
        Turbid voxels.
    of_voxels, of_ground, n_leaf : Dr.Jit UInt32
        Counters of reflections by voxels and ground; counters below `n_leaf` are those of leaves.
    ground_z, top_z, ray_offset : Dr.Jit Float
        Height of the ground, an endless plane, and of the highest plant; how far a scattered ray
        starts from its surface [m].
    cell : (low, high), Dr.Jit Point2f, or None
        The ground plan that is repeated sideways without end.
    """

    def __init__(
        self, variant: str, scene: Scene, meshes: tuple[Any, Any, Any], grid, box_m, cell_m
    ):
        self.variant, self.grid, self.counters = variant, grid, scene.counters
        mi = self.mi
        self.meshes, self.triangles, self.first = meshes
        # Opaque numbers stay out of the kernel's code: one kernel serves all scenes.
        leaves = self.counters.leaves
        self.of_voxels, self.of_ground, self.n_leaf = (
            dr.opaque(mi.UInt32, n)
            for n in (
                self.counters.reflected(scene.voxel_optics) if grid is not None else 0,
                self.counters.reflected(scene.ground_optics),
                2 * len(leaves),
            )
        )
        extent = max(LEAST_EXTENT_M, float(np.abs(box_m).max()))
        self.ground_z, self.top_z, self.ray_offset = (
            dr.opaque(mi.Float, value)
            for value in (scene.ground_z_m, box_m[1, 2], RAY_OFFSET * extent)
        )
        self.cell = None
        if cell_m is not None:
            self.cell = tuple(
                mi.Point2f(*(dr.opaque(mi.Float, float(x)) for x in corner)) for corner in cell_m
            )

    @property
    def mi(self) -> ModuleType:
        """Mitsuba in the variant of the scene, whatever was used in between."""
        if mitsuba.variant() != self.variant:
            engine.load(self.variant)
        return mitsuba

    @property
    def word(self) -> type:
        """Dr.Jit type of packed counts."""
        return self.mi.UInt32 if self.counters.word.itemsize == 4 else self.mi.UInt64

    @dr.syntax
    def segment(self, origin, direction, rng, active):
        """Follow rays to whatever they meet first.

        Returns
        -------
        point : Point3f
            Where the ray meets something; for a repeated scene that may be the side of the cell,
            and the point then lies on the side opposite.
        normal : Normal3f
            Of the leaf or surface, turned to where the ray comes from.
        counter : UInt32
            Of the surface's reflections; of a leaf's transmissions the next one.
        met, leaf, voxel, crossed : Bool
            Whether it is something, a leaf, a leaf in a voxel; or the side of the cell. None of
            these where the ray leaves the scene.
        """
        mi = self.mi
        ray = mi.Ray3f(origin, direction)
        side = self._to_side(origin, direction)
        ray.maxt = side
        if dr.hint(self.meshes is not None, mode="scalar"):
            found = self.meshes.ray_intersect_preliminary(ray, coherent=False, active=active)
            to_mesh = dr.select(found.is_valid(), found.t, dr.inf)
        else:
            found = dr.zeros(mi.PreliminaryIntersection3f)
            to_mesh = mi.Float(dr.inf)
        to_ground = dr.select(
            direction.z < 0, (self.ground_z - origin.z) / direction.z, mi.Float(dr.inf)
        )
        distance = dr.minimum(dr.minimum(to_mesh, to_ground), side)
        voxel = mi.Bool(False)
        if dr.hint(self.grid is not None, mode="scalar"):
            limit = -dr.log(1 - rng.next_float32())
            free = self.grid.march(origin, direction, distance, limit, active)[0]
            voxel = active & (free < distance)
            distance = dr.minimum(free, distance)
        found_any = active & (distance < dr.inf)
        mesh = found_any & ~voxel & (to_mesh <= distance)
        ground = found_any & ~voxel & ~mesh & (to_ground <= distance)
        crossed = found_any & ~voxel & ~mesh & ~ground

        normal, counter = mi.Normal3f(0, 0, 1), mi.UInt32(self.of_ground)
        if dr.hint(self.meshes is not None, mode="scalar"):
            triangle = mi.UInt32(found.prim_index)
            if dr.hint(self.first is not None, mode="scalar"):
                instance = dr.reinterpret_array(mi.UInt32, found.instance)
                triangle += dr.gather(mi.UInt32, self.first, instance, mesh)
            facts = dr.gather(mi.Vector4f, self.triangles, triangle, mesh)
            normal[mesh] = mi.Normal3f(facts.x, facts.y, facts.z)
            counter[mesh] = mi.UInt32(facts.w)
        if dr.hint(self.grid is not None, mode="scalar"):
            drawn = self.grid.leaf_normal(direction, rng, voxel)
            normal[voxel] = drawn
            counter[voxel] = self.of_voxels
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
        point = self._wrapped(origin + direction * distance, direction, crossed)
        met = voxel | mesh | ground
        leaf = met & (counter < self.n_leaf)
        return point, normal, counter, met, leaf, voxel, crossed

    @dr.syntax
    def meet(self, origin, direction, rng, active):
        """As `segment`, but across the sides of the cell: returns all but `crossed`."""
        mi = self.mi
        point, normal = mi.Point3f(origin), mi.Normal3f(0, 0, 1)
        counter = mi.UInt32(0)
        met, leaf, voxel = mi.Bool(False), mi.Bool(False), mi.Bool(False)
        going = mi.Bool(active)
        while going:
            end, facing, number, *kinds, crossed = self.segment(point, direction, rng, going)
            normal[going] = facing
            counter[going] = number
            met |= going & kinds[0]
            leaf |= going & kinds[1]
            voxel |= going & kinds[2]
            point[going] = end
            going &= crossed
        return point, normal, counter, met, leaf, voxel

    @dr.syntax
    def transmittance(self, origin, direction, active, coherent=True):
        """Share of light that gets through along rays to the sky; 0 where they are not active.

        `coherent` says that neighbouring rays start at neighbouring points: rays in bundles are
        fast for those and take twice the time of single rays for others.
        """
        mi = self.mi
        if dr.hint(self.cell is None, mode="scalar"):
            if dr.hint(self.meshes is not None, mode="scalar"):
                active &= ~self.meshes.ray_test(
                    mi.Ray3f(origin, direction), coherent=coherent, active=active
                )
            passed = mi.Float(1)
            if dr.hint(self.grid is not None, mode="scalar"):
                passed = self.grid.transmittance(origin, direction, mi.Float(dr.inf), active)
        else:
            passed = mi.Float(1)
            start, going = mi.Point3f(origin), mi.Bool(active)
            while going:
                side = self._to_side(start, direction)
                if dr.hint(self.meshes is not None, mode="scalar"):
                    ray = mi.Ray3f(start, direction)
                    ray.maxt = side
                    active &= ~(going & self.meshes.ray_test(ray, going))
                if dr.hint(self.grid is not None, mode="scalar"):
                    passed *= self.grid.transmittance(start, direction, side, going & active)
                going &= active & (side < dr.inf)
                start = self._wrapped(start + direction * side, direction, going)
        return dr.select(active, passed, 0)

    def _to_side(self, origin, direction):
        """Distance to the side of the cell; infinite where nothing but sky lies ahead."""
        if self.cell is None:
            return self.mi.Float(dr.inf)
        low, high = self.cell
        ends = [
            dr.select(d > 0, (b - x) / d, dr.select(d < 0, (a - x) / d, dr.inf))
            for a, b, x, d in (
                (low.x, high.x, origin.x, direction.x),
                (low.y, high.y, origin.y, direction.y),
            )
        ]
        # A ray that starts on a side and leaves the cell has gone round it by rounding: it crosses.
        side = dr.maximum(dr.minimum(*ends), 0)
        free = (direction.z > 0) & (origin.z > self.top_z)
        return dr.select(free | (dr.abs(direction.z) < LEAST_SLOPE), dr.inf, side)

    def _wrapped(self, point, direction, crossed):
        """Points on a side of the cell, put on the opposite side."""
        if self.cell is None:
            return point
        low, high = self.cell
        moved = self.mi.Point3f(point)
        for axis in "xy":
            a, b, x, d = (getattr(part, axis) for part in (low, high, point, direction))
            margin = (b - a) * 1e-6
            at_high = crossed & (d > 0) & (x >= b - margin)
            at_low = crossed & (d < 0) & (x <= a + margin)
            setattr(moved, axis, dr.select(at_high, a, dr.select(at_low, b, x)))
        return moved


def load(
    scene: Scene, variant: str = "llvm_ad_rgb", *, cell_m: np.ndarray | None = None
) -> TracedScene:
    """Hand the meshes to Mitsuba and the voxels to Dr.Jit.

    Parameters
    ----------
    scene : Scene
        What stands on the ground.
    variant : str
        Mitsuba variant, `llvm_ad_*` or `cuda_ad_*`.
    cell_m : (2, 2) float64 or None
        Low and high corner (x, y) of a ground plan that repeats sideways without end [m]. What
        reaches beyond one side comes in at the other.

    Raises
    ------
    InputError
        Terrain below the flat ground, wrong voxels, voxels wider than the cell, or one name of
        optics for leaves and for something opaque.
    """
    scene.check()
    mi = engine.load(variant)
    grid = turbid.load(mi, scene.voxels)
    cell = None if cell_m is None else np.asarray(cell_m, np.float64)
    _check_cell(grid, cell)
    boxes = [] if grid is None else [np.array([grid.low_m, grid.high_m])]
    meshes: tuple[Any, Any, Any] = (None, None, None)
    if together := scene.plants:
        meshes, box = _load_plants(mi, together, scene.counters, cell)
        boxes.append(box)
    boxes.append(np.full((2, 3), scene.ground_z_m))
    box = np.array([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])
    return TracedScene(variant, scene, meshes, grid, box, cell)


def _load_plants(
    mi: ModuleType,
    together: list[tuple[np.ndarray | None, list[Surface]]],
    counters: Counters,
    cell_m: np.ndarray | None,
):
    """Mitsuba's scene of plants, facts of all triangles, each instance's first one; and the box."""
    content, facts, boxes = {}, [], []
    n_triangles, firsts = 0, {}
    for number, (places_m, surfaces) in enumerate(together):
        name = f"plant_{number}"
        mesh, own = _merged(mi, surfaces, counters, name)
        vertices = np.concatenate([one.mesh.vertices_m for one in surfaces])
        box = np.array([vertices.min(axis=0), vertices.max(axis=0)])
        if places_m is None and cell_m is None:
            content[name] = mesh
        else:
            places_m = _with_copies(np.zeros((1, 3)) if places_m is None else places_m, box, cell_m)
            content |= instances(mi, name, {"mesh": mesh}, places_m)
            box = box + np.array([places_m.min(axis=0), places_m.max(axis=0)])
        boxes.append(box)
        facts.append(own)
        firsts[name] = n_triangles
        n_triangles += dr.width(own) // 4
    scene = mi.load_dict({"type": "scene", **content}, optimize=False)
    first = _first_triangles(mi, scene, firsts) if len(together) > 1 else None
    box = np.array([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])
    return (scene, dr.concat(facts), first), box


def _first_triangles(mi: ModuleType, scene, firsts: dict[str, int]):
    """By Mitsuba's number of an instance the first triangle of its plant; 0 is no instance."""
    numbers = {
        dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0]: shape.id().split(":")[0]
        for shape in scene.shapes()
        if ":" in shape.id()
    }
    table = np.zeros(max(numbers, default=0) + 1, np.uint32)
    for number, name in numbers.items():
        table[number] = firsts[name]
    return mi.UInt32(table)


def _check_cell(grid, cell: np.ndarray | None) -> None:
    if grid is None or cell is None:
        return
    tolerance = 1e-6 * np.abs(cell).max()
    if (grid.low_m[:2] < cell[0] - tolerance).any() or (
        grid.high_m[:2] > cell[1] + tolerance
    ).any():
        raise InputError(
            "cell_m",
            f"voxels from {grid.low_m[:2]} to {grid.high_m[:2]} m",
            f"voxels within the cell from {cell[0]} to {cell[1]} m",
            "Crop the voxels or widen the cell; only meshes are continued at the opposite side.",
        )


def _with_copies(places_m: np.ndarray, box_m: np.ndarray, cell_m: np.ndarray | None) -> np.ndarray:
    """Places, and those of neighbouring cells from where meshes reach into the cell."""
    places = np.asarray(places_m, np.float64)
    if cell_m is None:
        return places
    size = cell_m[1] - cell_m[0]
    reach = [int(np.ceil(np.ptp(box_m[:, k]) / size[k])) + 1 for k in range(2)]
    shifts = [
        (i * size[0], j * size[1], 0.0)
        for i in range(-reach[0], reach[0] + 1)
        for j in range(-reach[1], reach[1] + 1)
    ]
    every = (places[:, None] + np.array(shifts)).reshape(-1, 3)
    low, high = every[:, :2] + box_m[0, :2], every[:, :2] + box_m[1, :2]
    return every[((high > cell_m[0]) & (low < cell_m[1])).all(axis=1)]


def instances(mi: ModuleType, name: str, meshes: dict, places_m: np.ndarray) -> dict:
    """Mitsuba's dictionary of meshes that are stored once and stand at many places (k, 3) [m]."""
    content = {name: {"type": "shapegroup", **meshes}}
    for index, place in enumerate(places_m):
        content[f"{name}:{index}"] = {
            "type": "instance",
            "group": {"type": "ref", "id": name},
            "to_world": mi.ScalarTransform4f().translate(place.tolist()),
        }
    return content


def _merged(mi: ModuleType, surfaces: list[Surface], counters: Counters, name: str):
    """Meshes as one of Mitsuba's, and unit normal and counter of its triangles (4 * triangles,)."""
    meshes = [surface.mesh for surface in surfaces]
    first = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes])
    vertices = mi.Float(np.concatenate([m.vertices_m.astype(np.float32).ravel() for m in meshes]))
    faces = [
        (mesh.faces.astype(np.uint32) + np.uint32(shift)).ravel()
        for mesh, shift in zip(meshes, first[:-1], strict=True)
    ]
    faces = mi.UInt32(np.concatenate(faces))
    merged = mi.Mesh(name, int(first[-1]), dr.width(faces) // 3)
    parameters = mi.traverse(merged)
    parameters["vertex_positions"], parameters["faces"] = vertices, faces
    parameters.update()
    corner = dr.gather(mi.Vector3u, faces, dr.arange(mi.UInt32, dr.width(faces) // 3))
    a, b, c = (dr.gather(mi.Point3f, vertices, index) for index in corner)
    normal = dr.normalize(dr.cross(b - a, c - a))
    counter = np.repeat(
        np.array([counters.reflected(surface.optics) for surface in surfaces], np.float32),
        [len(mesh.faces) for mesh in meshes],
    )
    facts = dr.ravel(mi.Vector4f(normal.x, normal.y, normal.z, mi.Float(counter)))
    dr.eval(facts)
    return merged, facts
