"""Which reconstruction to use, which to doubt, which to leave, in sentences."""

import re
from collections.abc import Mapping, Sequence
from typing import Any

import pandas as pd

from dapple.figures import style
from dapple.report.blocks import Block, Listing, Text, Verdict, number
from dapple.report.quantities import PAR_UNIT
from dapple.verdict.signal_meanings import SIGNALS

SAYS = {"green": "can be used", "amber": "doubtful", "red": "do not use"}
KNOWN = "truth"
"""The virtual plant itself: nobody who has a scan can choose it."""
LOSS = (
    "Expected loss tells how wrong the light may be: 0 is as good as in an undisturbed virtual "
    "world, 1 is failure (a fifth of r lost, or the error doubled). From its alarm on, a "
    "reconstruction is doubted, and below it where something is not known that might raise it."
)
RECORDS_ALONE = (
    "Wrong sensor positions and clocks leave no trace in a scan: only records show them."
)


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
    nearest = _nearest(overall, states["red"])
    first = [_by_records(nearest, verdict)] if nearest is not None else _by_scan(states, judged)
    named = "" if nearest is None else str(nearest["reconstruction"])
    return [
        *first,
        *_others([name for name in states["green"] if name != named] if named else []),
        *(
            f"{_capital(called(name))} are doubtful: {_why(judged[name], verdict)}."
            for name in states["amber"]
            if name != named
        ),
        *(f"Do not use {called(name)}: {_why(judged[name], verdict)}." for name in states["red"]),
        *(["There are no records of light to hold this against."] if overall is None else []),
    ]


def _nearest(overall: pd.DataFrame | None, red: Sequence[str]) -> pd.Series | None:
    """The row of the reconstruction that is nearest to records, of those that may be used."""
    if overall is None:
        return None
    own = overall[~overall["reconstruction"].isin([KNOWN, *red])].dropna(subset="rmse")
    return None if own.empty else own.loc[own["rmse"].idxmin()]


def _by_records(row: pd.Series, verdict: Mapping[str, Any]) -> str:
    """What records, which no fit has seen, recommend, and what the scan says to it."""
    name = str(row["reconstruction"])
    r = "" if pd.isna(row["r"]) else f"r = {row['r']:.2f}, "
    text = _typeset(
        f"Use {called(name)}: of all, their light comes nearest to {number(row['n'], 0)} records "
        f"({r}RMSE {number(row['rmse'])}, bias {row['bias']:+.0f} {PAR_UNIT})"
    )
    facts = verdict["reconstructions"].get(name)
    if facts is None:
        return f"{text}. What speaks against them in a scan is not known yet."
    if facts["state"] == "amber":
        return f"{text}. Away from these sensors take care: {_why(facts, verdict)}."
    return f"{text}, and nothing in the scan speaks against them."


def _by_scan(states: Mapping[str, Sequence[str]], judged: Mapping[str, Any]) -> list[str]:
    """What the scan alone recommends."""
    if states["green"]:
        best, *others = states["green"]
        return [f"Use {called(best)}: nothing in this run speaks against them.", *_others(others)]
    if states["amber"]:
        return [f"Use {called(states['amber'][0])} with care: no reconstruction is beyond doubt."]
    if judged:
        return ["Do not use the light of this run as it is."]
    return ["No reconstruction of this run was judged."]


def _others(names: Sequence[str]) -> list[str]:
    """What can be used beside the best."""
    if not names:
        return []
    return [f"{_capital(_and(names))} can be used as well: nothing speaks against them."]


def blocks(verdict: Mapping[str, Any]) -> list[Block]:
    """The verdict on each reconstruction, the best first, with reasons and remedies."""
    judged = verdict["reconstructions"]
    found: list[Block] = [Text([LOSS])] if judged else []
    for name in sorted(judged, key=lambda name: judged[name]["expected_loss"]):
        facts = judged[name]
        score = f"Expected loss {facts['expected_loss']:.2f}, alarm from {facts['alarm']:.2f}."
        if facts["state"] == "amber" and facts["expected_loss"] < facts["alarm"]:
            score += f" Doubted for what is not known: {verdict['unknown'][0]['text']}."
        if facts["state"] == "green" and facts["reasons"]:
            score += " What speaks most against it is still usual:"
        reasons = [f"{_capital(_reason(one))}. {one['help']}" for one in facts["reasons"]]
        state = facts["state"]
        title = _capital(called(name))
        found.append(Verdict(title, state, SAYS[state], _typeset(score), reasons))
    if verdict["unknown"]:
        items = [("Not known", f"{one['text']}. {one['help']}") for one in verdict["unknown"]]
        found.append(Listing(items))
    if not verdict["with_records"]:
        found.append(Text([RECORDS_ALONE]))
    return found


def _why(facts: Mapping[str, Any], verdict: Mapping[str, Any]) -> str:
    """The weightiest reason; what is not known where nothing else raised the alarm."""
    if facts["expected_loss"] < facts["alarm"] and verdict["unknown"]:
        return str(verdict["unknown"][0]["text"])
    reasons = [_reason(one) for one in facts["reasons"][:2]]
    return "; ".join(reasons) or "many small signs together"


def _reason(reason: Mapping[str, Any]) -> str:
    """What was seen, and what it is in an undisturbed run."""
    text = str(reason["text"])
    if usual := SIGNALS[reason["signal"]].number(float(reason["usual"])):
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
