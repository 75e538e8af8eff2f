"""Files of every format, each broken in the ways in which files break: one message that helps.

A message names the file, says what was found and expected, and what to do. Where that is to correct
or to remove a line, the test does so, and the file is read.
"""

import re
from collections.abc import Callable, Iterator
from typing import NamedTuple

import pytest
from tests.fuzz import seeds

from dapple.errors import InputError

COMMA = ("radiation.csv", "toa5.dat", "nsrdb.csv", "records.csv", "hobo_3_7.csv", "sensors.csv",
         "positions.csv", "bark.csv", "camera.csv", "sky.csv")  # fmt: skip
SEMICOLON = ("german.csv", "dwd.txt", "wide.csv", "leaf.csv")
DELIMITERS = dict.fromkeys(COMMA, ",") | dict.fromkeys(SEMICOLON, ";") | {"pangaea.tab": "\t"}
TABLES = tuple(DELIMITERS)
CLOUDS = ("points.txt", "points.csv", "points.pts", "points.asc.xyz", "ascii.ply", "scan.ptx",
          "shots.txt", "leg000_points.xyz")  # fmt: skip
OTHERS = ("mesh.obj", "discs.def", "grid.vox", "response.csv", "crowns.geojson")
BINARY = ("points.las", "points.laz", "points.ply", "old.las", "old.laz", "scans.e57", "points.pcd",
          "mesh.ply", "images.tif", "packed.tif", "maps.tif", "crowns.gpkg")  # fmt: skip
VALUE_COLUMN = {"dwd.txt": 4, "nsrdb.csv": 5, "toa5.dat": 2, "records.csv": 3, "hobo_3_7.csv": 2}
"""Where a number stands that counts; elsewhere in the second column."""
ROW = -2
"""The line that is broken, from the end."""

Edit = Callable[[str], str]


class Case(NamedTuple):
    """A way of breaking a file, what is said of it, and how the remedy is followed."""

    name: str
    how: str
    edit: Edit
    found: str
    mend: Edit | None = None

    @property
    def label(self) -> str:
        return f"{self.name}: {self.how}"


def changed_line(change: Callable[[str], str], row: int = ROW) -> Edit:
    """The file with one line changed."""

    def edit(text: str) -> str:
        lines = text.splitlines()
        lines[row] = change(lines[row])
        return "\n".join(lines) + "\n"

    return edit


def without_line(text: str, row: int = ROW) -> str:
    lines = text.splitlines(keepends=True)
    del lines[row]
    return "".join(lines)


def with_cell(delimiter: str, column: int, value: str, row: int = ROW) -> Edit:
    def change(line: str) -> str:
        cells = line.split(delimiter)
        cells[column] = value
        return delimiter.join(cells)

    return changed_line(change, row)


def without_last_cell(delimiter: str) -> Edit:
    return changed_line(lambda line: line.rsplit(delimiter, 1)[0])


def again_otherwise(delimiter: str, column: int) -> Edit:
    """The last row once more, with another value."""
    return lambda text: text + with_cell(delimiter, column, "77", -1)(text.splitlines()[-1] + "\n")


def of_tables() -> Iterator[Case]:
    page = "<html><body>404</body></html>\n"
    for name in TABLES:
        cell, delimiter = VALUE_COLUMN.get(name, 1), DELIMITERS[name]
        yield Case(name, "empty", lambda text: "", "an empty file")
        yield Case(name, "an error page", lambda text: page, "columns <html>")
        yield Case(name, "other columns", lambda text: "alpha,beta\n1,2\n3,4\n", "alpha, beta")
        middle = "\0\0\0"
        yield Case(
            name,
            "noughts in the middle",
            lambda text, middle=middle: text[: len(text) // 2] + middle + text[len(text) // 2 :],
            "a binary file",
        )
        if name != "positions.csv":
            word = with_cell(delimiter, cell, "abc")
            yield Case(name, "a word for a number", word, "'abc'", without_line)
        cut = without_last_cell(delimiter)
        if name != "dwd.txt":  # whose lines end with a word that nobody needs
            yield Case(name, "a cell missing", cut, r"\d cells", without_line)
        if name not in ("nsrdb.csv", "sky.csv", "camera.csv"):
            twice = "two|twice|more than once"
            last = again_otherwise(delimiter, cell)
            yield Case(
                name,
                "a row twice with two values",
                last,
                twice,
                lambda text: without_line(text, -1),
            )


def of_clouds() -> Iterator[Case]:
    for name in CLOUDS:
        yield Case(name, "empty", lambda text: "", r"an empty file \(0 bytes\)")
        yield Case(name, "an error page", lambda text: "<html>404</html>\n", ".")
        yield Case(name, "other columns", lambda text: "alpha,beta\n1,2\n", ".")
        yield Case(name, "blank", lambda text: "\n\n \n", ".")
    for name, delimiter in (("points.txt", " "), ("points.asc.xyz", " "), ("points.csv", ";")):
        for word in ("nan", "inf", "1e400"):
            edit = with_cell(delimiter, 1, word)
            yield Case(name, word, edit, "coordinates that are no numbers", without_line)
        yield Case(name, "a word", with_cell(delimiter, 1, "abc"), "'abc'", without_line)
        cut = changed_line(lambda line, d=delimiter: line.split(d)[0])
        yield Case(name, "cut", cut, "coordinates that are no numbers|cells", without_line)
    yield Case("ascii.ply", "a row missing", without_line, "39|row|truncated|fewer")
    yield Case("ascii.ply", "a word", with_cell(" ", 1, "abc"), "'abc'")
    yield Case("scan.ptx", "a shot missing", without_line, "11 of the 12 shots")
    yield Case("scan.ptx", "a word", with_cell(" ", 1, "abc"), "'abc'")
    yield Case("shots.txt", "no direction", with_cell(" ", 5, "nan"), "a direction", without_line)
    yield Case(
        "leg000_points.xyz",
        "a pulse that is not there",
        with_cell(" ", 7, "99"),
        "points of pulses that are not there",
        without_line,
    )


def of_others() -> Iterator[Case]:
    for name in OTHERS:
        yield Case(name, "empty", lambda text: "", ".")
        yield Case(name, "an error page", lambda text: "<html>404</html>\n", ".")
        yield Case(name, "other columns", lambda text: "alpha,beta\n1,2\n", ".")
        yield Case(name, "cut in the middle", lambda text: text[: len(text) // 2 - 1], ".")
    for word in ("abc", "nan", "inf"):
        vertex = with_cell(" ", 3, word, 2)
        yield Case("mesh.obj", f"a vertex at {word}", vertex, word)
        disc = with_cell(" ", 2, word)
        yield Case("discs.def", f"a disc at {word}", disc, "abc|line 19", without_line)
    yield Case("mesh.obj", "a face of nothing", lambda text: text + "f 1 2 77\n", "vertex 77",
               lambda text: without_line(text, -1))  # fmt: skip
    yield Case("mesh.obj", "a face of two", lambda text: text + "f 1 2\n", "2 corners",
               lambda text: without_line(text, -1))  # fmt: skip
    yield Case("discs.def", "no radius", with_cell(" ", 0, "0"), "line 19", without_line)
    yield Case("discs.def", "a negative radius", with_cell(" ", 0, "-1"), "line 19", without_line)
    yield Case("grid.vox", "a negative density", with_cell(" ", 3, "-2"), "density of -2",
               with_cell(" ", 3, "0"))  # fmt: skip
    yield Case("grid.vox", "an infinite density", with_cell(" ", 3, "inf"), "density of inf",
               with_cell(" ", 3, "NaN"))  # fmt: skip
    yield Case("grid.vox", "a voxel missing", without_line, "3 voxels")
    yield Case("grid.vox", "a voxel twice", with_cell(" ", 1, "1"), "twice")
    yield Case("grid.vox", "a voxel outside", with_cell(" ", 0, "7"), "outside")
    yield Case("response.csv", "a word", with_cell(",", 1, "abc"), "line 3: found 45, abc",
               without_line)  # fmt: skip
    yield Case("response.csv", "an infinite response", with_cell(",", 1, "inf"), "inf",
               without_line)  # fmt: skip
    yield Case("response.csv", "not up to 90", lambda text: without_line(text, -1), "0, 45",
               lambda text: text + "90,0\n")  # fmt: skip
    yield Case("response.csv", "backwards", with_cell(",", 0, "95"), "0, 95, 90", without_line)
    yield Case("camera.csv", "a wavelength twice", with_cell(",", 0, "400"), "29 different",
               without_line)  # fmt: skip
    yield Case("camera.csv", "a negative response", with_cell(",", 1, "-5"), "from -5",
               with_cell(",", 1, "0"))  # fmt: skip
    yield Case("sky.csv", "a negative radiance", with_cell(",", 2, "-5"), "radiance of -5")
    yield Case("bark.csv", "more light than comes", with_cell(",", 1, "7.5", 20), r"7\.5")
    yield Case("bark.csv", "only blue", lambda text: "".join(text.splitlines(keepends=True)[:9]),
               "390 to 460 nm")  # fmt: skip
    yield Case("leaf.csv", "more light than comes", with_cell(";", 2, "99", 20), "more|light|99")
    yield Case("sensors.csv", "infinitely high", with_cell(",", 3, "inf"), "inf", without_line)
    yield Case("sensors.csv", "nowhere", with_cell(",", 1, ""), r"at \(, 2, 3\)",
               without_line)  # fmt: skip
    yield Case("records.csv", "as bright as ten suns", with_cell(",", 3, "25000"), "25000|2.5e",
               without_line)  # fmt: skip
    yield Case("records.csv", "below nought", with_cell(",", 3, "-900"), "-900", without_line)
    yield Case("records.csv", "no such day", with_cell(",", 2, "2023-02-30 10:00"), "2023-02-30",
               without_line)  # fmt: skip
    yield Case("radiation.csv", "no such hour", with_cell(",", 0, "2023-08-10 25:00:00"), "25:00",
               without_line)  # fmt: skip
    yield Case("crowns.geojson", "degrees beyond the pole",
               lambda text: text.replace("47.", "147."), ".")  # fmt: skip


CASES = [*of_tables(), *of_clouds(), *of_others()]


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Sound files by name, and their text."""
    made = seeds.make(tmp_path_factory.mktemp("sound"))
    return {one.path.name: (one, one.path.read_bytes()) for one in made}


def refused(seed, content):
    seed.path.write_bytes(content)
    with pytest.raises(InputError) as error:
        seed.read(seed.path)
    said = error.value
    assert seed.path.stem.split("_")[0] in str(said.where)
    assert said.found
    assert said.expected
    assert said.remedy
    assert not list(seed.path.parent.glob(".partial-*"))
    return said


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.label)
def test_a_broken_text_says_where_and_what_and_reads_once_mended(sound, case):
    seed, content = sound[case.name]
    text = content.decode()
    try:
        said = refused(seed, case.edit(text).encode())
        assert re.search(case.found, f"{said.where}: found {said.found}"), str(said)
        if case.mend:
            seed.path.write_text(case.mend(case.edit(text)), encoding="utf-8")
            seed.read(seed.path)
    finally:
        seed.path.write_bytes(content)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.5])
@pytest.mark.parametrize("name", BINARY)
def test_a_binary_file_that_was_cut_off_is_refused(sound, name, share):
    seed, content = sound[name]
    try:
        refused(seed, content[: int(share * len(content))])
    finally:
        seed.path.write_bytes(content)


@pytest.mark.parametrize("name", BINARY)
def test_an_error_page_in_place_of_a_binary_file_is_refused(sound, name):
    seed, content = sound[name]
    try:
        refused(seed, b"<html><body>404 not found</body></html>\n" * 20)
    finally:
        seed.path.write_bytes(content)


def test_each_case_has_a_name_of_its_own_and_there_are_many():
    labels = [case.label for case in CASES]
    assert len(set(labels)) == len(labels)
    assert len(CASES) + 4 * len(BINARY) >= 200
    assert sum(case.mend is not None for case in CASES) >= 50
