"""The measured series."""

from __future__ import annotations

from typing import Any, Literal

from dapple.config.base import NotNegative, TimedTable, key

SENSOR_MODEL = {"noise_relative", "noise_umol_m2_s", "calibration_relative", "clock_offset_s"}


class Measured(TimedTable):
    """The measured series."""

    kind: Literal["auto", "virtual", "table", "none"] = key(
        "auto",
        "light of the virtual truth through a sensor model, a file, or none; auto: as the source "
        "and path tell",
    )
    sensor_column: str = key("", "column of labels; empty: sensor or label, or logger and channel")
    par_column: str = key(
        "", "column of PAR, or a pattern such as PAR_{sensor}_Avg; empty: by its usual name"
    )
    unit: Literal[
        "", "umol/m2/s", "mmol/m2/s", "mol/m2/d", "mol/m2", "mmol/m2", "W/m2", "lx", "klx"
    ] = key("", "of the records, sums over the interval; empty: as the header says, else umol/m2/s")
    noise_relative: NotNegative = key(0.02, "sensor model: relative standard deviation")
    noise_umol_m2_s: NotNegative = key(2.0, "sensor model: absolute standard deviation")
    calibration_relative: NotNegative = key(0.0, "sensor model: relative error of a whole sensor")
    clock_offset_s: float = key(0.0, "sensor model: how far the logger's clock is ahead")

    def table(self) -> dict[str, Any]:
        """Options of `stats.measured.read`, without the path."""
        return self.model_dump(exclude={"path", "kind", *SENSOR_MODEL})

    def sensor_model(self) -> dict[str, Any]:
        """Options of `virtual.sensor_model.simulate`, without the seed."""
        return self.model_dump(include=SENSOR_MODEL)

    def sensor_error(self) -> dict[str, float]:
        """Options of `stats.predictive.SensorError`: of the sensor model, or its defaults."""
        if self.kind != "virtual":
            return {}
        model = self.model_dump(include=SENSOR_MODEL - {"clock_offset_s"})
        return model | {"radiation_relative": 0.0}
