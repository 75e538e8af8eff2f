"""How a run was computed, in sentences that can stand in a paper, with what they cite."""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import yaml

from dapple.report.blocks import Block, Code, Listing, Text
from dapple.report.recommendation import called
from dapple.report.references import REFERENCES, Reference

SOURCES = {
    "virtual": "A virtual tree was grown and scanned by a simulated laser scanner, so that the "
    "truth is known.",
    "wood": "Virtual leaves were placed by chance along measured wood.",
    "cloud": "The point cloud of a laser scan was cleaned, and its points were told apart as leaf "
    "or wood.",
}
SKIES = {"perez": "Its distribution over the sky is that of {perez1993}."}
ENGINES = {
    "transport": "Light was traced backward from every sensor once with Mitsuba 3 ({jakob2022}): "
    "paths were counted by sky patch and by what they met, so that the light of every time follows "
    "from a product with sun, sky and spectra; the sun's disc was traced at each time.",
    "timestep": "Light was traced at each time with the integrators of Mitsuba 3 ({jakob2022}).",
    "less": "Light was traced at each time with LESS ({qi2019}).",
}


def blocks(folder: Path) -> Iterator[Block]:
    """Sentences, references, and BibTeX of them."""
    path = folder / "config.yaml"
    if not path.is_file():
        return
    settings = yaml.safe_load(path.read_text(encoding="utf-8"))
    cited: dict[str, Reference] = {}
    text = " ".join(_cite(one, cited) for one in sentences(settings, folder))
    yield Text([text])
    yield Listing([("", one.cited()) for one in cited.values()])
    yield Code("\n\n".join(one.bibtex(key) for key, one in cited.items()), "BibTeX")


def sentences(settings: Mapping[str, Any], folder: Path) -> Iterator[str]:
    """What was done, where `{key}` stands for a reference."""
    study = settings.get("study", "light")
    yield (
        "All was computed with dapple in one Snakemake workflow ({molder2021}); versions, the seed "
        "and every setting stand below."
    )
    if study == "survey":
        yield (
            "Virtual stands were scanned from designs of positions; what scans do not see, and how "
            "laser coverage corrects it, follows {zande2008}."
        )
    if study in ("light", "stability"):
        yield from _of_light(settings, folder)
    if study == "chlorophyll":
        yield (
            "Canopy images of many leaf and ground properties were simulated from the scanned "
            "structure, networks learned chlorophyll from them, and were applied to the images. "
            "Leaf spectra are those of PROSPECT-D ({feret2017})."
        )


def _of_light(settings: Mapping[str, Any], folder: Path) -> Iterator[str]:
    yield SOURCES.get(settings.get("source", ""), "")
    names = [str(name) for name in settings.get("reconstructions", ())]
    if "polygons" in names:
        yield "Leaves and wood were rebuilt as one polygon in each small voxel ({frey2025})."
    if "surfels" in names:
        yield "Leaves were also rebuilt as small discs on the surfaces that points lie on."
    if voxels := [called(name) for name in names if name.startswith("voxels_")]:
        yield (
            f"Plant area density in {' and '.join(voxels)} was estimated from the free paths of "
            "all shots, misses among them ({pimont2018})."
        )
    radiation = settings.get("radiation", {})
    told = "was that of a clear sky" if radiation.get("kind") == "clear_sky" else "was measured"
    yield f"Radiation {told}; sun and spectra come from pvlib ({{anderson2023}})."
    yield SKIES.get(radiation.get("sky", ""), "")
    yield ENGINES.get(settings.get("light", {}).get("engine", ""), "")
    if (folder / "statistics/mixed_model.csv").is_file():
        yield (
            "Simulated light was held against records by Pearson's r, whose interval comes from a "
            "bootstrap of whole sensors, and by a linear mixed model with the sensor as random "
            "effect ({bates2015})."
        )


def _cite(sentence: str, cited: dict[str, Reference]) -> str:
    """A sentence with its references as names and years, which are added to `cited`."""
    for key, reference in REFERENCES.items():
        if f"{{{key}}}" in sentence:
            cited[key] = reference
            names = reference.author.split(" and ")
            who = names[0].split(",")[0] + (" et al." if len(names) > 2 else "")
            if len(names) == 2:
                who += f" and {names[1].split(',')[0]}"
            sentence = sentence.replace(f"{{{key}}}", f"{who} {reference.year}")
    return sentence
