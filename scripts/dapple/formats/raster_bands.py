"""Which band of a raster is which band of a camera: by name, wavelength, colour or order."""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Protocol

from dapple.errors import InputError

COLOURS_NM = {
    "blue": (430.0, 505.0),
    "green": (505.0, 595.0),
    "red": (610.0, 695.0),
    "rededge": (695.0, 755.0),
    "nir": (755.0, 1000.0),
}
"""Where bands of these names lie."""
WORDS = {
    "rededge": r"red ?edge|rot ?kante|\bre\b|\bvre\b|\breg\b",
    "nir": r"infra ?red|infra ?rot|infra ?rouge|infra ?rojo|\bnir\b|^n$",
    "blue": r"\bblue|\bblau|\bbleu|\bazul|^b$",
    "green": r"\bgreen|\bgrün|\bgruen|\bvert\b|\bverde|^g$",
    "red": r"\bred\b|\brot\b|\brouge|\brojo|^r$",
}
WAVELENGTH_TAGS = ("wavelength", "central_wavelength", "centralwavelength", "center_wavelength",
                   "wavelength_nm", "centre_wavelength")  # fmt: skip
LEAST_TOLERANCE_NM = 10.0
BY_ORDER = "by order, for they have no names"
"""How bands were found that only their order tells."""


class CameraBand(Protocol):
    """What is known of a camera's band."""

    name: str
    centre_nm: float
    width_nm: float


def wavelength_nm(description: str, tags: Mapping[str, str]) -> float | None:
    """Centre of a band as its metadata or its name have it, or None [nm]."""
    by_name = {key.lower().replace(" ", "_"): str(value) for key, value in tags.items()}
    for name in WAVELENGTH_TAGS:
        if found := re.search(r"\d+(?:\.\d+)?", by_name.get(name, "")):
            value = float(found[0])
            return 1e3 * value if value < 30.0 else value
    if found := re.search(r"(?<!\d)(\d{3,4}(?:\.\d+)?)(?!\d)\s*(?:nm)?", description):
        value = float(found[1])
        return value if 350.0 <= value <= 2500.0 else None
    if found := re.search(r"(?<![\d.])(0?\.\d+)\s*(?:um|µm|micro)", description.lower()):
        return 1e3 * float(found[1])
    return None


def colour(description: str) -> str | None:
    """The colour that a name tells, or None."""
    if re.fullmatch(r"[a-z]\d+", description.lower().strip()):
        return None  # B5 is a number, not blue
    text = " ".join(re.findall(r"[^\W\d_]+", description.lower()))
    return next((name for name, words in WORDS.items() if re.search(words, text)), None)


def match(
    camera: Sequence[CameraBand],
    descriptions: Sequence[str],
    tags: Sequence[Mapping[str, str]],
    *,
    order: Sequence[int] = (),
    where: str | Path,
    hint: str = "",
) -> tuple[list[int], str]:
    """Indices of a raster's bands in the order of a camera's, and how they were found.

    Parameters
    ----------
    camera : sequence of bands
    descriptions, tags : sequences
        Name and metadata of every band of the raster that is no mask.
    order : sequence of int
        Numbers of the raster's bands from 1, as the user declares them.
    where : str or path
        The file, for messages.
    hint : str
        What else would help, for messages.

    Raises
    ------
    InputError
        A band of the camera that is not there, or that several are.
    """
    if order:
        if len(order) != len(camera) or not all(1 <= k <= len(descriptions) for k in order):
            raise InputError(
                where,
                f"{len(descriptions)} bands, `band_order: {list(order)}`",
                f"{len(camera)} numbers from 1 to {len(descriptions)}",
                "Give the number of the image's band for each band of the camera.",
            )
        return [k - 1 for k in order], "as `band_order` says"
    names = [band.name for band in camera]
    if set(names) <= set(descriptions):
        return [list(descriptions).index(name) for name in names], "by name"
    centres = [wavelength_nm(*one) for one in zip(descriptions, tags, strict=True)]
    colours = [colour(one) for one in descriptions]
    for kind, how in ((centres, "by wavelength"), (colours, "by colour")):
        if any(value is not None for value in kind):
            return [_of(band, camera, kind, descriptions, where, hint) for band in camera], how
    if len(descriptions) == len(camera) and not any(map(_is_named, descriptions)):
        return list(range(len(camera))), BY_ORDER
    raise InputError(
        where,
        f"bands {', '.join(text or '(no name)' for text in descriptions)}",
        f"bands {', '.join(names)}",
        "Write the wavelength in nm as each band's description, or set `band_order`."
        + (f" {hint}" if hint else ""),
    )


def _of(
    band: CameraBand,
    camera: Sequence[CameraBand],
    kind: Sequence[float | str | None],
    descriptions: Sequence[str],
    where: str | Path,
    hint: str,
) -> int:
    """The one band that fits a camera's."""
    if any(isinstance(value, str) for value in kind):
        in_colour = {
            name for name, (low, high) in COLOURS_NM.items() if low <= band.centre_nm < high
        }
        rivals = [other.name for other in camera if _colours_at(other.centre_nm) & in_colour]
        fits = [k for k, value in enumerate(kind) if value in in_colour]
        fits = fits if len(rivals) == 1 else []
    else:
        tolerance = max(0.5 * band.width_nm, LEAST_TOLERANCE_NM)
        fits = [
            k
            for k, value in enumerate(kind)
            if isinstance(value, float) and abs(value - band.centre_nm) <= tolerance
        ]
    if len(fits) == 1:
        return fits[0]
    found = ", ".join(descriptions[k] for k in fits) if fits else "none"
    raise InputError(
        where,
        f"bands {', '.join(text or '(no name)' for text in descriptions)}; {found} at "
        f"{band.centre_nm:g} nm",
        f"one band at {band.centre_nm:g} nm ({band.name})",
        "Choose the camera that took the images in `chlorophyll.camera`, or set `band_order`."
        + (f" {hint}" if hint else ""),
    )


def _colours_at(centre_nm: float) -> set[str]:
    return {name for name, (low, high) in COLOURS_NM.items() if low <= centre_nm < high}


def _is_named(description: str) -> bool:
    """Whether a description is more than a number that a program gave."""
    return not re.fullmatch(r"(?:band|b|layer)?[\s_-]*\d{0,2}", description.lower().strip())
