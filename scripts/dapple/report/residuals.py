"""When simulated light is off: by the hour and by the height of the sun."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pandas as pd

from dapple.figures import style
from dapple.report.blocks import Block, Chart
from dapple.report.quantities import PAR_UNIT
from dapple.report.run_light import RunLight
from dapple.timezones import find_timezone

HEIGHT_STEP_DEG = 5.0


def blocks(run: RunLight) -> Iterator[Block]:
    """Bias and RMSE against records that no fit has seen."""
    if run.records is None:
        return
    own = run.records[run.records["part"] == "reporting"].dropna(subset=["measured", "simulated"])
    if own.empty:
        return
    local = own["time"].dt.tz_convert(find_timezone(run.timezone))
    hour = local.dt.hour + 0.5
    height = np.interp(
        own["time"].astype("datetime64[ns, UTC]").astype(np.int64),
        run.times.astype("datetime64[ns, UTC]").astype(np.int64),
        run.sun_height_deg,
    )
    step = HEIGHT_STEP_DEG
    height = pd.Series((np.floor(height / step) + 0.5) * step, own.index)
    for name, groups, title in (
        ("residuals-hour", hour, f"hour of the day ({run.timezone})"),
        ("residuals-height", height, "height of the sun [°]"),
    ):
        caption = (
            f"Simulated minus measured PAR by {title.split(' [')[0].split(' (')[0]}: the line is "
            "the mean, the dotted line the root mean square."
        )
        yield Chart(name, "figure", caption, _figure(own, groups, title, tuple(run.light)))


def _figure(
    records: pd.DataFrame, groups: pd.Series, title: str, names: tuple[str, ...]
) -> dict[str, Any]:
    """Lines of all reconstructions, as Plotly takes them."""
    error = records["simulated"] - records["measured"]
    traces: list[dict[str, Any]] = []
    for name in names:
        own = (records["reconstruction"] == name).to_numpy()
        if not own.any():
            continue
        grouped = error[own].groupby(groups[own])
        line = {"color": style.colour(name, names)}
        label = style.label(name)
        for text, values, dash in (
            ("bias", grouped.mean(), "solid"),
            ("RMSE", (error[own] ** 2).groupby(groups[own]).mean() ** 0.5, "dot"),
        ):
            traces.append(
                {
                    "x": [float(value) for value in values.index],
                    "y": values.round(1).tolist(),
                    "customdata": grouped.size().tolist(),
                    "name": label,
                    "mode": "lines+markers",
                    "line": line | {"dash": dash},
                    "hovertemplate": f"{text} %{{y:.0f}} {PAR_UNIT}, %{{customdata}} records",
                    "legendgroup": label,
                    "showlegend": text == "bias",
                }
            )
    error_title = f"simulated − measured [{PAR_UNIT}]"
    layout = {"xaxis": {"title": {"text": title}}, "yaxis": {"title": {"text": error_title}}}
    return {"data": traces, "layout": layout}
