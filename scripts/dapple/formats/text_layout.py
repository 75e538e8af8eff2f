"""How a text table of points is laid out: encoding, header, separator, decimal sign, units."""

import csv
import re
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

from dapple.errors import InputError

HEAD_LINES = 200
LONGEST_LINE = 1 << 16
NUMBER = re.compile(r"[-+]?(\d+([.,]\d*)?|[.,]\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)", re.IGNORECASE)
MARKS = "/#%!;' \t"
"""Signs before a header that other programs take for a comment."""

AXES = (
    {
        "x",
        "easting",
        "east",
        "e",
        "rechtswert",
        "ostwert",
        "ost",
        "este",
        "longitude",
        "lon",
        "lng",
    },
    {"y", "northing", "north", "n", "hochwert", "nordwert", "nord", "norte", "latitude", "lat"},
    {"z", "h", "height", "elevation", "elev", "altitude", "alt", "hoehe", "up", "cota", "quota"},
)
AXIS_WORDS = re.compile(r"points?|vertex|coordinates?|coords?|koordinate|position|pos|utm|world")
"""What programs put before or behind the name of an axis: `POINT_X`, `coord. X`, `xcoord`."""
NUMBERED = re.compile(r"(points|coordinates|xyz|position)\W?([012])")
"""How ParaView calls parts of vectors: `Points:0`."""
DEGREES = {"longitude", "lon", "lng", "latitude", "lat"}
UNITS = {
    "": 1.0,
    "m": 1.0,
    "metre": 1.0,
    "meter": 1.0,
    "cm": 0.01,
    "mm": 0.001,
    "ft": 0.3048,
    "feet": 0.3048,
    "usft": 1200 / 3937,
    "ussurveyfoot": 1200 / 3937,
}


@dataclass(frozen=True)
class Axis:
    """What the name of a column says: x, y or z (0 to 2), metres of its unit, or degrees.

    Of several columns, one whose name has the letter itself (`is_letter`) is that axis.
    """

    axis: int
    metres: float = 1.0
    degrees: bool = False
    is_letter: bool = False


@dataclass(frozen=True)
class Layout:
    """How to read a table.

    Attributes
    ----------
    skip : int
        Lines before the first row of numbers.
    names : tuple of str
        Of the columns, none of them twice.
    separator : str
        As pandas takes it.
    decimal : str
        "." or ",".
    encoding : str
    width : int
        Fields of the first row.
    header : tuple of str or None
        The names as the file has them.
    announced : int or None
        Number of points that a line before the first row tells.
    """

    skip: int
    names: tuple[str, ...]
    separator: str
    decimal: str
    encoding: str
    width: int
    header: tuple[str, ...] | None
    announced: int | None = None

    def named(self, names: tuple[str, ...]) -> "Layout":
        """The same with other names of columns."""
        return replace(self, names=names)


def find(path: Path) -> Layout | None:
    """Look at the first lines of a file; None where it has no row of numbers.

    Raises
    ------
    InputError
        There is a header without x, y and z, or no table at all.
    """
    encoding = _encoding(path)
    with path.open(encoding=encoding, errors="replace") as handle:
        lines = list(islice(iter(lambda: handle.readline(LONGEST_LINE), ""), HEAD_LINES))
    for number, line in enumerate(lines):
        if line.lstrip().startswith("#"):
            continue
        if fields := _fields(line):
            separator, decimal, words = fields
            names, header = _names(path, lines[:number], separator, words)
            counts = [int(text) for text in map(str.strip, lines[:number]) if _is_count(text)]
            announced = counts[-1] if counts else None
            width = len(words)
            return Layout(number, names, separator, decimal, encoding, width, header, announced)
    words = [word for line in lines[-3:] for word in line.split()]
    titled = any(_has_axes(line) for line in lines)
    if not words or (titled and not any(len(re.findall(r"\d", word)) > 1 for word in words)):
        return None
    raise no_table(path, "no row of numbers: '" + " ".join(words)[:80] + "'")


def axis(name: str) -> Axis | None:
    """The axis that a column is, if it is one: `X[mm]` is x in millimetres."""
    text = name.strip().strip('"').lstrip("/# ").lower()
    unit = ""
    if bracket := re.search(r"[\[(]([^\])]*)[\])]\s*$", text):
        unit, text = re.sub(r"[^a-z°]", "", bracket[1]), text[: bracket.start()]
    elif suffix := re.fullmatch(r"(.*)_(m|cm|mm|ft|feet)", text.strip()):
        text, unit = suffix[1], suffix[2]
    if part := NUMBERED.fullmatch(text.strip()):
        return Axis(int(part[2]), UNITS.get(unit, 1.0), is_letter=True)
    letters = re.sub(r"[^a-zö]", "", text).replace("ö", "oe")
    bare = AXIS_WORDS.sub("", letters)
    for number, known in enumerate(AXES):
        if letters in known or (len(bare) == 1 and bare in known):
            degrees = letters in DEGREES or unit in ("deg", "degree", "degrees", "°")
            return Axis(number, UNITS.get(unit, 1.0), degrees, bare == "xyz"[number])
    return None


def _is_count(text: str) -> bool:
    """A line that holds one whole number alone: the number of points that follow."""
    return re.fullmatch(r"\d{1,18}", text) is not None


def _encoding(path: Path) -> str:
    with path.open("rb") as handle:
        head = handle.read(1 << 16)
    if head.startswith((b"\xff\xfe", b"\xfe\xff")):
        return "utf-16"
    if head.startswith(b"\xef\xbb\xbf"):
        return "utf-8-sig"
    try:
        head[: len(head) - 4].decode("utf-8")
    except UnicodeDecodeError:
        return "latin-1"
    return "utf-8"


def _fields(line: str) -> tuple[str, str, list[str]] | None:
    """Separator, decimal sign and fields of a row of three numbers or more; None of another."""
    text = line.strip()
    if not text or _is_count(text):
        return None
    for separator in (";", "\t", "|", r"\s+", ","):
        words = _split(text, separator)
        if len(words) < 3 or not all(NUMBER.fullmatch(word) for word in words[:3]):
            continue
        comma = any("," in word for word in words[:3])
        if comma and any("." in word for word in words[:3]):
            continue
        return separator, "," if comma else ".", words
    return None


def _split(text: str, separator: str) -> list[str]:
    if separator == r"\s+":
        words = text.split()
    elif '"' in text:  # a separator between quotes is none
        words = next(
            csv.reader([text.replace("\r", " ")], delimiter=separator, skipinitialspace=True)
        )
    else:
        words = text.split(separator)
    return [word.strip().strip('"') for word in words]


def _names(
    path: Path, before: list[str], separator: str, words: list[str]
) -> tuple[tuple[str, ...], tuple[str, ...] | None]:
    """Names of the columns: those of a header among the lines before the first row, or numbers."""
    width = len(words)
    units: tuple[str, ...] = ()
    for line in reversed(before):
        text = line.strip().lstrip(MARKS)
        if not text or _is_count(text):
            continue
        if _has_axes(text):
            names = _header_words(path, text, separator, width)
            names = tuple(
                f"{name} [{units[k]}]" if k < len(units) and units[k] and axis(name) else name
                for k, name in enumerate(names)
            )
            return _unique(names, width, words), names
        fields = _split(text, separator)
        if bare := _unit_row(fields):
            units = bare
            continue
        if len(fields) == width and not line.lstrip().startswith(tuple(MARKS[:4])):
            raise no_table(path, f"the columns '{text[:80]}'")
    return ("X", "Y", "Z", *(f"column_{k}" for k in range(4, width + 1))), None


def _unit_row(fields: list[str]) -> tuple[str, ...]:
    """Units of the columns where a line holds nothing but such, as `[m] [m] [m] [dB]`; else ()."""
    bare = tuple(re.sub(r"[\[\]()]", "", field).strip().lower() for field in fields)
    lengths = [unit for unit in bare if unit and unit in UNITS]
    are_units = len(lengths) >= 3 and all(len(unit) <= 6 and not unit.isdigit() for unit in bare)
    return bare if are_units else ()


def _header_words(path: Path, text: str, separator: str, width: int) -> tuple[str, ...]:
    """Names of a header, which may be separated in another way than the rows."""
    options = [tuple(_split(text, one)) for one in (separator, ";", ",", "\t", "|", r"\s+")]
    options = [words for words in options if _axes_of(words) == {0, 1, 2}]
    # The way that gives as many names as there are fields, else the first that has the axes.
    fitting = [words for words in options if len(words) == width] or options
    if not fitting:
        raise no_table(path, f"the columns '{text[:80]}'")
    return fitting[0]


def _unique(names: tuple[str, ...], width: int, words: list[str]) -> tuple[str, ...]:
    found: list[str] = []
    for number, name in enumerate(names, 1):
        name = name or f"column_{number}"
        while name in found:
            name += "_"
        found.append(name)
    if width == len(found) + 1 and not words[-1]:  # a separator at the end of every row
        found.append("nothing")
    return tuple(found)


def _axes_of(words) -> set[int]:
    return {found.axis for word in words if (found := axis(word)) is not None}


def _has_axes(text: str) -> bool:
    return any(
        _axes_of(re.split(pattern, text.strip().lstrip(MARKS))) == {0, 1, 2}
        for pattern in (r"[\s,;|]+", r"[,;\t|]")
    )


def no_table(path: Path, found: str) -> InputError:
    """The error of a text that is no table of points."""
    return InputError(
        path,
        found,
        "a table of numbers with columns X Y Z (header optional; further columns need one)",
        "Correct the line, or export again with a header such as 'X Y Z Reflectance'.",
    )
