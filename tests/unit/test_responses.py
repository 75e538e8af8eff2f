"""Tables of sensors' responses, and the names that the configuration knows."""

import pytest

from dapple.errors import InputError
from dapple.optics import responses

TABLE = "angle_deg,response\n0,2\n60,1.1\n90,0\n"


def written(folder, text):
    path = folder / "response.csv"
    path.write_text(text)
    return path


def test_a_table_is_read_over_the_response_at_the_normal(tmp_path):
    found = responses.read(written(tmp_path, TABLE))
    assert found == ((0.0, 1.0), (60.0, 0.55), (90.0, 0.0))


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("angle,response\n0,1\n", "angle_deg"),
        ("angle_deg,response\n", "angles of no row"),
        ("angle_deg,response\n5,1\n90,0\n", "angles 5, 90"),
        ("angle_deg,response\n0,1\n60,0.5\n", "angles 0, 60"),
        ("angle_deg,response\n0,1\n60,0.5\n60,0.4\n90,0\n", "angles 0, 60, 60, 90"),
        ("angle_deg,response\n0,1\n80,0\n90,0\n", "responses 1, 0, 0"),
        ("angle_deg,response\n0,1\n60,half\n90,0\n", "half"),
        ("angle_deg,response\n0,1\n60\n90,0\n", "numbers in the columns"),
        ("angle_deg,response\n0,1\n60,nan\n90,0\n", "responses 1, nan, 0"),
    ],
)
def test_a_table_that_is_no_response_is_refused_with_what_was_found(tmp_path, text, found):
    with pytest.raises(InputError, match=rf"response\.csv.*{found}"):
        responses.read(written(tmp_path, text))


def test_every_named_response_is_one_that_a_table_could_hold(tmp_path):
    for response in responses.NAMED.values():
        rows = "".join(f"{angle},{value}\n" for angle, value in response)
        assert responses.read(written(tmp_path, f"angle_deg,response\n{rows}")) == response
