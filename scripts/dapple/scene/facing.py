"""Where sensors face."""

import numpy as np
import pandas as pd

from dapple.frames import direction_from_angles


def facing_of(sensors: pd.DataFrame) -> np.ndarray | None:
    """Unit normals (n, 3) of sensors, or None where all are level and look up.

    Parameters
    ----------
    sensors : pandas.DataFrame
        With `tilt_deg` and `azimuth_deg` where any is tilted; see `scene.sensors.turned`.
    """
    if "tilt_deg" not in sensors or not sensors["tilt_deg"].any():
        return None
    return direction_from_angles(sensors["tilt_deg"].to_numpy(), sensors["azimuth_deg"].to_numpy())
