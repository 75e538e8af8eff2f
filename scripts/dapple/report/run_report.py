"""The page that tells a run, whatever was studied: what its folder has is shown, in one order."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from dapple.formats import json
from dapple.report import (
    findings_list,
    ground_view,
    methods,
    numbers,
    plot_report,
    provenance,
    recommendation,
    residuals,
    run_light,
    sensor_view,
    study_leads,
    tree_view,
)
from dapple.report.blocks import Block, Section, picture
from dapple.report.document import document


def build(experiment: str, folder: Path, captions: Mapping[str, str]) -> str:
    """Gather what a run has made into one HTML page without links to other files.

    Parameters
    ----------
    experiment : str
        Title.
    folder : path
        `results/{experiment}`.
    captions : mapping of str to str
        What stands below each figure, by its file in the folder; those that are missing there are
        left out.

    Returns
    -------
    str
        HTML.
    """
    verdict = json.read(path) if (path := folder / "verdict.json").is_file() else None
    overall = numbers.overall(folder)
    lead = recommendation.sentences(verdict, overall) if verdict else study_leads.sentences(folder)
    captions = {**captions, **_captions_of_plots(folder)}
    made = [name for name in captions if (folder / name).is_file()]
    tables = [*numbers.COMPARED, *numbers.OF_STUDIES, "verdict.json", "runtime.csv"]
    run = run_light.read(folder)
    sections = [
        Section("How far to trust it", recommendation.blocks(verdict) if verdict else ()),
        Section("What was noticed about the input", findings_list.of_run(folder)),
        Section("The tree", [*_tree(folder, run)]),
        Section("Light on the ground", [*ground_view.blocks(run, folder)] if run else ()),
        Section("Light at the sensors", [*sensor_view.blocks(run)] if run else ()),
        Section("Where it is off", [*residuals.blocks(run)] if run else ()),
        Section("Numbers", [*numbers.of_files(folder, numbers.COMPARED)]),
        Section("Structure", [*numbers.structure(folder)]),
        Section("Accuracy against speed", [*numbers.tradeoff(folder)]),
        Section("Tables", [*numbers.of_files(folder, numbers.OF_STUDIES)]),
        Section("Figures", [picture(folder / name, captions[name]) for name in made]),
        Section("How it was computed", [*methods.blocks(folder)]),
        Section("What it cost", [*provenance.cost(folder)], is_folded=True),
        Section("Configuration", [*provenance.configuration(folder)], is_folded=True),
        Section("Versions", [provenance.versions()], is_folded=True),
        Section("Checksums (SHA-256)", [provenance.checksums(folder, [*tables, *made])], True),
    ]
    return document(experiment, lead, sections)


def _tree(folder: Path, run: run_light.RunLight | None) -> Iterator[Block]:
    """The tree of a run, lit or not."""
    names = list(run.light) if run else sorted(p.name for p in folder.glob("structure/*"))
    return tree_view.blocks(folder, names, run.best if run else "")


def _captions_of_plots(folder: Path) -> dict[str, str]:
    """Figures of plots whose chlorophyll was mapped, each with its plot's name."""
    return {
        path.relative_to(folder).as_posix(): f"{path.stem.removesuffix(f'_{name}')}: {text}"
        for name, text in plot_report.CAPTIONS.items()
        for path in sorted(folder.glob(f"chlorophyll/*_{name}.png"))
    }
