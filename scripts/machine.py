"""How fast this machine is."""

from dapple.estimate import machine
from dapple.formats import json
from dapple.workflow import run


def main(snakemake):
    json.write(snakemake.output.speed, machine.measure())


if __name__ == "__main__":
    run(main, snakemake)
