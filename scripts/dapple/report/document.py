"""Sections as one HTML page that needs no other file and no network."""

from collections.abc import Iterable, Sequence
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from plotly.offline import get_plotlyjs

from dapple.report.blocks import Chart, Section

TEMPLATES = Path(__file__).with_name("templates")


def document(
    title: str, lead: Sequence[str], sections: Iterable[Section], *, noticed: str = ""
) -> str:
    """The whole page.

    Parameters
    ----------
    title : str
        Of the page.
    lead : sequence of str
        Sentences that stand first: the first one is the most important of the page.
    sections : iterable of Section
        Empty ones are left out.
    noticed : str
        One line below the lead, as how many warnings there are about the input.

    Returns
    -------
    str
        HTML; all that comes from input is escaped.
    """
    kept = [section for section in sections if section.blocks]
    is_charted = any(isinstance(block, Chart) for section in kept for block in section.blocks)
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("page.html.j2").render(
        title=title,
        lead=lead,
        noticed=noticed,
        sections=kept,
        style=_own("page.css"),
        scripts=[_own(path.name) for path in sorted(TEMPLATES.glob("*.js"))],
        plotly=get_plotlyjs() if is_charted else "",
    )


def _own(name: str) -> str:
    """A file beside the template."""
    return (TEMPLATES / name).read_text(encoding="utf-8")
