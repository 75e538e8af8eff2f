"""Light at the sensors of a scene that came as glTF and scene.json."""

from dapple.formats import tables
from dapple.light import exchange_light
from dapple.light.timestep import Rays
from dapple.scene import exchange_reading
from dapple.workflow import run


def main(snakemake):
    params = snakemake.params
    lit = exchange_reading.read(snakemake.input.scene)
    found = exchange_light.light(
        lit,
        Rays(**params.rays),
        sun_diameter_deg=params.sun_diameter_deg,
        variant=params.variant,
        response=params.response,
        seed=params.seed,
    )
    tables.write(snakemake.output.light, found)


if __name__ == "__main__":
    run(main, snakemake)
