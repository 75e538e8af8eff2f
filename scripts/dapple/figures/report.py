"""One self-contained page that tells a run: its verdict, its tables, its figures, what it cost."""

import base64
import html
import json
from collections.abc import Iterable, Mapping
from pathlib import Path

import pandas as pd

TABLES = {
    "statistics/overall.csv": "Simulated against measured PAR, records that no fit has seen",
    "statistics/mixed_model.csv": "Measured on simulated light, sensor as random effect",
    "statistics/agreement.csv": "Transport engine against per-timestep reference",
    "runtime.csv": "Time and memory of every step",
}
NOTICED = ("sky/radiation.json", "sky/optics.json", "sky/sensors.json", "statistics/records.json")
LEVELS = ("error", "warning", "note")
STATES = {
    "green": ("#2e7d32", "nothing speaks against this light"),
    "amber": ("#b26a00", "look at what follows before using this light"),
    "red": ("#b71c1c", "do not use this light as it is"),
}
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; font-size: 0.85rem; margin: 1rem 0; }
th, td { border-bottom: 1px solid #ccc; padding: 0.2rem 0.8rem; text-align: right; }
th:first-child, td:first-child { text-align: left; }
.verdict { border-left: 0.5rem solid; padding: 0.2rem 1rem; margin: 1rem 0; background: #f7f7f7; }
.verdict h2 { margin: 0.3rem 0; } .verdict li { margin: 0.2rem 0; }
.state { display: inline-block; padding: 0 0.6rem; border-radius: 0.4rem; color: #fff; }
figure { margin: 1.5rem 0; } img { max-width: 100%; } figcaption { color: #555; }
"""


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
    parts = [f"<h1>{html.escape(experiment)}</h1>", _verdict(folder), _noticed(folder)]
    parts.append(_structure(folder))
    for name, title in TABLES.items():
        if (path := folder / name).is_file():
            parts += [f"<h2>{title}</h2>", table(pd.read_csv(path))]
    for name, caption in captions.items():
        if (path := folder / name).is_file():
            parts.append(figure(path, caption))
    return page(f"dapple: {experiment}", parts)


def page(title: str, parts: Iterable[str]) -> str:
    """A whole HTML page of parts that are HTML."""
    body, title = "\n".join(parts), html.escape(title)
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body>\n{body}\n</body></html>\n"
    )


def figure(path: Path, caption: str) -> str:
    """A picture within the page."""
    text, data = html.escape(caption), base64.b64encode(path.read_bytes()).decode()
    return (
        f'<figure><img alt="{text}" src="data:image/png;base64,{data}">'
        f"<figcaption>{text}</figcaption></figure>"
    )


def _verdict(folder: Path) -> str:
    """What the run's own signals say about it; nothing where it was not judged."""
    if not (path := folder / "verdict.json").is_file():
        return ""
    judged = json.loads(path.read_text())
    colour = STATES[judged["state"]][0]
    parts = [f'<section class="verdict" style="border-color: {colour}">']
    parts.append(f"<h2>Verdict: {_badge(judged['state'])}</h2>")
    for name, facts in judged["reconstructions"].items():
        score = f"expected loss {facts['expected_loss']:.2f}, alarm from {facts['alarm']:.2f}"
        parts.append(f"<p><b>{html.escape(name)}</b> {_badge(facts['state'])} ({score})</p><ul>")
        for reason in facts["reasons"]:
            text, remedy = (html.escape(reason[key]) for key in ("text", "help"))
            usual = html.escape(reason["usual_text"])
            beyond = "; beyond all that was tried" if reason["is_beyond"] else ""
            parts.append(f"<li>{text} (undisturbed: {usual}{beyond}). {remedy}</li>")
        parts.append("</ul>")
    for one in judged["unknown"]:
        parts.append(f"<p>Not known: {html.escape(one['text'])}. {html.escape(one['help'])}</p>")
    parts.append(
        "<p>Of loss, 1 is failure: a fifth of r lost, or error doubled, in virtual worlds.</p>"
    )
    if not judged["with_records"]:
        parts.append("<p>Wrong sensor positions and clocks leave no trace in a scan.</p>")
    return "\n".join([*parts, "</section>"])


def _noticed(folder: Path) -> str:
    """What was noticed about the files that a run was given; nothing where nothing was."""
    facts = [json.loads(path.read_text()) for name in NOTICED if (path := folder / name).is_file()]
    share = next((t["modelled_share_of_day"] for t in facts if "modelled_share_of_day" in t), 0.0)
    lines = []
    if share:
        lines.append(
            f"<li>Radiation is modelled, not measured, at {100 * share:.0f} % of the times with "
            "the sun up.</li>"
        )
    return noticed(facts, lines)


def noticed(facts: Iterable[Mapping], more: Iterable[str] = ()) -> str:
    """Findings of several files of facts as a list, errors first; nothing where there are none."""
    rows = [one for some in facts for one in some.get("findings", ())]
    rows.sort(key=lambda one: LEVELS.index(one["level"]))
    lines = []
    for one in rows:
        expected = f"; expected {one['expected']}" if one["expected"] else ""
        text = f"{one['where']}: {one['found']}{expected}. {one['remedy']}"
        lines.append(f"<li><b>{one['level']}</b> {html.escape(text)}</li>")
    lines += more
    if not lines:
        return ""
    return "\n".join(["<h2>What was noticed about the input</h2><ul>", *lines, "</ul>"])


def _badge(state: str) -> str:
    colour, text = STATES[state]
    return f'<span class="state" style="background: {colour}">{state}</span> {text}'


def _structure(folder: Path) -> str:
    """What every reconstruction consists of, as one table."""
    facts = {
        path.parent.name: json.loads(path.read_text())
        for path in sorted(folder.glob("structure/*/summary.json"))
    }
    found = pd.DataFrame(facts).T
    found = found[[name for name in found if found[name].map(_is_plain).all()]]
    found.index.name = "reconstruction"
    return "<h2>Structure</h2>\n" + table(found.reset_index())


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, int | float | str)


def table(frame: pd.DataFrame) -> str:
    """A table of plain numbers."""
    return frame.to_html(index=False, na_rep="", float_format=lambda value: f"{value:.4g}")
