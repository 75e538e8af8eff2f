"""Draw which rule needs which into docs/rules.md, one picture a study: part of `make docs`.

Snakemake tells the graph. Left out are rules that gather what all others made, and arrows from a
rule to one that it reaches through others.
"""

import re
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs/rules.md"
STUDIES = {
    "Light under one tree": "virtual-apple-small",
    "Where to put the scanner": "survey-small",
    "Chlorophyll from UAV images": "chlorophyll-small",
    "Where methods fail": "stability-small",
}
GATHER = {"all", "configuration", "runtime", "page"}
HEAD = """# Which rule needs which

An arrow leads from a rule to one that reads its files. `make docs` draws these pictures with
Snakemake (`tools/rule_graph.py`). `configuration`, `runtime` and `page`, which gather what all
others made, are left out, and so are arrows from a rule to one that it reaches through others.
`rules/` has the rules, `scripts/` the script of each, under the rule's name.
"""


def arguments(config: str) -> list[str]:
    """Those by which Snakemake tells the graph of a configuration."""
    return ["--rulegraph", "mermaid-js", "--forceall", "--configfile", f"config/{config}.yaml"]


def arrows(told: str) -> set[tuple[str, str]]:
    """Pairs of rules, the needed one first, from what Snakemake tells."""
    names = dict(re.findall(r"^\s*(id\d+)\[(\w+)\]", told, re.MULTILINE))
    pairs = re.findall(r"^\s*(id\d+) --> (id\d+)", told, re.MULTILINE)
    found = {(names[first], names[then]) for first, then in pairs}
    return {pair for pair in found if not GATHER & set(pair)}


def without_shortcuts(pairs: set[tuple[str, str]]) -> set[tuple[str, str]]:
    """The arrows without those that lead where others lead too."""
    after: dict[str, set[str]] = {}
    for first, then in pairs:
        after.setdefault(first, set()).add(then)

    def reached(rule: str) -> set[str]:
        return set().union(*({then} | reached(then) for then in after.get(rule, ())))

    return {
        (first, then)
        for first, then in pairs
        if not any(then in reached(other) for other in after[first])
    }


def page(told: dict[str, str]) -> str:
    """The page, from what Snakemake tells of every study."""
    parts = [HEAD]
    for title, text in told.items():
        drawn = [f"  {a} --> {b}" for a, b in sorted(without_shortcuts(arrows(text)))]
        parts += [f"## {title}\n", "```mermaid\nflowchart LR", *drawn, "```\n"]
    return "\n".join(parts)


def main() -> None:
    """Write the page."""
    told = {}
    for title, config in STUDIES.items():
        command = [sys.executable, "-m", "snakemake", *arguments(config)]
        done = subprocess.run(command, cwd=ROOT, check=True, capture_output=True, text=True)
        told[title] = done.stdout
    PAGE.write_text(page(told))


if __name__ == "__main__":
    main()
