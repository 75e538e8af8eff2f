"""Green, amber or red: whether a run's light can be trusted, and what would help.

The models are fitted to stress runs and stored beside this file; judging needs
neither truth nor those runs. There are two sets of them: one for what a scan leaves behind
alone, and one for runs that have records of light as well, which show wrong clocks and places.
"""

import math
from pathlib import Path
from typing import Any

import pandas as pd

from dapple.formats import json
from dapple.verdict.departure import departure
from dapple.verdict.fitting import fit, flagged, validate
from dapple.verdict.signal_meanings import ABSENT, OF_RECORDS, SIGNALS

__all__ = ["STATES", "fit", "flagged", "judge", "load", "store", "validate"]

MODEL = Path(__file__).with_name("verdict_model.json")
STATES = ("green", "amber", "red")


def judge(
    signals: dict[str, float],
    reconstructions: tuple[str, ...],
    models: dict[str, dict] | None = None,
) -> dict:
    """Judge a run by its signals.

    Parameters
    ----------
    signals : dict of str to float
        As `signals.measure` gives them; NaN where unknown.
    reconstructions : tuple of str
        Reconstructions to be judged.
    models : dict, optional
        As `fit` gives them; else the stored ones, those with records where there are any.

    Returns
    -------
    dict
        `state` (that of the best reconstruction: its light can be used), `reconstructions` (by
        name: `state`, `expected_loss`, of which 1 is failure, the `alarm` level, `reasons`, each
        with `signal`, `value`, `usual`, `text`, `help`, `share` of the loss and `is_beyond` what
        the stress runs have seen), `with_records`, `unknown` (what the run does not hold: `text`,
        `help`) and `signals`. What cannot be known makes green amber.
    """
    with_records = any(math.isfinite(signals.get(name, math.nan)) for name in OF_RECORDS)
    models = load(with_records=with_records) if models is None else models
    unknown = [
        {"lacks": what, "text": text, "help": remedy}
        for what, (names, text, remedy) in ABSENT.items()
        if all(not math.isfinite(signals.get(name, math.nan)) for name in names)
    ]
    judged = {
        name: _bounded(name, signals, _judge_one(signals, models[name], unknown))
        for name in reconstructions
        if name in models
    }
    states = [facts["state"] for facts in judged.values()]
    return {
        "state": min(states, key=STATES.index) if states else "amber",
        "reconstructions": judged,
        "with_records": with_records,
        "unknown": unknown,
        "signals": {k: (float(v) if math.isfinite(v) else None) for k, v in signals.items()},
    }


def _judge_one(signals: dict[str, float], model: dict, unknown: list) -> dict:
    total, raised = model["intercept"], []
    for name, learned in model["signals"].items():
        value = signals.get(name, math.nan)
        loss = learned["weight"] * float(departure(name, [value], learned)[0])
        total += loss
        if loss > 0:
            raised.append((loss, name, value, learned))
    state = STATES[int(total >= model["amber"]) + int(total >= model["red"])]
    if unknown and state == "green":
        state = "amber"
    by_signals = sum(loss for loss, *_ in raised)
    raised.sort(key=lambda reason: -reason[0])
    return {
        "state": state,
        "expected_loss": total,
        "alarm": model["amber"],
        "reasons": [
            _reason(loss / by_signals, name, value, learned)
            for loss, name, value, learned in raised[:3]
            if loss > 0.1 * by_signals
        ],
    }


def _bounded(name: str, signals: dict[str, float], judged: dict) -> dict:
    """Red, whatever the model says, where a signal of this reconstruction is beyond its bound."""
    for key, signal in SIGNALS.items():
        value = signals.get(key, math.nan)
        if signal.only_of == name and value > signal.most:
            learned = {"usual": 0.0, "low": 0.0, "high": signal.most}
            judged["reasons"] = [_reason(1.0, key, value, learned)]
            judged["expected_loss"] = max(judged["expected_loss"], 1.0)
            judged["state"] = STATES[-1]
    return judged


def _reason(share: float, name: str, value: float, learned: dict) -> dict:
    signal = SIGNALS[name]
    usual = 10 ** learned["usual"] if signal.is_log else learned["usual"]
    level = math.log10(max(value, 0.1)) if signal.is_log else value
    return {
        "signal": name,
        "value": float(value),
        "usual": usual,
        "text": signal.tell(value),
        "usual_text": signal.tell(usual),
        "help": signal.help,
        "share": share,
        "is_beyond": not learned["low"] <= level <= learned["high"],
    }


def load(path: Path = MODEL, *, with_records: bool = False) -> dict[str, dict]:
    """The stored models by reconstruction."""
    return json.read(path)["records" if with_records else "scan"]["models"]


def store(path: Path, points: pd.DataFrame, **settings: Any) -> dict:
    """Fit models to all stress runs and store them with the rates on runs they were not fitted to.

    Returns
    -------
    dict
        What was stored, for `scan` and for `records`: `models`, and `rates` as `validate` gives
        them.
    """
    found = {
        key: {
            "rates": validate(points, with_records=key == "records", **settings),
            "models": fit(points, with_records=key == "records", **settings),
        }
        for key in ("scan", "records")
    }
    json.write(path, found)
    return found
