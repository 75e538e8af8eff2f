"""One run under disturbed conditions: from the world to light, every method, in one process."""

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import xarray as xr

from dapple.cloud.classify import classify
from dapple.cloud.clean import clean
from dapple.cloud.scores import scores
from dapple.formats import shots as shot_files
from dapple.formats.clouds import LEAF, WOOD, Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.shots import Shots
from dapple.light import light_model, series, transport, visibility
from dapple.light.series import Light
from dapple.scene import scene_optics, traced
from dapple.stability import world
from dapple.stability.reconstructions import METHODS, Structure
from dapple.stability.stressors import STAGES, UNDISTURBED, Conditions, key
from dapple.stability.world import Setup
from dapple.streams import stream_seed
from dapple.structure.polygons import reconstruct
from dapple.structure.returns import kinds_by_place
from dapple.structure.voxels import Grid, plant_area_density
from dapple.verdict.inputs import no_mesh

SHIFT_M = 0.1
"""How far sensors are moved to see how sensitive their light is."""


class Chain:
    """The steps of a run on arrays; what a stressor does not touch is made once.

    Parameters
    ----------
    setup : Setup
        The configured run.
    seed : int
        Of the world and of everything that happens in it.
    """

    def __init__(self, setup: Setup, seed: int):
        self.setup, self.seed = setup, seed
        self.optics = scene_optics.from_spectra()
        self._spent = 0.0
        self._made: dict[str, tuple[tuple, Any, float]] = {}
        self._given: dict[tuple[str, tuple], tuple[Any, float]] = {}

    def give(self, step: str, conditions: Conditions, value: Any, seconds: float) -> None:
        """Hand over what a step made before, in `seconds`: `tree`, `shots` or `clean`."""
        self._given[step, self._key(step, conditions)] = value, seconds

    def took_s(self, step: str) -> float:
        """Seconds that the last making of a step took."""
        return self._made[step][2]

    def seconds_of(self, name: str) -> float:
        """Seconds that a method took from the points on, whenever its steps were made."""
        own = ("clean", "classes", "polygons", name.removesuffix("_corrected"), f"structure {name}")
        return sum(
            seconds
            for step, (_, _, seconds) in self._made.items()
            if step in own or step.split()[1:2] == [name]
        )

    # Steps, in the order in which data flow ------------------------------------------------

    def tree(self, conditions: Conditions) -> dict[str, Mesh]:
        """The true leaves and wood."""
        return self._step("tree", conditions, lambda: world.grow(self.setup, conditions, self.seed))

    def shots(self, conditions: Conditions) -> Shots:
        """Every shot of the survey."""
        return self._step(
            "shots",
            conditions,
            lambda: world.scan(self.setup, conditions, self.tree(conditions), self.seed)[0],
        )

    def clean(self, conditions: Conditions) -> Cloud:
        """Points without noise, one a voxel."""

        def make() -> Cloud:
            cloud = shot_files.to_cloud(self.shots(conditions))
            cloud.attributes["Reflectance"] = cloud.attributes["Reflectance"] + np.float32(
                conditions.drift_db
            )
            return clean(cloud, **self.setup.clean, ground_z_m=self.setup.ground_z_m)[0]

        return self._step("clean", conditions, make)

    def classes(self, conditions: Conditions) -> Cloud:
        """Points told apart, with `Classification`."""

        def make() -> Cloud:
            settings = dict(self.setup.classify)
            usual = settings.pop("method")
            return self._classified(conditions, conditions.classifier or usual)

        return self._step("classes", conditions, make)

    def classifiers(self, conditions: Conditions) -> dict[str, float]:
        """F1 of both classifiers, whichever is in use."""

        def make() -> dict[str, float]:
            found = {}
            for name, method in (("threshold", "reflectance"), ("geometry", "geometry")):
                f1 = f1_of(self._classified(replace(conditions, has_stem=True), method))
                found |= {f"{label}_{name}": value for label, value in f1.items()}
            return found

        return self._step("classifiers", conditions, make)

    def _classified(self, conditions: Conditions, method: str) -> Cloud:
        cloud, settings = self.clean(conditions), dict(self.setup.classify) | {"method": method}
        if conditions.has_stem:
            return classify(cloud, **settings, seed=self.seed)[0]
        # A classifier that never saw the stem; all below the crown is wood.
        crown = cloud.xyz_m[:, 2] > self.setup.ground_z_m + self.setup.plant["crown_base_m"]
        kinds = np.full(len(cloud), WOOD, np.uint8)
        above = classify(cloud.select(crown), **settings, seed=self.seed)[0]
        kinds[crown] = above.attributes["Classification"]
        return Cloud(cloud.xyz_m, cloud.origin_m, cloud.attributes | {"Classification": kinds})

    def polygons(self, conditions: Conditions) -> dict[str, Mesh]:
        """Leaf and wood polygons; no wood where no point is wood."""

        def make() -> dict[str, Mesh]:
            cloud = self.classes(conditions)
            kinds = cloud.attributes["Classification"]
            settings = dict(self.setup.polygons)
            settings["voxel_size_m"] *= conditions.voxel_factor
            seed = stream_seed(self.seed, "polygons")
            wood_m = cloud.xyz_m[kinds == WOOD]
            return {
                "leaf": reconstruct(cloud.xyz_m[kinds == LEAF], seed=seed, what="leaf", **settings),
                "wood": reconstruct(wood_m, seed=seed, what="wood", **settings)
                if len(wood_m)
                else no_mesh(),
            }

        return self._step("polygons", conditions, make)

    def voxels(self, conditions: Conditions, size_m: float) -> xr.Dataset:
        """Plant area density in voxels of a size (before it is multiplied)."""

        def make() -> xr.Dataset:
            cloud = self.classes(conditions)
            bounds_m = np.array([cloud.xyz_m.min(axis=0), cloud.xyz_m.max(axis=0)])
            settings = dict(self.setup.voxels)
            if conditions.max_pad_m2_m3 is not None:
                settings["max_pad_m2_m3"] = conditions.max_pad_m2_m3
            return plant_area_density(
                self.shots(conditions),
                Grid.around(bounds_m, size_m * conditions.voxel_factor),
                kinds=self.kinds(conditions),
                **settings,
            )

        return self._step(f"voxels_{size_m}", conditions, make)

    def kinds(self, conditions: Conditions) -> Callable[[Shots], np.ndarray]:
        """What each return is, by the classified points around it."""
        cloud = self.classes(conditions)
        return kinds_by_place(
            cloud.xyz_m,
            cloud.attributes["Classification"],
            voxel_size_m=self.setup.classify["majority_voxel_m"],
        )

    # Methods ---------------------------------------------------------------------------------

    def structure(self, name: str, conditions: Conditions) -> Structure:
        """What a method makes of the scan, or of the truth itself."""
        return self._step(f"structure {name}", conditions, lambda: METHODS[name](self, conditions))

    def light(self, name: str, conditions: Conditions) -> tuple[Light, Light]:
        """Light of a method, or of the truth, at the sensors; and at the sensors moved a little."""
        is_truth = name == "truth"
        if is_truth:
            conditions = true_conditions(conditions)
        structure = self.structure(name, conditions)
        sky, optics = self.sky(conditions)
        found = [
            self._lit(f"{name} {number}", scene, conditions, sky, optics, is_truth)
            for number, scene in enumerate(structure.scenes)
        ]
        n = len(self.sensors_m(conditions))
        return tuple(
            _mean([_rows(one, rows) for one in found]) for rows in (slice(n), slice(n, 2 * n))
        )

    def _lit(self, label, scene, conditions, sky, optics, is_truth) -> Light:
        settings = self.setup.light
        factor = settings["truth_factor"] if is_truth else 1
        seed = stream_seed(self.seed, "light", label.split()[1])
        loaded = self._step(
            f"loaded {label}", conditions, lambda: traced.load(scene, settings["variant"])
        )
        places = self.sensors_m(conditions)
        moved = world.misplaced(places, SHIFT_M, stream_seed(self.seed, "shift"))
        places = np.concatenate([places, moved])
        counted = self._step(
            f"paths {label}",
            conditions,
            lambda: transport.collect(
                loaded,
                places,
                n_sky_rays=settings["sky_rays"] * factor,
                n_paths=settings["paths"] * factor,
                n_patches=settings["sky_patches"],
                max_orders=settings["max_orders"],
                aperture_m=settings["aperture_m"],
                seed=seed,
            ),
        )

        def make() -> Light:
            seen = visibility.sunlit(
                loaded,
                places,
                series.towards_sun(sky),
                tolerance=series.DIRECT_SHARE * settings["tolerance"] / np.sqrt(factor),
                max_rays=settings["max_shadow_rays"] * factor,
                seed=stream_seed(seed, "sun"),
                sun_diameter_deg=settings["sun_diameter_deg"],
                aperture_m=settings["aperture_m"],
            )
            kernel = settings["sun_kernel_deg"]
            return series.compute(seen, counted, sky, optics, sun_kernel_deg=kernel)

        return self._step(f"lit {label}", conditions, make)

    def sensors_m(self, conditions: Conditions) -> np.ndarray:
        """(s, 3) places of the sensors as the simulation has them [m]."""
        seed = stream_seed(self.seed, "sensors")
        return world.misplaced(
            world.sensors_m(self.setup, conditions), conditions.sensor_error_m, seed
        )

    def sky(self, conditions: Conditions) -> tuple[xr.Dataset, Any]:
        """Sky and optics as the simulation has them, bands grouped."""

        def make():
            sky = world.sky(self.setup, conditions, conditions.clock_offset_min)
            model = light_model.Model(bands=self.setup.light["bands"])
            return light_model.simplified(sky, self.optics, model)

        return self._step("sky", conditions, make)

    def open_sky(self, conditions: Conditions) -> np.ndarray:
        """(t,) PAR without a tree, by the right clock [µmol m⁻² s⁻¹]."""
        return series.open_sky_par(self.sky(true_conditions(conditions))[0]).to_numpy()

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


STAGE_OF = {
    "tree": "tree",
    "shots": "scan",
    "clean": "cloud",
    "classifiers": "cloud",
    "classes": "classes",
    "polygons": "structure",
    "structure": "structure",
    "loaded": "structure",
    "paths": "light",
    "lit": "sky",
    "sky": "sky",
}
"""By which stage's conditions a step is known again; `structure` for what is not named."""


def f1_of(cloud: Cloud) -> dict[str, float]:
    """F1 of leaf and of wood against the truth that a virtual cloud carries."""
    found = scores(cloud.attributes["Classification"], cloud.attributes["TrueClass"])
    return {"f1_leaf": found["leaf"]["f1"], "f1_wood": found["wood"]["f1"]}


def _rows(light: Light, rows: slice) -> Light:
    return Light(
        **{n: getattr(light, n)[rows] for n in ("direct", "sky", "scattered", "standard_error")}
    )


def _mean(found: list[Light]) -> Light:
    """Mean of several placements; the standard error is that of their mean."""
    if len(found) == 1:
        return found[0]
    parts = {
        n: np.mean([getattr(one, n) for one in found], 0) for n in ("direct", "sky", "scattered")
    }
    error = np.std([one.par for one in found], axis=0, ddof=1) / np.sqrt(len(found))
    return Light(**parts, standard_error=error)


def true_conditions(conditions: Conditions) -> Conditions:
    """The conditions of the truth: its tree and its sky, nobody's errors."""
    names = (*STAGES["tree"], "sun_elevation_deg", "diffuse_share")
    return replace(UNDISTURBED, **{name: getattr(conditions, name) for name in names})
