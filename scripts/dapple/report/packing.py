"""Arrays as short text within a page, read again by `unpack` of `templates/20_charts.js`."""

import base64
from typing import Any

import numpy as np
import pandas as pd

from dapple.timezones import find_timezone

MISSING = 65535


def light(values: np.ndarray) -> dict[str, Any]:
    """PAR in whole µmol m⁻² s⁻¹; NaN and what is negative have their place."""
    filled = np.where(np.isfinite(values), np.clip(np.round(values), 0, MISSING - 1), MISSING)
    return _packed(filled.astype("<u2"))


def known(values: np.ndarray, digits: int) -> list[float | None]:
    """Numbers as JSON has them: what is not known is null."""
    return [round(float(one), digits) if np.isfinite(one) else None for one in values]


def places(values_m: np.ndarray) -> dict[str, Any]:
    """Coordinates in whole millimetres from the lowest."""
    values_m = np.asarray(values_m, float).reshape(-1, 3)
    low = values_m.min(axis=0) if len(values_m) else np.zeros(3)
    span = float(np.ptp(values_m, axis=0).max()) if len(values_m) else 0.0
    step_m = max(0.001, span / 65_000)
    steps = np.round((values_m - low) / step_m)
    high = low + (steps.max(axis=0) if len(steps) else 0) * step_m
    about = {"low_m": low.tolist(), "high_m": high.tolist(), "step_m": step_m}
    return _packed(steps.astype("<u2")) | about


def _packed(values: np.ndarray) -> dict[str, Any]:
    return {"base64": base64.b64encode(values.tobytes()).decode(), "shape": list(values.shape)}


def local(times: pd.DatetimeIndex, timezone: str) -> list[str]:
    """Times on the clock of a place, as charts read them."""
    utc = times if times.tz is not None else times.tz_localize("UTC")
    return list(utc.tz_convert(find_timezone(timezone)).strftime("%Y-%m-%d %H:%M:%S"))
