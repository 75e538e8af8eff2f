"""Multispectral cameras: a band a row."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from dapple.errors import InputError

NEAR_INFRARED_NM = (760.0, 1000.0)
RED_EDGE_NM = 700.0
"""Leaves absorb most light of shorter waves and scatter most of longer ones."""


@dataclass(frozen=True)
class Band:
    """A band of a camera.

    Attributes
    ----------
    name : str
        As in images and tables.
    centre_nm, width_nm : float
        The band is flat from half the width below to half the width above its centre [nm].
    response : tuple of (float, float)
        Instead: wavelengths [nm], ascending, and relative response there, linear between.
    """

    name: str
    centre_nm: float
    width_nm: float
    response: tuple[tuple[float, float], ...] = ()


@dataclass(frozen=True)
class Camera:
    """Bands in the order of their images."""

    bands: tuple[Band, ...]

    def __len__(self) -> int:
        return len(self.bands)

    def __iter__(self) -> Iterator[Band]:
        return iter(self.bands)

    @property
    def names(self) -> tuple[str, ...]:
        """Of all bands."""
        return tuple(band.name for band in self.bands)

    def at_centres(self, spectrum: Sequence[tuple[float, float]]) -> tuple[float, ...]:
        """Values at the centres of the bands.

        Parameters
        ----------
        spectrum : sequence of (float, float)
            Wavelengths [nm], ascending, and values: linear between, the same beyond the ends.
        """
        found = []
        for band in self.bands:
            below = [point for point in spectrum if point[0] <= band.centre_nm]
            above = [point for point in spectrum if point[0] >= band.centre_nm]
            (low, first), (high, last) = (below or above[:1])[-1], (above or below[-1:])[0]
            share = (band.centre_nm - low) / (high - low) if high > low else 0.0
            found.append(first + share * (last - first))
        return tuple(found)

    def is_infrared(self, first: int) -> bool:
        """Whether one of three bands, traced together, is one that leaves scatter."""
        return any(band.centre_nm > RED_EDGE_NM for band in self.bands[first : first + 3])

    @property
    def near_infrared(self) -> int:
        """Number of the first near infrared band, which tells sunlit from shaded leaves.

        Raises
        ------
        InputError
            The camera has none.
        """
        low, high = NEAR_INFRARED_NM
        for number, band in enumerate(self.bands):
            if low <= band.centre_nm <= high:
                return number
        raise InputError(
            "chlorophyll.bands",
            f"centres at {', '.join(f'{band.centre_nm:g}' for band in self.bands)} nm",
            f"a band between {low:g} and {high:g} nm, by which sunlit leaves are known",
            "Add the near infrared band of the camera.",
        )


def _named(*rows: tuple[float, float]) -> Camera:
    """A camera whose bands are called by their centres."""
    return Camera(tuple(Band(f"{centre:g}", centre, width) for centre, width in rows))


ZHAO = _named((450.0, 32.0), (560.0, 32.0), (650.0, 32.0), (730.0, 32.0), (840.0, 52.0))
"""Blue, green, red, red edge and near infrared of a multispectral UAV camera (Zhao et al. 2025)."""
_REDEDGE_MX = _named((475.0, 32.0), (560.0, 27.0), (668.0, 14.0), (717.0, 12.0), (842.0, 57.0))
CAMERAS = {
    "p4m": ZHAO,
    "mavic3m": _named((560.0, 32.0), (650.0, 32.0), (730.0, 32.0), (860.0, 52.0)),
    "rededge-m": _named((475.0, 20.0), (560.0, 20.0), (668.0, 10.0), (717.0, 10.0), (840.0, 40.0)),
    "rededge-mx": _REDEDGE_MX,
    "altum": _REDEDGE_MX,
    "sequoia": _named((550.0, 40.0), (660.0, 40.0), (735.0, 10.0), (790.0, 40.0)),
    "sentinel-2": _named((492.0, 66.0), (560.0, 36.0), (665.0, 31.0), (704.0, 15.0), (740.0, 15.0),
                         (783.0, 20.0), (833.0, 106.0)),
}  # fmt: skip
"""Nominal centres and widths; Altum's thermal band is none of reflectance."""


def camera(rows: Sequence[tuple[str, float, float]], responses: str | Path = "") -> Camera:
    """A camera from a table.

    Parameters
    ----------
    rows : sequence of (str, float, float)
        Name, centre and width [nm] of each band.
    responses : path or ""
        Table of response curves: `wavelength_nm` and a column of each band's name; bands that it
        does not name stay flat.

    Raises
    ------
    InputError
        No such file, no wavelengths or one twice, cells of a band that are no numbers, or a
        response below 0.
    """
    bands = tuple(Band(*row) for row in rows)
    if not responses:
        return Camera(bands)
    curves = _curves(responses, [band.name for band in bands])
    return Camera(
        tuple(Band(b.name, b.centre_nm, b.width_nm, curves.get(b.name, ())) for b in bands)
    )


def _curves(path: str | Path, names: Sequence[str]) -> dict[str, tuple[tuple[float, float], ...]]:
    """Response curves of those bands that the table has, by ascending wavelength."""
    # Needs pandas, which the configuration, where bands have their defaults from, does without.
    from dapple.formats import user_tables

    table = user_tables.read(path)
    wavelength = table.column(["wavelength_nm"], "the camera's responses").tolist()
    if len(set(wavelength)) < max(2, len(wavelength)):
        raise InputError(
            path,
            f"{len(wavelength)} rows with {len(set(wavelength))} different wavelengths",
            "two or more wavelengths, each once",
            "Average the rows of one wavelength, or copy the file again.",
        )
    curves = {}
    for name in filter(lambda name: table.find([name]), names):
        response = table.column([name], "").tolist()
        if not min(response) >= 0 or not max(response) > 0:
            raise InputError(
                f"{path}, column {name!r}",
                f"responses from {min(response):g} to {max(response):g}",
                "0 or more, and more than 0 somewhere",
                "Set noise below 0 to 0; check that the column is this band's response.",
            )
        curves[name] = tuple(sorted(zip(wavelength, response, strict=True)))
    return curves
