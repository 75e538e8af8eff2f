"""Fill the crowns of a plot with facets and lay the terrain under them."""

import numpy as np

from dapple.cloud import ground, pulses
from dapple.errors import InputError
from dapple.formats import clouds, json, meshes, rasters
from dapple.formats.atomic import atomic
from dapple.structure import facets, filled_crowns, path_length
from dapple.workflow import options, run


def main(snakemake):
    path, output, settings = snakemake.input.lidar, snakemake.output, options(snakemake.params)
    dem, labels = rasters.read(snakemake.input.dem), rasters.read(snakemake.input.crowns)
    cloud = ground.without_noise(clouds.read(path), path, **settings["noise"])
    division = filled_crowns.Division(labels, dem, cloud.origin_m, **settings["division"])
    sub, height_m = division.sub_and_height(cloud.xyz_m)
    division.learn_layers(sub, height_m)
    part = division.part(sub, height_m)
    spacing_m = ground.spacing_m(cloud.xyz_m)
    alpha_m = max(settings["alpha_m"], settings["alpha_spacings"] * spacing_m)
    parts = filled_crowns.enclose(
        cloud.xyz_m, part, division, alpha_m=alpha_m, voxel_m=settings["voxel_m"]
    )
    if not len(parts.volumes_m3):
        raise InputError(
            path,
            f"{(part >= 0).sum()} points in crowns, which enclose no space",
            "crowns of at least four points nearer than chlorophyll.crowns.alpha_m",
            "Raise alpha_m, or give a denser cloud.",
        )
    density, facts = plant_area_density(cloud, parts, part, height_m, division, settings)
    table = division.table()
    volume = parts.part_volume_m3
    known = np.isfinite(density)
    density = filled_crowns.fill_unknown(density / settings["clumping_index"], volume, table)
    area = density * volume
    counts = facets.numbers(area, settings["facet_area_m2"])
    rng = np.random.default_rng(settings["seed"])
    leaves = filled_crowns.facet_mesh(
        parts, counts, facet_area_m2=settings["facet_area_m2"], rng=rng
    )
    terrain = facets.terrain(
        dem.values[0] - cloud.origin_m[2],
        left_m=dem.left_m - cloud.origin_m[0],
        top_m=dem.top_m - cloud.origin_m[1],
        pixel_m=dem.pixel_m,
        step_m=settings["terrain_step_m"],
    )
    meshes.write_ply(output.leaves, leaves, cloud.origin_m)
    meshes.write_ply(output.terrain, terrain, cloud.origin_m)
    table = table.assign(
        volume_m3=volume,
        plant_area_index=area / np.repeat(division.area_m2(), division.n_layers),
        plant_area_density_m2_m3=density,
        leaf_area_m2=area,
        n_facets=counts,
        known=known,
    )
    with atomic(output.table) as partial:
        table.to_csv(partial, index=False, float_format="%.6g")
    ground_m2 = np.isfinite(dem.values[0]).sum() * dem.pixel_m**2
    summary = {
        "world_origin_m": cloud.origin_m,
        "crs": dem.crs,
        "n_crowns": int(table.crown.nunique()),
        "n_subcrowns": division.n_sub,
        "n_parts": division.n_parts,
        "n_facets": int(counts.sum()),
        "leaf_area_m2": float(area.sum()),
        "volume_m3": float(volume.sum()),
        "ground_area_m2": float(ground_m2),
        "crown_area_m2": float(division.area_m2().sum()),
        "plant_area_index": float(area.sum() / ground_m2),
        "alpha_m": alpha_m,
        "volume_unknown_share": float(volume[~known].sum() / volume.sum()),
        **facts,
    }
    json.write(output.summary, summary)
    print(summary)


def plant_area_density(cloud, parts, part, height_m, division, settings):
    """Density of each part by path lengths, and how the pulses were found."""
    shots = pulses.assemble(cloud, window_s=settings["window_s"])
    share, facts = pulses.energies(
        shots,
        cloud.attributes.get("Intensity"),
        height_m < division.min_height_m,
        range_exponent=settings["range_exponent"],
        ground_factor=settings["ground_to_canopy_intensity"] or None,
    )
    start = cloud.xyz_m[shots.point[shots.first[:-1]]]
    along = cloud.xyz_m[shots.point] - start[shots.pulse]
    distance = (along * shots.direction[shots.pulse]).sum(axis=1)
    # Tetrahedra cross the limits of parts: a return counts for the part whose voxel holds it.
    own = parts.grid.at(cloud.xyz_m[shots.point])
    paths = path_length.trace(
        parts.grid,
        division.n_parts,
        start,
        shots.direction,
        shots.first,
        distance,
        share,
        np.where(own >= 0, own, part[shots.point]),
    )
    density = path_length.plant_area_density(
        paths, projection=settings["projection"], max_density_m2_m3=settings["max_density_m2_m3"]
    )
    capped = density >= settings["max_density_m2_m3"]
    volume = parts.part_volume_m3
    facts = {
        "pulses": shots.facts | facts,
        "volume_capped_share": float(volume[capped].sum() / volume.sum()),
        "returns_in_crowns_share": float(
            (part >= 0).sum() / max((height_m >= division.min_height_m).sum(), 1)
        ),
    }
    return density, facts


if __name__ == "__main__":
    run(main, snakemake)
