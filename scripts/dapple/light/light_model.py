"""How finely light is computed: what is kept of sun, sky and spectra, and with how many rays."""

from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

from dapple.light.tolerances import DIRECT_SHARE, PATH_SHARE
from dapple.light.visibility import Sunlit
from dapple.optics.responses import COSINE, Response
from dapple.scene.scene_optics import Optics, group_bands, group_flux
from dapple.scene.surfaces import GROUND
from dapple.sky.sky_radiance import FLUXES, isotropic


@dataclass(frozen=True)
class Model:
    """How finely light is computed.

    Attributes
    ----------
    sun : {"disc", "point"}
    sky_patches : int
        Subdivision of the sky.
    sky : {"as given", "isotropic"}
        Whether light keeps the distribution over the sky that its dataset has.
    max_orders : int
        Most surfaces on a path of light.
    ground : {"lambertian", "black"}
    bands : int
        Groups of bands of like leaves, 1 to 3; the number of all bands or more: all.
    step_min : float
        Minutes between times at which the sun's disc is traced; in between its visible share is
        interpolated. Not above the step of the series: every time is traced.
    """

    sun: str = "disc"
    sky_patches: int = 2305
    sky: str = "as given"
    max_orders: int = 255
    ground: str = "lambertian"
    bands: int = 61
    step_min: float = 0.0

    def as_dict(self) -> dict[str, Any]:
        """Names and values, for files."""
        return asdict(self)


@dataclass(frozen=True)
class Tracing:
    """How many rays are traced, whatever the model, and what of; a stage is told what it needs.

    Attributes
    ----------
    paths, sky_rays : int
        Paths and straight rays to the sky of every sensor at first.
    max_shadow_rays : int
        Most shadow rays of a sensor at a time.
    tolerance : float
        Standard error of light that is enough, as a share of the open sky's.
    max_growth : float
        Rays to the sky and paths grow up to so many times until this error is reached; 1: they
        stay as many as they are.
    sun_diameter_deg, aperture_m, sun_kernel_deg : float
        As in `visibility.sunlit` and `tensor.sun_radiance`.
    response : Response
        Of the sensors.
    """

    paths: int = 0
    sky_rays: int = 0
    max_shadow_rays: int = 0
    tolerance: float = np.nan
    max_growth: float = 1.0
    sun_diameter_deg: float = np.nan
    sun_kernel_deg: float = np.nan
    aperture_m: float = 0.0
    response: Response = COSINE

    @property
    def sun_tolerance(self) -> float:
        """Standard error of the sun's visible share at which shadow rays are enough."""
        return DIRECT_SHARE * self.tolerance

    @property
    def path_tolerance(self) -> float:
        """Standard error of sky and scattered light at which paths are enough."""
        return PATH_SHARE * self.tolerance

    def finer(self, factor: int) -> "Tracing":
        """With so many times as many rays, and the error that goes with them."""
        return replace(
            self,
            paths=self.paths * factor,
            sky_rays=self.sky_rays * factor,
            max_shadow_rays=self.max_shadow_rays * factor,
            tolerance=self.tolerance / np.sqrt(factor),
        )


def simplified(sky: xr.Dataset, optics: Optics, model: Model) -> tuple[xr.Dataset, Optics]:
    """The sky and the optical properties that a model keeps.

    Parameters
    ----------
    sky, optics, model
        As in `steps.products`.

    Returns
    -------
    sky, optics
        In fewer bands where the model groups them; the photon flux of all is the same.
    """
    if model.sky == "isotropic":
        sky = isotropic(sky)
    if model.ground == "black":
        optics = optics.with_black(GROUND)
    if model.bands < len(optics):
        flux = {name: sky[name].transpose("time", "band").to_numpy() for name in FLUXES}
        direct, diffuse = flux.values()
        optics, group = group_bands(optics, direct, diffuse, model.bands)
        sky = sky.drop_dims("band").assign(
            {
                name: (("time", "band"), group_flux(values, group, model.bands))
                for name, values in flux.items()
            }
        )
    return sky, optics


def thinned(minutes: np.ndarray, step_min: float) -> np.ndarray:
    """Indices of times at least `step_min` apart, the first and the last among them."""
    chosen = [0]
    for index, minute in enumerate(minutes):
        if minute - minutes[chosen[-1]] >= step_min - 1e-6 and index:
            chosen.append(index)
    return np.unique([*chosen, len(minutes) - 1])


def interpolated(seen: Sunlit, known: np.ndarray, wanted: np.ndarray) -> Sunlit:
    """The share of the disc that is seen at more times, linear between those that are known.

    Parameters
    ----------
    seen : Sunlit
        At `known` times.
    known, wanted : (k,), (t,) float
        Times in one unit, ascending; those wanted lie within the known.
    """
    before = np.clip(np.searchsorted(known, wanted, side="right") - 1, 0, len(known) - 2)
    part = (wanted - known[before]) / (known[before + 1] - known[before])

    def between(values: np.ndarray) -> np.ndarray:
        return values[..., before] * (1 - part) + values[..., before + 1] * part

    return Sunlit(between(seen.share), between(seen.standard_error), seen.n_rays[:, before])
