"""From a cloud and a map of its crowns to facets: space, pulses, plant area, squares."""

from dataclasses import dataclass

import numpy as np
import pandas as pd

from dapple.cloud import ground, pulses
from dapple.errors import InputError
from dapple.formats.clouds import Cloud
from dapple.formats.meshes import Mesh
from dapple.formats.rasters import Raster
from dapple.structure import facets, filled_crowns, path_length


@dataclass(frozen=True)
class CrownScene:
    """What stands for the canopy of a plot.

    Attributes
    ----------
    leaves, wood : Mesh
        Square facets, local frame.
    table : DataFrame
        One row a part: `subcrown`, `crown`, `layer` (1 is the lowest), `volume_m3`,
        `plant_area_index` (of the sub-crown's area on the map), `plant_area_density_m2_m3`,
        `leaf_area_m2` (with wood: a pulse cannot tell), `n_facets` (of both), `known`
        (False: density of the neighbours).
    facts : dict
        Totals, and how pulses and their light were found.
    """

    leaves: Mesh
    wood: Mesh
    table: pd.DataFrame
    facts: dict


def fill(
    cloud: Cloud,
    labels: Raster,
    dem: Raster,
    *,
    n_layers: int,
    base_share: float,
    min_height_m: float,
    voxel_m: float,
    alpha_m: float,
    alpha_spacings: float,
    clumping_index: float,
    wood_share: float,
    facet_area_m2: float,
    pulse_options: dict,
    seed: int,
    where: str = "cloud",
) -> CrownScene:
    """Fill the crowns of a plot with facets of the plant area that the pulses met.

    Parameters
    ----------
    cloud : Cloud
        Local frame; see `pulses.assemble` for its attributes.
    labels, dem : Raster
        Bands "crown" and "sub_crown"; elevation of the ground.
    n_layers, base_share, min_height_m
        See `filled_crowns.Division`.
    voxel_m, alpha_m : float
        See `filled_crowns.enclose` [m].
    alpha_spacings : float
        The alpha shapes' radius is at least so many mean distances of the cloud's points.
    clumping_index : float
        Effective over true plant area within a part.
    wood_share : float
        Of the plant area.
    facet_area_m2 : float
    pulse_options : dict
        Keywords of `plant_area_density`.
    seed : int
    where : str
        File to name in errors.

    Raises
    ------
    InputError
        The crowns' points enclose no space.
    """
    division = filled_crowns.Division(
        labels,
        dem,
        cloud.origin_m,
        n_layers=n_layers,
        base_share=base_share,
        min_height_m=min_height_m,
    )
    sub, height_m = division.sub_and_height(cloud.xyz_m)
    division.learn_layers(sub, height_m)
    part = division.part(sub, height_m)
    alpha_m = max(alpha_m, alpha_spacings * ground.spacing_m(cloud.xyz_m))
    parts = filled_crowns.enclose(cloud.xyz_m, part, division, alpha_m=alpha_m, voxel_m=voxel_m)
    if not len(parts.volumes_m3):
        raise InputError(
            where,
            f"{(part >= 0).sum()} points in crowns, which enclose no space",
            "crowns of at least four points nearer than chlorophyll.crowns.alpha_m",
            "Raise alpha_m, or give a denser cloud.",
        )
    density, facts = plant_area_density(
        cloud, parts, part, height_m < min_height_m, division.n_parts, **pulse_options
    )
    table, volume = division.table(), parts.part_volume_m3
    filled = filled_crowns.fill_unknown(density / clumping_index, volume, table)
    counts = facets.numbers(filled * volume, facet_area_m2)
    leaves, wood = filled_crowns.facet_meshes(
        parts, counts, wood_share=wood_share, facet_area_m2=facet_area_m2,
        rng=np.random.default_rng(seed),
    )  # fmt: skip
    table = table.assign(
        volume_m3=volume,
        plant_area_index=filled * volume / np.repeat(division.area_m2(), n_layers),
        plant_area_density_m2_m3=filled,
        leaf_area_m2=filled * volume,
        n_facets=counts,
        known=np.isfinite(density),
    )
    above = (height_m >= min_height_m).sum()
    facts = _totals(table, division, dem) | facts | {"alpha_m": alpha_m}
    return CrownScene(
        leaves, wood, table, facts | {"returns_in_crowns_share": float((part >= 0).sum() / above)}
    )


def plant_area_density(
    cloud: Cloud,
    parts: filled_crowns.Parts,
    part: np.ndarray,
    is_ground: np.ndarray,
    n_parts: int,
    *,
    window_s: float,
    range_exponent: float,
    ground_to_canopy_intensity: float,
    projection: float,
    max_density_m2_m3: float,
) -> tuple[np.ndarray, dict]:
    """Density of each part by path lengths, and how the pulses were found.

    Parameters
    ----------
    cloud : Cloud
    parts : Parts
    part : (n,) int
        Part of each point, -1: none.
    is_ground : (n,) bool
    n_parts : int
    window_s, range_exponent, ground_to_canopy_intensity
        See `pulses.assemble` and `pulses.energies`; a ratio of 0 is found from the pulses.
    projection, max_density_m2_m3
        See `path_length.plant_area_density`.

    Returns
    -------
    density : (n_parts,) float64
        [m² m⁻³]; NaN where (nearly) no pulse entered.
    facts : dict
    """
    shots = pulses.assemble(cloud, window_s=window_s)
    share, facts = pulses.energies(
        shots,
        cloud.attributes.get("Intensity"),
        is_ground,
        range_exponent=range_exponent,
        ground_factor=ground_to_canopy_intensity or None,
    )
    places = cloud.xyz_m[shots.point]
    start = places[shots.first[:-1]]
    pulse = shots.pulse
    distance = ((places - start[pulse]) * shots.direction[pulse]).sum(axis=1)
    # Tetrahedra cross the limits of parts: a return counts for the part whose voxel holds it.
    own = parts.grid.at(places)
    own = np.where(own >= 0, own, part[shots.point])
    paths = path_length.trace(
        parts.grid, n_parts, start, shots.direction, shots.first, distance, share, own
    )
    density = path_length.plant_area_density(
        paths, projection=projection, max_density_m2_m3=max_density_m2_m3
    )
    volume = parts.part_volume_m3
    capped = volume[density >= max_density_m2_m3].sum() / volume.sum()
    unknown = volume[np.isnan(density)].sum() / volume.sum()
    return density, {
        "volume_capped_share": float(capped),
        "volume_unknown_share": float(unknown),
        "pulses": shots.facts | facts,
    }


def _totals(table: pd.DataFrame, division: filled_crowns.Division, dem: Raster) -> dict:
    ground_m2 = dem.values[0].size * dem.pixel_m**2
    return {
        "n_crowns": int(table.crown.nunique()),
        "n_subcrowns": division.n_sub,
        "n_parts": division.n_parts,
        "n_facets": int(table.n_facets.sum()),
        "leaf_area_m2": float(table.leaf_area_m2.sum()),
        "volume_m3": float(table.volume_m3.sum()),
        "ground_area_m2": float(ground_m2),
        "crown_area_m2": float(division.area_m2().sum()),
        "plant_area_index": float(table.leaf_area_m2.sum() / ground_m2),
    }
