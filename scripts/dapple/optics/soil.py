"""Reflectance of bare soil from its brightness and moisture."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from dapple.errors import InputError
from dapple.optics.bands import camera_mean
from dapple.optics.cameras import Camera

GSV_NM = np.arange(400.0, 2501.0, 10.0)
DRY_VECTORS, MOISTURE_VECTOR = "DryVec.txt", "SMVec.txt"

Soil = Callable[[np.ndarray, np.ndarray], np.ndarray]


def read_gsv(folder: str | Path) -> tuple[np.ndarray, np.ndarray]:
    """Read the general spectral vectors of Jiang and Fang (2019).

    Parameters
    ----------
    folder : path
        Holds `DryVec.txt` (three rows) and `SMVec.txt` (one row), each of 211 numbers: 400 to
        2500 nm in steps of 10 nm.

    Returns
    -------
    dry : (3, 211) float64
    moisture : (211,) float64

    Raises
    ------
    InputError
        A file is missing or of another shape.
    """
    tables = []
    for name, shape in ((DRY_VECTORS, (3, len(GSV_NM))), (MOISTURE_VECTOR, (len(GSV_NM),))):
        path = Path(folder) / name
        if not path.is_file():
            raise InputError(
                path, "no file", "the soil vectors of Jiang and Fang (2019)",
                "Correct the path, or leave it empty to use the two soils of prosail.",
            )  # fmt: skip
        table = np.loadtxt(path)
        if table.shape != shape:
            raise InputError(
                path, f"numbers in the shape {table.shape}", f"{shape}",
                "One vector a row, 400 to 2500 nm in steps of 10 nm.",
            )  # fmt: skip
        tables.append(table)
    return tables[0], tables[1]


def gsv(
    dry: np.ndarray,
    moisture_vector: np.ndarray,
    camera: Camera,
    *,
    shape: tuple[float, float] = (0.0, 0.0),
) -> Soil:
    """A soil made of the general spectral vectors.

    Parameters
    ----------
    dry, moisture_vector : (3, 211), (211,) float
        See `read_gsv`.
    camera : Camera
    shape : two floats
        Second and third dry coefficient, as shares of the first.

    Returns
    -------
    callable
        (brightness (n,), moisture (n,)) to reflectance (n, b), float64, 0 to 1.

    Notes
    -----
    Jiang and Fang (2019) write reflectance as c1 D1 + c2 D2 + c3 D3 + cSM SM. Here the first
    coefficient is the brightness B (D1 alone is an ordinary mineral soil that brightens from
    blue to infrared), the others follow from it, and cSM = -B m with the moisture m, so that
    water takes away a share that does not depend on brightness:

        r = B (D1 + s2 D2 + s3 D3 - m SM), cut off at 0 and 1.

    At m = 1 the soil has lost 35 to 44 % of its reflectance in the camera's bands and all of it
    in the water bands near 2 µm, which is why m is taken as a share of saturation.
    """
    line = camera_mean(GSV_NM, dry[0] + shape[0] * dry[1] + shape[1] * dry[2], camera)
    water = camera_mean(GSV_NM, moisture_vector, camera)

    def reflectance(brightness: np.ndarray, moisture: np.ndarray) -> np.ndarray:
        bright, wet = np.broadcast_arrays(*np.atleast_1d(brightness, moisture))
        return np.clip(bright[:, None] * (line - wet[:, None] * water), 0.0, 1.0)

    return reflectance


def two_soils(camera: Camera) -> Soil:
    """A mixture of the dry and the wet soil that come with the Python package `prosail`.

    Parameters
    ----------
    camera : Camera

    Returns
    -------
    callable
        (brightness (n,), moisture (n,)) to reflectance (n, b): brightness times
        (1 - moisture) dry + moisture wet, cut off at 0 and 1.
    """
    import prosail

    soils = prosail.spectral_lib.soil
    table_nm = np.arange(400.0, 2501.0)
    dry, wet = camera_mean(table_nm, np.array([soils.rsoil1, soils.rsoil2]), camera)

    def reflectance(brightness: np.ndarray, moisture: np.ndarray) -> np.ndarray:
        bright, share = np.broadcast_arrays(*np.atleast_1d(brightness, moisture))
        mixed = (1.0 - share[:, None]) * dry + share[:, None] * wet
        return np.clip(bright[:, None] * mixed, 0.0, 1.0)

    return reflectance


def choose(camera: Camera, folder: str | Path = "") -> Soil:
    """The soil model: GSV where a folder with its vectors is given, else prosail's two soils."""
    return gsv(*read_gsv(folder), camera) if str(folder) else two_soils(camera)
