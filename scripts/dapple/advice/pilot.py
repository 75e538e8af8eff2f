"""Light of a few sensors at a few times, and what it costs to compute."""

from dataclasses import dataclass, field

import numpy as np
import xarray as xr

from dapple import steps
from dapple.advice import costs
from dapple.advice.costs import PARTS, Cost, least, timed
from dapple.light.light_model import Model, Tracing
from dapple.light.series import Light
from dapple.scene.scene_optics import Optics
from dapple.scene.traced import TracedScene
from dapple.sky.open_sky import open_sky_par
from dapple.streams import stream_seed


@dataclass(frozen=True)
class Effect:
    """What one refinement changes and costs on the pilot.

    Attributes
    ----------
    refinement, level : str and its value
        A field of `Model`, or of geometry.
    rmse_rel, bias_rel : float
        Against the finest, of differences divided by open-sky PAR of their time.
    noise_rel : float
        Part of the RMSE that random numbers alone would make; 0 where both share them.
    parts : dict of str to Cost
        What each of `PARTS` cost in this very run.
    rmse_truth_rel, bias_truth_rel : float or None
        Against the light of the truth, where it is known.
    """

    refinement: str
    level: str | float
    rmse_rel: float
    bias_rel: float
    noise_rel: float
    parts: dict[str, Cost] = field(default_factory=dict)
    rmse_truth_rel: float | None = None
    bias_truth_rel: float | None = None

    @property
    def effect_rel(self) -> float:
        """RMSE without the noise."""
        return float(np.sqrt(max(self.rmse_rel**2 - self.noise_rel**2, 0.0)))

    @property
    def cost(self) -> Cost:
        """Of all parts together."""
        return sum(self.parts.values(), Cost())


def spread(n: int, count: int) -> np.ndarray:
    """Indices of `count` of n things, evenly spread; all of them where there are fewer."""
    if count >= n:
        return np.arange(n)
    return np.unique(np.linspace(0, n - 1, count + 2)[1:-1].round().astype(int))


def daylight_times(sky: xr.Dataset, count: int) -> np.ndarray:
    """Indices of `count` times of a sky at which there is light, evenly spread."""
    light = np.flatnonzero(open_sky_par(sky).to_numpy() > 0)
    return light[spread(len(light), count)]


def light_and_costs(
    scene: TracedScene,
    sensors_m: np.ndarray,
    sky: xr.Dataset,
    optics: Optics,
    model: Model,
    tracing: Tracing,
    *,
    facing: np.ndarray | None = None,
    seed: int,
) -> tuple[Light, dict[str, Cost]]:
    """Light of a scene by the transport engine, and the cost of each of its `PARTS`.

    The same seed gives models that share rays the same random numbers: what differs is the model.

    Parameters are those of `steps.sun` and `steps.products`.
    """
    sunlit, direct = timed(
        lambda: steps.sun(
            scene, sensors_m, sky, model, tracing, facing=facing, seed=stream_seed(seed, "sun")
        )
    )
    counted, paths = timed(
        lambda: steps.paths(
            scene, sensors_m, model, tracing, facing=facing, seed=stream_seed(seed, "paths")
        )
    )
    light, products = timed(
        lambda: steps.products(sunlit, counted, sky, optics, model, tracing, facing)
    )
    sizes = {"n_times": sky.sizes["time"], "n_bands": model.bands}
    counted_work = (
        direct.of(costs.work_of_sun(sunlit)),
        paths.of(costs.work_of_paths(counted)),
        products.of(costs.work_of_products(counted, **sizes)),
    )
    return light, dict(zip(PARTS, counted_work, strict=True))


class Pilot:
    """Light of a few sensors at a few times, each model computed as often as the clock needs.

    Parameters
    ----------
    sensors_m : (n, 3) float64
        Local frame [m].
    sky : xarray.Dataset
        Sun and sky at the times of the pilot, in daylight.
    optics : Optics
    finest : Model
        What all is compared with.
    tracing : Tracing
    repeats : int
        The shortest of so many runs is what a model costs: others share the machine.
    facing : (n, 3) float64 or None
        Unit normals of the sensors; None: they are level.
    seed : int
    """

    def __init__(
        self,
        sensors_m: np.ndarray,
        sky: xr.Dataset,
        optics: Optics,
        *,
        finest: Model,
        tracing: Tracing,
        repeats: int,
        facing: np.ndarray | None = None,
        seed: int,
    ):
        self.facing = facing
        self.sensors_m, self.sky, self.optics = sensors_m, sky, optics
        self.finest, self.tracing = finest, tracing
        self.repeats, self.seed = repeats, seed
        self.open_sky = open_sky_par(sky, tracing.response).to_numpy()

    def light(self, scene: TracedScene, model: Model) -> tuple[Light, dict[str, Cost]]:
        """Light of a model and its cost with kernels that are compiled already."""
        runs = [
            light_and_costs(
                scene,
                self.sensors_m,
                self.sky,
                self.optics,
                model,
                self.tracing,
                facing=self.facing,
                seed=self.seed,
            )
            # One more than asked for: the first may compile kernels.
            for _ in range(self.repeats + 1)
        ][1:]
        best = {part: least(parts[part] for _, parts in runs) for part in PARTS}
        return runs[-1][0], best

    def difference(self, one: Light, other: Light) -> tuple[float, float]:
        """RMSE and bias of the first against the second, on the scale of the open sky."""
        relative = (one.par - other.par) / self.open_sky
        return float(np.sqrt((relative**2).mean())), float(relative.mean())

    def noise(self, one: Light, other: Light) -> float:
        """RMSE that two lights of the same scene would have by their random numbers alone."""
        errors = np.hypot(one.standard_error, other.standard_error) / self.open_sky
        return float(np.sqrt((errors**2).mean()))

    def effect(
        self,
        refinement: str,
        level: str | float,
        found: tuple[Light, dict[str, Cost]],
        finest: Light,
        *,
        truth: Light | None,
        shared: bool,
    ) -> Effect:
        """Compare one light with the finest and with the truth."""
        result, parts = found
        against_truth = (None, None) if truth is None else self.difference(result, truth)
        noise = 0.0 if shared else self.noise(result, finest)
        return Effect(
            refinement, level, *self.difference(result, finest), noise, parts, *against_truth
        )
