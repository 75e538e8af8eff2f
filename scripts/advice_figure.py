"""What each refinement of the light changes and saves, as a picture."""

from pathlib import Path

import yaml

from dapple.figures import effects_chart, style
from dapple.workflow import run


def main(snakemake):
    facts = yaml.safe_load(Path(snakemake.input.advice).read_text())
    style.save(effects_chart.draw(facts), snakemake.output.figure)


if __name__ == "__main__":
    run(main, snakemake)
