"""A run under disturbed conditions, in one process; what a stressor leaves alone is made once."""

import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr

from dapple import steps
from dapple.cloud.classify import classify
from dapple.cloud.clean import clean
from dapple.formats import shots as shot_files
from dapple.formats.clouds import WOOD, Cloud
from dapple.formats.ground_surface import flat
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.light import series
from dapple.light.light_model import Model, Tracing
from dapple.light.moved_sensors import sideways
from dapple.light.series import Light
from dapple.scene import scene_optics, traced
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import open_sky_par
from dapple.stability import structures, world
from dapple.stability.stressors import STAGES, UNDISTURBED, Conditions, key
from dapple.stability.structures import Structure
from dapple.stability.world import Setup
from dapple.streams import stream_seed
from dapple.structure.returns import Kinds


class Chain:
    """The stages of `dapple.steps` under changing conditions, and memory of what was made.

    Parameters
    ----------
    setup : Setup
        The configured run.
    seed : int
        Of the world and of everything that happens in it.
    """

    def __init__(self, setup: Setup, seed: int):
        self.setup, self.seed = setup, seed
        self.optics = scene_optics.from_spectra(**setup.optics)
        self._spent = 0.0
        self._made: dict[str, tuple[tuple, Any, float]] = {}
        self._given: dict[tuple[str, tuple], tuple[Any, float]] = {}

    # Memory ----------------------------------------------------------------------------------

    def give(self, step: str, conditions: Conditions, value: Any, seconds: float) -> None:
        """Hand over what a step made before, in `seconds`: `tree`, `shots` or `clean`."""
        self._given[step, self._key(step, conditions)] = value, seconds

    def took_s(self, step: str) -> float:
        """Seconds that the last making of a step took."""
        return self._made[step][2]

    def seconds_of(self, name: str) -> float:
        """Seconds that a reconstruction took from the points on, whenever its steps were made."""
        own = ("clean", "classes", "polygons", name.removesuffix("_corrected"), f"structure {name}")
        return sum(
            seconds
            for step, (_, _, seconds) in self._made.items()
            if step in own or step.split()[1:2] == [name]
        )

    def _key(self, step: str, conditions: Conditions) -> tuple:
        return key(conditions, STAGE_OF.get(step, STAGE_OF.get(step.split()[0], "structure")))

    def _step(self, step: str, conditions: Conditions, make: Callable[[], Any]) -> Any:
        """Make a result, or take the last one if it is of the same conditions; note its time."""
        at = self._key(step, conditions)
        if step in self._made and self._made[step][0] == at:
            return self._made[step][1]
        if (step, at) in self._given:
            value, seconds = self._given[step, at]
        else:
            inner, begun = self._spent, time.perf_counter()
            value = make()
            # Steps that were made on the way have noted their own time.
            seconds = time.perf_counter() - begun - (self._spent - inner)
            self._spent += seconds
        self._made[step] = (at, value, seconds)
        return value

    # Stages, in the order in which data flow --------------------------------------------------

    def tree(self, conditions: Conditions) -> dict[str, Mesh]:
        """The true leaves and wood."""
        return self._step("tree", conditions, lambda: world.grow(self.setup, conditions, self.seed))

    def shots(self, conditions: Conditions) -> Shots:
        """Every shot of the survey."""

        def make() -> Shots:
            return world.scan(self.setup, conditions, self.tree(conditions), self.seed)[0]

        return self._step("shots", conditions, make)

    def clean(self, conditions: Conditions) -> Cloud:
        """Points without noise, one a voxel."""

        def make() -> Cloud:
            cloud = shot_files.to_cloud(self.shots(conditions))
            drift = np.float32(conditions.drift_db)
            cloud.attributes["Reflectance"] = cloud.attributes["Reflectance"] + drift
            ground = flat(self.setup.ground_z_m)
            return clean(cloud, **self.setup.clean, ground=ground, where="scan")[0]

        return self._step("clean", conditions, make)

    def classes(self, conditions: Conditions) -> Cloud:
        """Points told apart, with `Classification`."""
        method = conditions.classifier or self.setup.classify["method"]
        return self._step("classes", conditions, lambda: self._classified(conditions, method))

    def classified(self, conditions: Conditions, method: str) -> Cloud:
        """Points told apart by some classifier that sees the whole tree."""
        seen = replace(conditions, has_stem=True)
        make = lambda: self._classified(seen, method)  # noqa: E731
        return self._step(f"classified {method}", conditions, make)

    def _classified(self, conditions: Conditions, method: str) -> Cloud:
        cloud = self.clean(conditions)
        settings = dict(self.setup.classify) | {"method": method, "seed": self.seed}
        if conditions.has_stem:
            return classify(cloud, **settings)[0]
        # A classifier that never saw the stem; all below the crown is wood.
        crown = cloud.xyz_m[:, 2] > self.setup.ground_z_m + self.setup.plant["crown_base_m"]
        kinds = np.full(len(cloud), WOOD, np.uint8)
        above = classify(cloud.select(crown), **settings)[0]
        kinds[crown] = above.attributes["Classification"]
        return Cloud(cloud.xyz_m, cloud.origin_m, cloud.attributes | {"Classification": kinds})

    def polygons(self, conditions: Conditions) -> dict[str, Mesh]:
        """Leaf and wood polygons."""

        def make() -> dict[str, Mesh]:
            settings = dict(self.setup.polygons) | {"voxel_size_m": self.polygon_size_m(conditions)}
            seed = stream_seed(self.seed, "polygons")
            return steps.polygons(self.classes(conditions), seed=seed, **settings)

        return self._step("polygons", conditions, make)

    def polygon_size_m(self, conditions: Conditions) -> float:
        """Edge of the voxels that polygons are made in [m]."""
        return self.setup.polygons["voxel_size_m"] * conditions.voxel_factor

    def surfels(self, conditions: Conditions) -> tuple[Mesh, dict[str, Any]]:
        """Leaves as discs on local surfaces, and what was found on the way."""

        def make() -> tuple[Mesh, dict[str, Any]]:
            seed = stream_seed(self.seed, "surfels")
            cloud, shots = self.classes(conditions), self.shots(conditions)
            return steps.surfels(cloud, shots, seed=seed, **self.setup.surfels)

        return self._step("surfels", conditions, make)

    def voxels(self, conditions: Conditions, size_m: float) -> xr.Dataset:
        """Plant area density in voxels of a configured size (before it is multiplied)."""

        def make() -> xr.Dataset:
            settings = dict(self.setup.voxels)
            if conditions.max_pad_m2_m3 is not None:
                settings["max_pad_m2_m3"] = conditions.max_pad_m2_m3
            return steps.voxels(
                self.shots(conditions),
                self.classes(conditions),
                size_m * conditions.voxel_factor,
                kinds=self.return_kinds(conditions),
                **settings,
            )

        return self._step(f"voxels_{size_m}", conditions, make)

    def return_kinds(self, conditions: Conditions) -> Kinds:
        """What each return is, by the classified points around it."""
        voxel_m = self.setup.classify["majority_voxel_m"]
        return steps.return_kinds(self.classes(conditions), voxel_m)

    def structure(self, name: str, conditions: Conditions) -> Structure:
        """What a reconstruction makes of the scan, or the truth itself."""
        make = lambda: structures.make(self, name, conditions)  # noqa: E731
        return self._step(f"structure {name}", conditions, make)

    def loaded(self, name: str, conditions: Conditions) -> list[TracedScene]:
        """Its scenes as rays meet them."""
        variant = self.setup.light["variant"]
        return [
            self._step(f"loaded {name} {k}", conditions, partial(traced.load, scene, variant))
            for k, scene in enumerate(self.structure(name, conditions).scenes)
        ]

    def light(self, name: str, conditions: Conditions) -> Light:
        """Light at the sensors; under the truth, of many times as many rays."""
        model = Model(**self.setup.light["model"])
        tracing = Tracing(**self.setup.light["tracing"])
        if name == "truth":
            conditions = true_conditions(conditions)
            tracing = tracing.finer(self.setup.light["truth_factor"])
        sensors_m, sky = self.sensors_m(conditions), self.sky(conditions)

        def under(number: int, scene: TracedScene) -> Light:
            """Light of one placement of the leaves."""
            seed = stream_seed(self.seed, "light", str(number))
            counted = self._step(
                f"paths {name} {number}",
                conditions,
                lambda: steps.paths(scene, sensors_m, model, tracing, seed=seed),
            )

            def make() -> Light:
                of_sun = stream_seed(seed, "sun")
                sunlit = steps.sun(scene, sensors_m, sky, model, tracing, seed=of_sun)
                return steps.products(sunlit, counted, sky, self.optics, model, tracing)

            return self._step(f"light {name} {number}", conditions, make)

        scenes = self.loaded(name, conditions)
        return series.mean([under(number, scene) for number, scene in enumerate(scenes)])

    # What shines on it ------------------------------------------------------------------------

    def sensors_m(self, conditions: Conditions) -> np.ndarray:
        """(s, 3) places of the sensors as the simulation has them [m]."""
        believed_m = world.sensors_m(self.setup, conditions)
        return sideways(believed_m, conditions.sensor_error_m, stream_seed(self.seed, "sensors"))

    def sky(self, conditions: Conditions) -> xr.Dataset:
        """Sun and sky as the simulation has them."""
        offset_min = conditions.clock_offset_min
        return self._step("sky", conditions, lambda: world.sky(self.setup, conditions, offset_min))

    def open_sky(self, conditions: Conditions) -> np.ndarray:
        """(t,) PAR without a tree, by the right clock [µmol m⁻² s⁻¹]."""
        response = Tracing(**self.setup.light["tracing"]).response
        return open_sky_par(self.sky(true_conditions(conditions)), response).to_numpy()


STAGE_OF = {
    "tree": "tree",
    "shots": "scan",
    "clean": "cloud",
    "classified": "cloud",
    "classes": "classes",
    "polygons": "structure",
    "structure": "structure",
    "loaded": "structure",
    "paths": "light",
    "light": "sky",
    "sky": "sky",
}
"""By which stage's conditions a step is known again; `structure` for what is not named."""


def true_conditions(conditions: Conditions) -> Conditions:
    """The conditions of the truth: its tree and its sky, nobody's errors."""
    names = (*STAGES["tree"], "sun_elevation_deg", "diffuse_share")
    return replace(UNDISTURBED, **{name: getattr(conditions, name) for name in names})
