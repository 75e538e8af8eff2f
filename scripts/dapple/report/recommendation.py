"""Which reconstruction to use, which to doubt, which to leave, in sentences."""

import re
from collections.abc import Mapping, Sequence
from string import Formatter
from typing import Any

import pandas as pd

from dapple.figures import style
from dapple.report.blocks import Block, Listing, Text, Verdict, number
from dapple.report.quantities import PAR_UNIT
from dapple.verdict.signal_meanings import SIGNALS

SAYS = {"green": "can be used", "amber": "doubtful", "red": "do not use"}
KNOWN = "truth"
"""The virtual plant itself: nobody who has a scan can choose it."""


def called(name: str) -> str:
    """A reconstruction's name within a sentence."""
    return style.label(name).replace("voxels ", "voxels of ")


def sentences(verdict: Mapping[str, Any], overall: pd.DataFrame | None) -> list[str]:
    """What to do with the light of a run, the most important first.

    Parameters
    ----------
    verdict : mapping
        As `verdict.judgement.judge` gives it.
    overall : DataFrame or None
        `reconstruction, n, r, r_low, r_high, rmse, bias` against records, where there are any.
    """
    judged = verdict["reconstructions"]
    states = {
        state: sorted(
            (name for name, facts in judged.items() if facts["state"] == state),
            key=lambda name: judged[name]["expected_loss"],
        )
        for state in SAYS
    }
    return [
        *_use(states, judged),
        *(
            f"{_capital(called(name))} are doubtful: {_why(judged[name], verdict)}."
            for name in states["amber"]
        ),
        *(f"Do not use {called(name)}: {_why(judged[name], verdict)}." for name in states["red"]),
        *_by_records(overall, states),
    ]


def _use(states: Mapping[str, Sequence[str]], judged: Mapping[str, Any]) -> list[str]:
    if states["green"]:
        best, *others = states["green"]
        text = f"Use {called(best)}: nothing in this run speaks against them."
        if others:
            text += f" {_capital(_and(others))} can be used as well."
        return [text]
    if states["amber"]:
        return [f"Use {called(states['amber'][0])} with care: no reconstruction is beyond doubt."]
    if judged:
        return ["Do not use the light of this run as it is."]
    return ["No reconstruction of this run was judged."]


def _by_records(overall: pd.DataFrame | None, states: Mapping[str, Sequence[str]]) -> list[str]:
    """What records say, and whether that is what the verdict says."""
    if overall is None:
        return ["There are no records of light to hold this against."]
    own = overall[overall["reconstruction"] != KNOWN].dropna(subset="rmse")
    if own.empty:
        return []
    best = own.loc[own["rmse"].idxmin()]
    r = "" if pd.isna(best["r"]) else f"r = {best['r']:.2f}, "
    text = (
        f"Of {best['n']:.0f} records each, {called(best['reconstruction'])} come nearest: {r}"
        f"RMSE {number(best['rmse'])} and bias {best['bias']:+.0f} {PAR_UNIT}"
    ).replace("-", "−")
    name = best["reconstruction"]
    if name in (*states["amber"], *states["red"]):
        text += ", although their scan speaks against them: trust them at these sensors only"
    elif name not in states["green"]:
        text += "; what speaks against them in a scan is not known yet"
    return [text + "."]


def blocks(verdict: Mapping[str, Any]) -> list[Block]:
    """The verdict on each reconstruction, the best first, with reasons and remedies."""
    judged = verdict["reconstructions"]
    found: list[Block] = []
    for name in sorted(judged, key=lambda name: judged[name]["expected_loss"]):
        facts = judged[name]
        score = f"Expected loss {facts['expected_loss']:.2f}, alarm from {facts['alarm']:.2f}."
        if facts["state"] == "green" and facts["reasons"]:
            score += " What speaks most against it is still usual:"
        reasons = [f"{_capital(_reason(one))}. {one['help']}" for one in facts["reasons"]]
        state = facts["state"]
        title = _capital(called(name))
        found.append(Verdict(title, state, SAYS[state], _typeset(score), reasons))
    if verdict["unknown"]:
        items = [("Not known", f"{one['text']}. {one['help']}") for one in verdict["unknown"]]
        found.append(Listing(items))
    notes = [
        "A loss of 1 is failure: a fifth of r lost, or the error doubled, in virtual worlds that "
        "were made worse on purpose."
    ]
    if not verdict["with_records"]:
        notes.append(
            "Wrong sensor positions and clocks leave no trace in a scan: only records show them."
        )
    return [*found, Text(notes)]


def _why(facts: Mapping[str, Any], verdict: Mapping[str, Any]) -> str:
    """The weightiest reason; what is not known where nothing else raised the alarm."""
    if facts["expected_loss"] < facts["alarm"] and verdict["unknown"]:
        return str(verdict["unknown"][0]["text"])
    reasons = [_reason(one) for one in facts["reasons"][:2]]
    return "; ".join(reasons) or "many small signs together"


def _reason(reason: Mapping[str, Any]) -> str:
    """What was seen, and what it is in an undisturbed run."""
    text = str(reason["text"])
    fields = [one for one in Formatter().parse(SIGNALS[reason["signal"]].text) if one[1]]
    if fields:
        usual = format(float(reason["usual"]), fields[0][2] or "")
        text += f" (undisturbed: {usual})"
    beyond = ", more than in any run that was tried" if reason["is_beyond"] else ""
    return _typeset(f"{text}{beyond}")


def _typeset(text: str) -> str:
    """True minus signs, a space before per cent, no signed nought."""
    text = re.sub(r"[+-](?=0(\.0+)?(%|\b(?!\.)))", "", text)
    return re.sub(r"(?<!\w)-(?=\d)", "−", text).replace("%", "\u202f%")


def _and(names: Sequence[str]) -> str:
    words = [called(name) for name in names]
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else words[0]


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
