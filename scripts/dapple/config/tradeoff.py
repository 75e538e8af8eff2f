"""Accuracy against speed."""

from __future__ import annotations

from typing import Annotated, Literal

from annotated_types import Ge, Le

from dapple.config.base import Count, Positive, Section, Some, key


class Tradeoff(Section):
    """Accuracy against speed over a grid of settings."""

    sensors: Count = key(24, "sensors of every run")
    times: Count = key(21, "times of every run")
    repeats: Count = key(2, "runs of every setting, of which the shortest counts as its cost")
    paths: Some[Count] = key(
        (256, 1024, 4096, 16_384), "paths, and rays to the sky, of every sensor"
    )
    sky_patches: Some[Literal[1, 145, 577, 2305]] = key((1, 145, 577), "subdivisions of the sky")
    max_orders: Some[Annotated[int, Ge(0), Le(255)]] = key((0, 1, 2, 12), "most surfaces")
    polygon_sizes_m: Some[Positive] = key((0.025, 0.05, 0.1, 0.2), "voxels of the polygons")
    voxel_sizes_m: Some[Positive] = key((0.1, 0.2, 0.5, 1.0), "edges of the turbid voxels")
    timestep_rays: Some[Count] = key(
        (4, 16, 64), "rays of each kind, sensor, time and replicate of the per-timestep engine"
    )
    less_rays: Some[Count] = key(
        (800, 12_800), "rays of each sensor and time of LESS 3, where it computes or checks light"
    )
