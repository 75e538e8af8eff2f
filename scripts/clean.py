"""Filter noise and leave one point a voxel."""

from dapple.cloud.clean import clean
from dapple.formats import clouds, ground_surface, json
from dapple.workflow import options, run


def main(snakemake):
    inputs, settings = snakemake.input, options(snakemake.params)
    level = ground_surface.flat(settings.pop("ground_z_m"))
    ground = ground_surface.read(inputs.ground) if inputs.ground else level
    cloud, counts = clean(
        clouds.read(inputs.points), where=inputs.points, ground=ground, **settings
    )
    print(
        *(
            f"{step.replace('_', ' ')}: {n:,} points"
            for step, n in counts.items()
            if isinstance(n, int)
        ),
        sep="\n",
    )
    clouds.write(snakemake.output.cloud, cloud)
    json.write(snakemake.output.counts, counts)


if __name__ == "__main__":
    run(main, snakemake)
