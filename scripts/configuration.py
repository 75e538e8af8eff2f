"""Write the merged configuration of this run beside its results."""

import yaml

from dapple.formats.atomic import atomic
from dapple.workflow import run


def main(snakemake):
    with atomic(snakemake.output[0]) as partial:
        partial.write_text(yaml.safe_dump(dict(snakemake.params.settings), sort_keys=False))


if __name__ == "__main__":
    run(main, snakemake)
