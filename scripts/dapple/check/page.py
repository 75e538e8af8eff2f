"""The check as one printed page and as one HTML page without links."""

import html
from collections.abc import Iterable
from typing import Any

MARKS = {"error": "ERROR", "warning": "warning", "note": "note"}
COLOURS = {"error": "#b71c1c", "warning": "#b26a00", "note": "#555"}
SHOWN = 12
"""Rows of a list on the printed page."""
STYLE = """
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; margin: 1rem 0; }
td, th { padding: 0.2rem 0.8rem; text-align: left; border-bottom: 1px solid #ccc; }
pre { background: #f4f4f4; padding: 0.5rem; }
.finding { border-left: 0.4rem solid; padding: 0 1rem; margin: 1rem 0; }
"""


def text(check: dict[str, Any]) -> str:
    """What `snakemake check` prints: findings first, then what was found."""
    lines = [f"{check['experiment']}: {summary(check)}"]
    for one in check["findings"]:
        if one["level"] == "note":
            continue
        lines += ["", f"{MARKS[one['level']]}  {one['where']}", f"  found {one['found']}"]
        if one["expected"]:
            lines.append(f"  expected {one['expected']}")
        if one["remedy"]:
            lines.append(f"  {one['remedy']}")
        lines += [f"    {line}" for line in one["yaml"].splitlines()]
    lines.append("")
    width = max((len(name) for name, _ in rows(check)), default=0)
    lines += [f"{name:<{width}}  {value}" for name, value in rows(check)]
    notes = [one for one in check["findings"] if one["level"] == "note"]
    lines += [f"{'note':<{width}}  {one['found']}" for one in notes[:SHOWN]]
    for row in check.get("can", []):
        lines.append(f"{'can' if row['able'] else 'cannot':<{width}}  {row['what']}: {row['why']}")
    return "\n".join(lines) + "\n"


def page(check: dict[str, Any]) -> str:
    """The same as HTML, every text from input escaped."""
    parts = [f"<h1>{_e(check['experiment'])}</h1>", f"<p>{_e(summary(check))}</p>"]
    for one in check["findings"]:
        parts.append(
            f'<div class="finding" style="border-color: {COLOURS[one["level"]]}">'
            f"<p><b>{_e(MARKS[one['level']])}</b> {_e(one['where'])}: found {_e(one['found'])}"
            + (f"; expected {_e(one['expected'])}" if one["expected"] else "")
            + f". {_e(one['remedy'])}</p>"
            + (f"<pre>{_e(one['yaml'])}</pre>" if one["yaml"] else "")
            + "</div>"
        )
    parts.append(_table(rows(check)))
    if check.get("can"):
        able = [
            (("can " if row["able"] else "cannot ") + row["what"], row["why"])
            for row in check["can"]
        ]
        parts.append(_table(able))
    stems = check.get("cloud", {}).get("stems", [])
    if stems:
        head = "".join(f"<th>{_e(name)}</th>" for name in stems[0])
        body = "".join(
            "<tr>" + "".join(f"<td>{_e(_number(v))}</td>" for v in stem.values()) + "</tr>"
            for stem in stems
        )
        parts.append(f"<h2>Stems</h2><table><tr>{head}</tr>{body}</table>")
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        f"<title>{_e(check['experiment'])}: check</title><style>{STYLE}</style>"
        + "".join(parts)
        + "</html>\n"
    )


def summary(check: dict[str, Any]) -> str:
    """How many errors and warnings, in a sentence."""
    counts = {
        level: sum(one["level"] == level for one in check["findings"])
        for level in ("error", "warning")
    }
    if not any(counts.values()):
        return "nothing speaks against this input"
    said = [f"{n} {level}{'s' if n > 1 else ''}" for level, n in counts.items() if n]
    stops = "; a run stops at errors" if counts["error"] else ""
    return " and ".join(said) + stops


def rows(check: dict[str, Any]) -> list[tuple[str, str]]:
    """Name and value of what was found, for both pages."""
    found: list[tuple[str, str]] = []
    cloud = check.get("cloud")
    if cloud:
        found += _cloud_rows(cloud)
        found.append(("shots without return", check["misses"]))
    if numbers := check.get("sensors"):
        found.append(
            (
                "sensors",
                f"{numbers['sensors']}, {numbers['least_height_m']:.2f} to "
                f"{numbers['greatest_height_m']:.2f} m above the ground, at most "
                f"{numbers['farthest_outside_m']:.1f} m outside the cloud",
            )
        )
    return found


def _cloud_rows(cloud: dict[str, Any]) -> Iterable[tuple[str, str]]:
    extent = " × ".join(f"{value:.2f}" for value in cloud["extent_m"])
    low = ", ".join(f"{value:,.2f}" for value in cloud["low_m"])
    yield "file", cloud["path"]
    yield "points", f"{cloud['points']:,} of {cloud['points_in_file']:,} records"
    yield "extent", f"{extent} m from ({low}), local origin {_list(cloud['origin_m'])}"
    yield "coordinate system", _crs(cloud["crs"])
    step = f"{cloud['step_m']:g} m" if cloud["step_m"] else "none"
    yield (
        "spacing",
        f"{100 * cloud['spacing_m']:.2g} cm, {cloud['points_per_m2']:,.0f} points per m² of "
        f"ground, rounded to {step}, {cloud['duplicates']:,} duplicates",
    )
    for name, values in cloud["attributes"].items():
        missing = f", {values['missing']:,} missing" if values["missing"] else ""
        yield name, f"{values['least']:g} to {values['most']:g}{missing}"
    returns = cloud["returns"]
    yield (
        "returns",
        f"up to {returns['most']} a shot; {100 * returns['share_of_several']:.0f} % of points from "
        "shots with several",
    )
    yield "scanner", cloud["scanner"]
    for scan in cloud["scans"][:SHOWN]:
        place = "place unknown" if scan["position_m"] is None else f"at {_list(scan['position_m'])}"
        shots = "" if scan["shots"] is None else f", {scan['shots']:,} shots"
        yield f"scan {scan['number']}", f"{place}, {scan['points']:,} points{shots}"
    if len(cloud["scans"]) > SHOWN:
        yield "", f"… and {len(cloud['scans']) - SHOWN} more scans"
    ground = cloud["ground"]
    yield (
        "ground",
        f"{ground['z_m']:.2f} m ({ground['found_by']}), slope {100 * ground['slope']:.0f} %",
    )
    yield "height", f"{cloud['height_m']:.1f} m above the ground"
    what = cloud["trees_found_by"]
    yield what, str(len(cloud["stems"]))
    for stem in cloud["stems"][:SHOWN]:
        yield (
            f"{what.removesuffix('s')} {stem['id']}",
            f"at [{stem['east_m']:.2f}, {stem['north_m']:.2f}], {stem['height_m']:.1f} m high, "
            f"{100 * stem['width_m']:.0f} cm wide",
        )
    if len(cloud["stems"]) > SHOWN:
        yield "…", f"{len(cloud['stems']) - SHOWN} more in check.html"


def _crs(crs: str) -> str:
    if not crs:
        return "not named"
    return crs if len(crs) < 60 else crs.split('"')[1] if '"' in crs else crs[:60]


def _list(values: Iterable[float]) -> str:
    return "[" + ", ".join(f"{value:.2f}" for value in values) + "]"


def _number(value: float) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)


def _table(found: list[tuple[str, str]]) -> str:
    body = "".join(f"<tr><td>{_e(name)}</td><td>{_e(value)}</td></tr>" for name, value in found)
    return f"<table>{body}</table>"


def _e(value: object) -> str:
    return html.escape(str(value))
