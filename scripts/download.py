"""Take what storage has fetched into the folder of data."""

import shutil

from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    with atomic(snakemake.output.here) as partial:
        shutil.copyfile(snakemake.input.there, partial)


if __name__ == "__main__":
    run(main, snakemake)
