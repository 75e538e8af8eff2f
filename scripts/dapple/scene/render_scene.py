"""A Mitsuba scene whose sun, sky and colours can be set without building it anew.

Mitsuba's three colour channels serve as three spectral bands.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from types import ModuleType
from typing import Any

import numpy as np

from dapple.errors import InputError
from dapple.scene.scene_optics import Optics

LEAF_COLOURS = ("reflectance", "transmittance")
OPAQUE_COLOURS = ("reflectance.value", "brdf_0.reflectance.value")
"""Mitsuba's names of the colours of leaves and of opaque surfaces, with one face or two."""


@dataclass
class RenderScene:
    """A Mitsuba scene whose sun and sky can be set without rebuilding it.

    Attributes
    ----------
    mi : module
        `mitsuba` in the variant that the scene belongs to.
    scene : mitsuba.Scene
    n_bands : int
        Bands in use, 1 to 3; the remaining channels repeat the last one.
    ground_z_m : float
    variant : str
        Of Mitsuba.
    sky_shape : (rows, columns)
        Of the sky map.
    medium : mitsuba.Medium or None
    medium_box_m : (2, 3) float64 or None
        Low and high corner of the box that the medium fills.
    bsdfs : sequence of (str, mitsuba.BSDF)
        What the surfaces of each name of optics are made of.
    """

    mi: ModuleType
    scene: Any
    n_bands: int
    ground_z_m: float
    variant: str
    sky_shape: tuple[int, int]
    medium: Any = None
    medium_box_m: np.ndarray | None = None
    bsdfs: Sequence[tuple[str, Any]] = ()

    def __post_init__(self) -> None:
        self._parameters = self.mi.traverse(self.scene)
        self._parameters.keep(["sun.to_world", "sun.irradiance.value", "sky.data", "sky.scale"])

    @property
    def integrator(self) -> str:
        """The name of the Mitsuba integrator that the scene needs."""
        return "path" if self.medium is None else "volpath"

    def in_medium(self, points_m: np.ndarray) -> np.ndarray:
        """Whether points (..., 3) lie in the box that the turbid medium fills."""
        if self.medium_box_m is None:
            return np.zeros(points_m.shape[:-1], dtype=bool)
        low, high = self.medium_box_m
        return ((points_m > low) & (points_m < high)).all(axis=-1)

    def set_optics(self, optics: Optics) -> None:
        """Give the surfaces of meshes and the ground other colours, in as many bands as before."""
        for name, bsdf in self.bsdfs:
            parameters = self.mi.traverse(bsdf)
            if name in optics.transmittance:
                colours = dict(zip(LEAF_COLOURS, leaf_shares(optics, name), strict=True))
            else:
                colours = {key: grey(optics, name)["value"] for key in OPAQUE_COLOURS}
            for key, colour in colours.items():
                if key in parameters:
                    parameters[key] = self.mi.Color3f(*colour)
            parameters.update()

    def set_sun(self, direction: np.ndarray, beam_normal: np.ndarray) -> None:
        """Let parallel light come from `direction` (3,) with irradiance `beam_normal` (n_bands,).

        Rays do not meet this sun: it only lights what scatters. Nothing needs rebuilding.
        """
        beam = channels(beam_normal, self.n_bands, fill=0.0)
        self._parameters["sun.irradiance.value"] = self.mi.Color3f(*beam.tolist())
        self._parameters["sun.to_world"] = self.mi.Transform4f(facing(self.mi, -direction))
        self._parameters.update()

    def set_sky(
        self,
        relative_radiance: Callable[[np.ndarray, np.ndarray], np.ndarray],
        diffuse_horizontal: np.ndarray,
    ) -> None:
        """Fill the sky map.

        Parameters
        ----------
        relative_radiance : callable
            Of zenith and azimuth [deg], arrays of the same shape; of any scale.
        diffuse_horizontal : (n_bands,) array
            Irradiance of the open sky on the level; the map is scaled to give it exactly.
        """
        light = channels(diffuse_horizontal, self.n_bands, fill=0.0)
        if light.any():
            self._fill_sky(sky_map(relative_radiance, self.sky_shape)[:, :, None] * light, 1.0)
        else:
            # a black map cannot be sampled: keep a bright one and scale it to nothing
            self._fill_sky(np.ones((*self.sky_shape, 3)), 0.0)

    def set_even_sky(self, radiance: np.ndarray) -> None:
        """Give all directions, those below the horizon too, the same radiance (n_bands,)."""
        light = channels(radiance, self.n_bands, fill=0.0)
        self._fill_sky(np.broadcast_to(light, (*self.sky_shape, 3)), 1.0)

    def _fill_sky(self, radiance: np.ndarray, scale: float) -> None:
        # Mitsuba's map repeats its first column at the end
        closed = np.concatenate([radiance, radiance[:, :1]], axis=1)
        self._parameters["sky.data"] = self.mi.TensorXf(closed.astype(np.float32))
        self._parameters["sky.scale"] = self.mi.Float(scale)
        self._parameters.update()


def channels(values: np.ndarray, n_bands: int, fill: float | None = None) -> np.ndarray:
    """Fill (n_bands,) values up to three channels, with `fill` or the last value."""
    values = np.atleast_1d(np.asarray(values, dtype=np.float64))
    if values.shape != (n_bands,):
        raise InputError(
            "bands",
            f"values of shape {values.shape}",
            f"one value for each of the {n_bands} bands of the scene",
            "Sum the bands with scene.group_flux first.",
        )
    last = values[-1] if fill is None else fill
    return np.concatenate([values, np.full(3 - n_bands, last)])


def sky_map(
    relative_radiance: Callable[[np.ndarray, np.ndarray], np.ndarray], shape: tuple[int, int]
) -> np.ndarray:
    """Radiance on a grid of directions, scaled to unit irradiance on the level.

    Parameters
    ----------
    relative_radiance : callable
        Of zenith and azimuth [deg].
    shape : (rows, columns)
        Rows run from the zenith to the nadir, both included; an odd number of them puts one on
        the horizon. Columns run clockwise from half a column east of north.

    Returns
    -------
    (rows, columns) float64
        0 below the horizon. The light that the interpolation leaks into the first row below it
        meets the ground from beneath.
    """
    rows, columns = shape
    zenith = np.linspace(0.0, np.pi, rows)
    up = zenith <= 0.5 * np.pi + 1e-9
    azimuth_deg = (np.arange(columns) + 0.5) * 360.0 / columns
    # skies go as exp(b / cos zenith): the horizon itself is a limit
    zenith_deg = np.minimum(np.degrees(zenith[up]), 89.99)
    radiance = np.zeros(shape)
    radiance[up] = relative_radiance(*np.meshgrid(zenith_deg, azimuth_deg, indexing="ij"))
    weight = _row_weights(rows) * (2.0 * np.pi / columns)
    return radiance / (radiance * weight[:, None]).sum()


@cache
def _row_weights(rows: int) -> np.ndarray:
    """Integral of cos z sin z dz over the upper hemisphere with each row's interpolation weight."""
    step = np.pi / (rows - 1)
    fine = (np.arange(200_000) + 0.5) * (0.5 * np.pi / 200_000)
    place = fine / step
    row = place.astype(np.int64)
    value = np.cos(fine) * np.sin(fine) * (0.5 * np.pi / len(fine))
    part = place - row
    weight = np.bincount(row, value * (1.0 - part), rows)
    return weight + np.bincount(row + 1, value * part, rows)


def leaf_shares(optics: Optics, name: str) -> tuple[list[float], list[float]]:
    """Reflectance and transmittance of a leaf in three channels; no share of light is an error."""
    shares = [
        channels(values, len(optics))
        for values in (optics.reflectance_of(name), optics.transmittance_of(name))
    ]
    for what, share in zip(
        ("reflectance", "transmittance", "albedo"), (*shares, shares[0] + shares[1]), strict=True
    ):
        _check_share(f"{name} {what}", share)
    return tuple(np.minimum(share, 1.0).tolist() for share in shares)


def grey(optics: Optics, name: str) -> dict:
    """Reflectance of an opaque surface as one of Mitsuba's colours."""
    share = channels(optics.reflectance_of(name), len(optics))
    _check_share(f"{name} reflectance", share)
    return {"type": "rgb", "value": np.minimum(share, 1.0).tolist()}


def _check_share(where: str, share: np.ndarray) -> None:
    if share.min() < 0.0 or share.max() > 1.0 + 1e-6:
        found = f"{share.min():.3g} to {share.max():.3g}"
        raise InputError(where, found, "0 to 1", "Check the spectra.")


def facing(mi: ModuleType, way: np.ndarray) -> Any:
    """Transform that turns Mitsuba's z axis to the unit vector `way`."""
    aside = [0.0, 1.0, 0.0] if abs(way[2]) > 0.7 else [0.0, 0.0, 1.0]
    target = np.asarray(way).tolist()
    return mi.ScalarTransform4f().look_at(origin=[0.0, 0.0, 0.0], target=target, up=aside)
