"""A scene as rays see it: Mitsuba's meshes, an endless ground, turbid voxels."""

from types import ModuleType

import drjit as dr
import mitsuba
import numpy as np

from dapple import engine
from dapple.errors import InputError
from dapple.formats.meshes import Mesh
from dapple.scene import turbid
from dapple.scene.surfaces import MESH_KINDS, Scene

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
    meshes : mitsuba.Scene or None
        Leaf, wood and terrain as one mesh, which may stand in many places.
    n_leaf, n_plant : Dr.Jit UInt32
        The mesh's first so many triangles are leaf, or leaf and wood; the others are terrain.
    normals : Dr.Jit Float
        (3 * triangles,) unit normals; places are shifts and do not turn them.
    grid : TurbidVoxels or None
        Turbid voxels.
    ground_z, top_z, ray_offset : Dr.Jit Float
        Height of the ground, an endless plane, and of the highest plant; how far a scattered ray
        starts from its surface [m].
    cell : (low, high), Dr.Jit Point2f, or None
        The ground plan that is repeated sideways without end.
    """

    def __init__(self, variant: str, meshes, grid, box_m, ground_z_m: float, cell_m):
        self.variant, self.grid = variant, grid
        mi = self.mi
        self.meshes, self.n_leaf, self.n_plant, self.normals = meshes or (None, None, None, None)
        extent = max(LEAST_EXTENT_M, float(np.abs(box_m).max()))
        # Opaque numbers stay out of the kernel's code: one kernel serves all scenes.
        self.ground_z, self.top_z, self.ray_offset = (
            dr.opaque(mi.Float, value) for value in (ground_z_m, box_m[1, 2], RAY_OFFSET * extent)
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
        leaf, voxel, bark, ground, crossed : Bool
            What it is (`voxel` is part of `leaf`); none of them where the ray leaves the scene.
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
        met = active & (distance < dr.inf)
        mesh = met & ~voxel & (to_mesh <= distance)
        ground = met & ~voxel & ~mesh & (to_ground <= distance)
        crossed = met & ~voxel & ~mesh & ~ground

        normal = mi.Normal3f(0, 0, 1)
        leaf, bark = mi.Bool(voxel), mi.Bool(False)
        if dr.hint(self.meshes is not None, mode="scalar"):
            leaf |= mesh & (found.prim_index < self.n_leaf)
            ground |= mesh & (found.prim_index >= self.n_plant)
            bark = mesh & ~leaf & ~ground
            normal[mesh] = dr.gather(mi.Normal3f, self.normals, found.prim_index, mesh)
        if dr.hint(self.grid is not None, mode="scalar"):
            drawn = self.grid.leaf_normal(direction, rng, voxel)
            normal[voxel] = drawn
        normal = dr.select(dr.dot(normal, direction) > 0, -normal, normal)
        point = self._wrapped(origin + direction * distance, direction, crossed)
        return point, normal, leaf, voxel, bark, ground, crossed

    @dr.syntax
    def meet(self, origin, direction, rng, active):
        """As `segment`, but across the sides of the cell: returns all but `crossed`."""
        mi = self.mi
        point, normal = mi.Point3f(origin), mi.Normal3f(0, 0, 1)
        leaf, voxel, bark, ground = mi.Bool(False), mi.Bool(False), mi.Bool(False), mi.Bool(False)
        going = mi.Bool(active)
        while going:
            end, facing, *kinds, crossed = self.segment(point, direction, rng, going)
            normal[going] = facing
            leaf |= going & kinds[0]
            voxel |= going & kinds[1]
            bark |= going & kinds[2]
            ground |= going & kinds[3]
            point[going] = end
            going &= crossed
        return point, normal, leaf, voxel, bark, ground

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
    scene: Scene,
    variant: str = "llvm_ad_rgb",
    *,
    places_m: np.ndarray | None = None,
    cell_m: np.ndarray | None = None,
) -> TracedScene:
    """Hand the meshes to Mitsuba and the voxels to Dr.Jit.

    Parameters
    ----------
    scene : Scene
        What stands on the ground.
    variant : str
        Mitsuba variant, `llvm_ad_*` or `cuda_ad_*`.
    places_m : (k, 3) float64 or None
        The meshes stand at these places, shifted from where they are, and are stored once [m].
    cell_m : (2, 2) float64 or None
        Low and high corner (x, y) of a ground plan that repeats sideways without end [m]. What
        reaches beyond one side comes in at the other.

    Raises
    ------
    InputError
        An unknown kind of mesh, terrain below the flat ground, wrong voxels, or voxels wider than
        the cell.
    """
    scene.check_kinds()
    mi = engine.load(variant)
    grid = turbid.load(mi, scene.voxels)
    cell = None if cell_m is None else np.asarray(cell_m, np.float64)
    _check_cell(grid, cell)
    filled = [scene.meshes[kind] for kind in MESH_KINDS if kind in scene.meshes]
    filled = [mesh for mesh in filled if len(mesh.faces)]
    boxes = [] if grid is None else [np.array([grid.low_m, grid.high_m])]
    meshes = None
    if filled:
        vertices = [mesh.vertices_m for mesh in filled]
        box = np.array(
            [np.min([v.min(0) for v in vertices], 0), np.max([v.max(0) for v in vertices], 0)]
        )
        mesh, normals = _merged(mi, filled)
        content = {"plant": mesh}
        if places_m is not None or cell is not None:
            places = _with_copies(np.zeros((1, 3)) if places_m is None else places_m, box, cell)
            content = _instances(mi, mesh, places)
            box = box + np.array([places.min(axis=0), places.max(axis=0)])
        boxes.append(box)
        loaded = mi.load_dict({"type": "scene", **content}, optimize=False)
        counts = [
            len(scene.meshes[kind].faces) if kind in scene.meshes else 0 for kind in MESH_KINDS
        ]
        ends = (dr.opaque(mi.UInt32, n) for n in (counts[0], counts[0] + counts[1]))
        meshes = loaded, *ends, normals
    boxes.append(np.full((2, 3), scene.ground_z_m))
    box = np.array([np.min(boxes, axis=(0, 1)), np.max(boxes, axis=(0, 1))])
    return TracedScene(variant, meshes, grid, box, scene.ground_z_m, cell)


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


def _instances(mi: ModuleType, mesh, places_m: np.ndarray) -> dict:
    content = {"plant": {"type": "shapegroup", "mesh": mesh}}
    for index, place in enumerate(places_m):
        content[f"plant_{index}"] = {
            "type": "instance",
            "group": {"type": "ref", "id": "plant"},
            "to_world": mi.ScalarTransform4f().translate(place.tolist()),
        }
    return content


def _merged(mi: ModuleType, meshes: list[Mesh]):
    """Meshes as one of Mitsuba's, in their order, and its unit normals (3 * triangles,)."""
    first = np.cumsum([0] + [len(mesh.vertices_m) for mesh in meshes])
    vertices = mi.Float(np.concatenate([m.vertices_m.astype(np.float32).ravel() for m in meshes]))
    faces = [
        (mesh.faces.astype(np.uint32) + np.uint32(shift)).ravel()
        for mesh, shift in zip(meshes, first[:-1], strict=True)
    ]
    faces = mi.UInt32(np.concatenate(faces))
    merged = mi.Mesh("plant", int(first[-1]), dr.width(faces) // 3)
    parameters = mi.traverse(merged)
    parameters["vertex_positions"], parameters["faces"] = vertices, faces
    parameters.update()
    corner = dr.gather(mi.Vector3u, faces, dr.arange(mi.UInt32, dr.width(faces) // 3))
    a, b, c = (dr.gather(mi.Point3f, vertices, index) for index in corner)
    normals = dr.ravel(dr.normalize(dr.cross(b - a, c - a)))
    dr.eval(normals)
    return merged, normals
