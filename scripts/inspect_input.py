"""Look at all input before anything is computed."""

from dapple.check import page
from dapple.check.inspection import inspect
from dapple.formats import json
from dapple.formats.atomic import atomic
from dapple.workflow import options, run


def main(snakemake):
    settings, inputs = options(snakemake.params), snakemake.input
    files = {name: getattr(inputs, name) for name in ("cloud", "positions", "sensors")}
    check = inspect(settings, **files)
    json.write(snakemake.output.json, check)
    with atomic(snakemake.output.html) as partial:
        partial.write_text(page.page(json.read(snakemake.output.json)))


if __name__ == "__main__":
    run(main, snakemake)
