"""The measured series."""

from __future__ import annotations

from typing import Literal

from dapple.config.base import NotNegative, Section, key


class Measured(Section):
    """The measured series."""

    kind: Literal["virtual", "table", "none"] = key(
        "virtual", "light of the virtual truth through a sensor model, a file, or none"
    )
    path: str = key("", "CSV with time_utc, logger, channel, par_umolm2s, relative to data_dir")
    noise_relative: NotNegative = key(0.02, "sensor model: relative standard deviation")
    noise_umol_m2_s: NotNegative = key(2.0, "sensor model: absolute standard deviation")
    calibration_relative: NotNegative = key(0.0, "sensor model: relative error of a whole sensor")
    clock_offset_s: float = key(0.0, "sensor model: how far the logger's clock is ahead")
