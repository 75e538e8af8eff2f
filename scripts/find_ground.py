"""Find the ground under a cloud."""

from dapple.cloud import ground_finder
from dapple.formats import clouds, ground_surface, json
from dapple.workflow import run


def main(snakemake):
    cloud = clouds.read(snakemake.input.points)
    found = ground_finder.find(cloud, given_z_m=snakemake.params.ground_z_m)
    crs = json.read(snakemake.input.frame)["crs"]
    ground_surface.write(snakemake.output.ground, found, cloud.origin_m, crs)
    print(f"ground by {found.found_by}: {found.lowest_m:.2f} m and more, slope {found.slope:.3f}")


if __name__ == "__main__":
    run(main, snakemake)
