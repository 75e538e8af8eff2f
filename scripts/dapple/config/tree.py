"""Which tree of a plot is meant."""

from __future__ import annotations

from dapple.config.base import Count, NotNegative, Positive, Section, key


class Tree(Section):
    """The tree of a plot that is reconstructed (`source: cloud`); neither key: all is one plant."""

    id: Count | None = key(None, "number of its stem, as `snakemake check` lists them")
    at: tuple[float, float] | None = key(None, "instead: east and north of a place near its stem")
    neighbours_m: NotNegative = key(15.0, "trees nearer than this to its stem stay as shade")
    neighbour_voxel_m: Positive = key(0.2, "edge of the voxels of the neighbours' polygons")
