"""Print what was found in the input, and end with an error where a run would stop."""

import sys

from dapple import findings
from dapple.check import page
from dapple.findings import Finding
from dapple.formats import json
from dapple.workflow import run


def main(snakemake):
    check = json.read(snakemake.input.found)
    print(page.text(check), end="", file=sys.__stdout__, flush=True)
    findings.stop(Finding(**row) for row in check["findings"])


if __name__ == "__main__":
    run(main, snakemake)
