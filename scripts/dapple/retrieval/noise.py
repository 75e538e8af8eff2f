"""What simulated bands do not know: calibration, sensor noise, scenes unlike the real one.

A network that learns from simulations alone learns differences between bands that are finer than
any camera or model. On real bands, which are a little off, they mislead it. Disturbed bands teach
it what can be relied on.
"""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Noise:
    """Gaussian errors of reflectance, as standard deviations.

    Attributes
    ----------
    relative, relative_common : float
        Shares of the value: of every band on its own, and of all bands together.
    absolute, absolute_common : float
        Reflectance: of every band on its own, and of all bands together.

    Notes
    -----
    The form is that of the neural networks of Weiss and Baret (2016, S2ToolBox Level 2 products),
    who take 0.02 for the shares and 0.01 for reflectance after atmospheric correction.
    """

    relative: float = 0.05
    relative_common: float = 0.2
    absolute: float = 0.002
    absolute_common: float = 0.002

    def add(self, features: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Bands (n, b) with errors of their own, float32."""
        whole, entry = features.shape, (len(features), 1)
        own, common, own_shift, common_shift = (
            rng.standard_normal(shape, np.float32) for shape in (whole, entry, whole, entry)
        )
        factor = 1.0 + self.relative * own + self.relative_common * common
        shift = self.absolute * own_shift + self.absolute_common * common_shift
        return (features * factor + shift).astype(np.float32)
