"""Configuration of the light engines, of advice and of the trade-off."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le

from dapple.config.base import Count, NotNegative, Positive, Section
from dapple.config.base import parameter as _


class Transport(Section):
    """The transport engine: paths traced once, for any sky, spectrum and time."""

    tolerance: Annotated[float, Gt(0), Le(1)] = _(
        0.005, "standard error that is asked for, as a share of open-sky PAR"
    )
    sky_rays: Count = _(8192, "rays of every sensor to the open sky, at first")
    paths: Count = _(4096, "scattered paths of every sensor, at first")
    max_growth: Annotated[float, Ge(1)] = _(
        64.0, "how many times more of both where the tolerance asks for them"
    )
    max_shadow_rays: Count = _(16_384, "most rays to the sun, per sensor and time")
    sky_patches: Literal[1, 145, 577, 2305] = _(577, "subdivision of the sky", "Reinhart")
    max_orders: Annotated[int, Ge(0), Le(255)] = _(12, "most surfaces on a path")
    sun_kernel_deg: Positive = _(
        8.0, "angle around the sun over which scattered paths are averaged"
    )


class Timestep(Section):
    """The per-timestep engine: Mitsuba's own integrators, the independent check."""

    step_min: Positive = _(10.0, "minutes between its times, a multiple of time.step_min")
    bands: Literal[1, 3] = _(3, "groups of bands, traced together")
    replicates: Annotated[int, Ge(2)] = _(16, "independent repetitions: the standard error")
    direct_rays: Count = _(64, "rays to the sun, per sensor, time and replicate")
    sky_rays: Count = _(64, "rays to the sky, likewise")
    scattered_rays: Count = _(32, "paths of scattered light, likewise")
    max_depth: Annotated[int, Ge(2), Le(100)] = _(12, "longest path in segments")


class Light(Section):
    """The light at the sensors."""

    engine: Literal["transport", "timestep"] = _("transport", "what computes light/*.nc")
    model: Literal["full", "advised"] = _(
        "full", "as these keys say, or the cheapest model within advice.tolerance"
    )
    check: bool = _(True, "compare the transport engine with the per-timestep engine")
    variant: Literal["llvm", "cuda"] = _("llvm", "Mitsuba on the processor or on an NVIDIA GPU")
    sun_diameter_deg: NotNegative = _(0.533, "angular diameter of the solar disc; 0: a point")
    aperture_m: NotNegative = _(0.0, "diameter of the sensors' receiving discs; 0: points")
    transport: Transport = Transport()
    timestep: Timestep = Timestep()


class Advice(Section):
    """What each refinement of the light changes and costs, measured on a pilot."""

    tolerance: Annotated[float, Gt(0), Le(1)] = _(
        0.02, "what may be left out in all: RMSE as a share of open-sky PAR"
    )
    sensors: Count = _(12, "sensors of the pilot")
    times: Count = _(9, "times of the pilot")
    paths: Count = _(16_384, "paths, and rays to the sky, of every sensor of the pilot")
    repeats: Count = _(3, "runs of every model, of which the shortest counts as its cost")
    polygon_sizes_m: tuple[Positive, ...] = _(
        (0.025, 0.05, 0.1, 0.2), "voxels of the polygons, the finest first"
    )
    voxel_sizes_m: tuple[Positive, ...] = _(
        (0.1, 0.2, 0.5, 1.0), "edges of the turbid voxels, the finest first"
    )


class Tradeoff(Section):
    """Accuracy against speed over a grid of settings."""

    sensors: Count = _(24, "sensors of every run")
    times: Count = _(21, "times of every run")
    repeats: Count = _(2, "runs of every setting, of which the shortest counts as its cost")
    paths: tuple[Count, ...] = _(
        (256, 1024, 4096, 16_384), "paths, and rays to the sky, of every sensor"
    )
    sky_patches: tuple[Literal[1, 145, 577, 2305], ...] = _(
        (1, 145, 577), "subdivisions of the sky"
    )
    max_orders: tuple[Annotated[int, Ge(0), Le(255)], ...] = _((0, 1, 2, 12), "most surfaces")
    polygon_sizes_m: tuple[Positive, ...] = _((0.025, 0.05, 0.1, 0.2), "voxels of the polygons")
    voxel_sizes_m: tuple[Positive, ...] = _((0.1, 0.2, 0.5, 1.0), "edges of the turbid voxels")
    timestep_rays: tuple[Count, ...] = _(
        (4, 16, 64), "rays of each kind, sensor, time and replicate of the per-timestep engine"
    )
