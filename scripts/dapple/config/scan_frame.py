"""The regular angular frame of a single real scan."""

from __future__ import annotations

from dapple.config.base import Count, Section, key


class ScanFrame(Section):
    """The regular angular frame of a single scan, from which its misses are rebuilt."""

    n_zenith: Count = key(2082, "shots in a line")
    n_azimuth: Count = key(580, "lines")
    zenith_deg: tuple[float, float] = key((30.0, 130.024), "first and last zenith in the scanner")
    azimuth_deg: tuple[float, float] = key((0.0, 359.90), "first and last azimuth in the scanner")
    tilt_deg: tuple[float, float, float] = key((1.026, 0.760, -110.019), "roll, pitch, yaw")
