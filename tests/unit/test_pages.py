"""Numbers of README and docs are those of the tables in docs/data, and every table has a maker."""

import re

import pytest
from tools import pages

LIGHT = "engine,scene,seconds,share\ntransport,polygons,9.284,0.3213\ntransport,voxels,5.11,-0.08\n"


@pytest.fixture
def data(tmp_path):
    (tmp_path / "light.csv").write_text(LIGHT)
    pages.read.cache_clear()
    return tmp_path


@pytest.mark.parametrize("page", pages.pages(), ids=lambda path: path.name)
def test_pages_hold_the_numbers_of_the_tables(page):
    pages.read.cache_clear()
    assert page.read_text() == pages.fill(page.read_text()), "run `make docs`"


def test_a_number_is_replaced_with_the_digits_that_it_had(data):
    mark = "<!-- light[transport, polygons].seconds -->"
    assert pages.fill(f"takes 9.9 s{mark}.", data) == f"takes 9.3 s{mark}."
    mark = "<!-- 100*light[transport, polygons].share -->"
    assert pages.fill(f"is **+1.00 %**{mark}", data) == f"is **+32.13 %**{mark}"
    mark = "<!-- 1000*light[transport, polygons].seconds -->"
    assert pages.fill(f"1,234 ms{mark}", data) == f"9,284 ms{mark}"


def test_only_the_number_before_a_mark_is_touched(data):
    mark = "<!-- light[transport, voxels].seconds -->"
    assert pages.fill(f"7 to 8 s{mark}, 9", data) == f"7 to 5 s{mark}, 9"


def test_a_small_negative_number_is_written_as_nought_without_a_sign(data):
    mark = "<!-- light[transport, voxels].share -->"
    assert pages.fill(f"bias 1{mark}", data) == f"bias 0{mark}"


def test_a_block_writes_a_line_for_each_row(data):
    head = "| scene | s |\n|---|---|\n"
    block = f"<!-- lines\n{head}light[transport]: | {{scene}} | {{seconds:.1f}} |\n-->\n"
    table = f"{head}| polygons | 9.3 |\n| voxels | 5.1 |\n"
    assert pages.fill(f"{block}| old |\n\nbelow\n", data) == f"{block}{table}\nbelow\n"


def test_a_block_may_name_single_cells(data):
    block = "<!-- lines\n| {light[transport, voxels].share:+.2f} |\n-->\n"
    assert pages.fill(block, data) == f"{block}| -0.08 |\n"


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("1<!-- dark[a].b -->", "no table"),
        ("1<!-- light[transport].seconds -->", "2 rows"),
        ("1<!-- light[transport, points].seconds -->", "0 rows"),
        ("1<!-- light[transport, voxels].minutes -->", "no column"),
        ("<!-- lines\nlight[mitsuba]: | {seconds} |\n-->\n", "no row"),
        ("<!-- lines\nlight: | {minutes} |\n-->\n", "no column"),
    ],
)
def test_a_number_that_no_table_has_is_refused(data, text, found):
    with pytest.raises(pages.PageError, match=found):
        pages.fill(text, data)


def test_every_table_says_which_command_makes_it():
    """And the command names a script, a configuration or a test that is there."""
    text = (pages.DATA / "README.md").read_text()
    made = dict(re.findall(r"^\| `(\w+)\.csv` \| `([^`]+)` \|", text, re.MULTILINE))
    assert set(made) == {path.stem for path in pages.DATA.glob("*.csv")}
    for table, command in made.items():
        files = re.findall(r"[\w/-]+\.(?:py|yaml)\b", command)
        assert files, f"{table}.csv: `{command}` names no file"
        for file in files:
            assert (pages.ROOT / file).is_file(), f"{table}.csv: no {file}"
