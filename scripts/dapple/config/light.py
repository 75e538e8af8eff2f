"""The light at the sensors, and its two engines."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Le, Lt

from dapple.config.base import Count, NotNegative, Positive, Section, key
from dapple.sky.solar_disc import SUN_DIAMETER_DEG

Engine = Literal["transport", "timestep", "less"]


class Transport(Section):
    """The transport engine: paths traced once, for any sky, spectrum and time."""

    tolerance: Annotated[float, Gt(0), Le(1)] = key(
        0.005, "standard error that is asked for, as a share of open-sky PAR"
    )
    sky_rays: Count = key(8192, "rays of every sensor to the open sky, at first")
    paths: Count = key(4096, "scattered paths of every sensor, at first")
    max_growth: Annotated[float, Ge(1)] = key(
        64.0, "how many times more of both where the tolerance asks for them"
    )
    max_shadow_rays: Count = key(16_384, "most rays to the sun, per sensor and time")
    sky_patches: Literal[1, 145, 577, 2305] = key(577, "subdivision of the sky", "Reinhart")
    max_orders: Annotated[int, Ge(0), Le(255)] = key(12, "most surfaces on a path")
    sun_kernel_deg: Positive = key(
        8.0, "angle around the sun over which scattered paths are averaged"
    )


class Tiles(Section):
    """The transport engine over a wide scene: far from a sensor, few triangles stand for many."""

    size_m: NotNegative = key(0.0, "side of the tiles that are traced one by one; 0: no tiles")
    lowest_sun_deg: Annotated[float, Gt(0), Lt(90)] = key(
        10.0, "down to this height of the sun all that casts shadow into a tile is kept as it is"
    )
    far_triangle_m: Positive = key(
        0.5,
        "length of the triangles that stand for smaller ones farther away",
        "Cook et al. 2007",
    )


class Timestep(Section):
    """The per-timestep engine: Mitsuba's own integrators, the independent check."""

    step_min: Positive = key(30.0, "about so many minutes lie between the times that are checked")
    times_per_job: Count = key(60, "times that one job computes, in one file")
    bands: Literal[1, 3] = key(3, "groups of bands, traced together")
    replicates: Annotated[int, Ge(2)] = key(16, "independent repetitions: the standard error")
    direct_rays: Count = key(64, "rays to the sun, per sensor, time and replicate")
    sky_rays: Count = key(64, "rays to the sky, likewise")
    scattered_rays: Count = key(32, "paths of scattered light, likewise")
    max_depth: Annotated[int, Ge(2), Le(100)] = key(12, "longest path in segments")


class Less(Section):
    """The engine LESS 3: an independent program, in a process of its own."""

    rays: Annotated[int, Ge(64)] = key(
        12_800, "rays to the sky, per sensor and time, and as many to the sun", "Frey et al. 2025"
    )
    suns: Annotated[int, Ge(2)] = key(
        32, "parallel suns that stand for the solar disc, 64 rays to each"
    )
    bands: Literal[1, 3] = key(3, "groups of bands, in one run")
    voxel_sensors: Count = key(4, "voxels, as a check: so many sensors, evenly chosen (slow)")
    voxel_times: Count = key(2, "voxels, as a check: at so many of the times that are checked")


class Light(Section):
    """The light at the sensors."""

    engine: Engine = key("transport", "what computes light/*.nc")
    model: Literal["full", "advised"] = key(
        "full", "as these keys say, or the cheapest model within advice.tolerance"
    )
    check: bool = key(True, "compare the transport engine with the engines of check_with")
    check_with: tuple[Literal["timestep", "less"], ...] = key(
        ("timestep",), "Mitsuba's integrators (timestep), LESS 3 (less), or both"
    )
    variant: Literal["llvm", "cuda"] = key("llvm", "Mitsuba on the processor or on an NVIDIA GPU")
    sun_diameter_deg: NotNegative = key(
        SUN_DIAMETER_DEG, "angular diameter of the solar disc; 0: a point"
    )
    aperture_m: NotNegative = key(0.0, "diameter of the sensors' receiving discs; 0: points")
    sway_m: NotNegative = key(
        0.0, "standard deviation, east and north, by which leaves move within a record"
    )
    transport: Transport = Transport()
    tiles: Tiles = Tiles()
    timestep: Timestep = Timestep()
    less: Less = Less()

    @property
    def entrance_m(self) -> float:
        """Diameter of the disc over which light is averaged [m].

        A tree that sways above a sensor is a sensor that moves below the tree. An even disc four
        standard deviations wide has this standard deviation along each axis.
        """
        return math.hypot(self.aperture_m, 4 * self.sway_m)
