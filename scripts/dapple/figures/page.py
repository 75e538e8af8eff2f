"""One self-contained page that tells a run: its tables, its figures, what it cost."""

import base64
import html
import json
from pathlib import Path

import pandas as pd

TABLES = {
    "statistics/overall.csv": "Simulated against measured PAR, records that no fit has seen",
    "statistics/mixed_model.csv": "Measured on simulated light, sensor as random effect",
    "statistics/agreement.csv": "Transport engine against per-timestep reference",
    "runtime.csv": "Time and memory of every step",
}
FIGURES = {
    "figures/tree.png": "The tree from the side and from above, with the sensors.",
    "figures/series.png": "PAR through the day at chosen sensors.",
    "figures/boxplot.png": "Correlation of every sensor by reconstruction.",
    "figures/scatter.png": "Simulated against measured PAR.",
    "figures/ground_map.png": "PAR on the ground.",
    "figures/advice.png": "What each refinement of the light changes.",
    "tradeoff/chart.png": "Accuracy against speed.",
}
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; font-size: 0.85rem; margin: 1rem 0; }
th, td { border-bottom: 1px solid #ccc; padding: 0.2rem 0.8rem; text-align: right; }
th:first-child, td:first-child { text-align: left; }
figure { margin: 1.5rem 0; } img { max-width: 100%; } figcaption { color: #555; }
"""


def build(experiment: str, folder: Path) -> str:
    """Gather what a run has made into one HTML page without links to other files.

    Parameters
    ----------
    experiment : str
        Title.
    folder : path
        `results/{experiment}`.

    Returns
    -------
    str
        HTML.
    """
    parts = [f"<h1>{html.escape(experiment)}</h1>", _structure(folder)]
    for name, title in TABLES.items():
        if (path := folder / name).is_file():
            parts += [f"<h2>{title}</h2>", _table(pd.read_csv(path))]
    for name, caption in FIGURES.items():
        if (path := folder / name).is_file():
            data = base64.b64encode(path.read_bytes()).decode()
            parts.append(
                f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
                f"<figcaption>{caption}</figcaption></figure>"
            )
    body = "\n".join(parts)
    title = html.escape(f"dapple: {experiment}")
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title}</title>'
        f"<style>{STYLE}</style></head><body>\n{body}\n</body></html>\n"
    )


def _structure(folder: Path) -> str:
    """What every reconstruction consists of, as one table."""
    facts = {
        path.parent.name: json.loads(path.read_text())
        for path in sorted(folder.glob("structure/*/summary.json"))
    }
    table = pd.DataFrame(facts).T
    table = table[[name for name in table if table[name].map(_is_plain).all()]]
    table.index.name = "reconstruction"
    return "<h2>Structure</h2>\n" + _table(table.reset_index())


def _is_plain(value: object) -> bool:
    return value is None or isinstance(value, int | float | str)


def _table(table: pd.DataFrame) -> str:
    return table.to_html(index=False, na_rep="", float_format=lambda value: f"{value:.4g}")
