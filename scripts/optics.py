"""Spectra of leaf, bark and ground in the bands of PAR."""

from dapple import findings
from dapple.formats import json
from dapple.scene import scene_optics
from dapple.workflow import options, run


def main(snakemake):
    noticed: list[findings.Finding] = []
    spectra = scene_optics.from_spectra(**options(snakemake.params), noticed=noticed)
    scene_optics.write(snakemake.output.optics, spectra)
    findings.say(noticed)
    json.write(snakemake.output.facts, {"findings": findings.rows(noticed)})


if __name__ == "__main__":
    run(main, snakemake)
