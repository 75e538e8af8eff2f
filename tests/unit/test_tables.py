"""Tables come back as they were written, labels as labels."""

import pandas as pd
import pytest

from dapple.errors import InputError
from dapple.formats import tables

TABLE = pd.DataFrame(
    {
        "sensor": ["3_10", "0.10"],
        "time": pd.DatetimeIndex(["2023-08-10 10:30", "2023-08-10 10:40"], tz="UTC"),
        "par": [1234.56789, 2.0],
        "n": [1, 2],
    }
)


@pytest.mark.parametrize("name", ["records.csv", "records.parquet"])
def test_labels_stay_text_and_times_stay_utc(tmp_path, name):
    tables.write(tmp_path / name, TABLE)
    again = tables.read(tmp_path / name)
    assert again["sensor"].tolist() == ["3_10", "0.10"]
    assert (again["time"] == TABLE["time"]).all()
    assert again["par"].to_numpy() == pytest.approx(TABLE["par"].to_numpy(), rel=1e-5)
    assert again["n"].dtype == "int64"


def test_numbers_have_the_digits_that_were_asked_for(tmp_path):
    for digits, text in ((tables.DIGITS, "1234.57"), ("%.1f", "1234.6"), (None, "1234.56789")):
        tables.write(tmp_path / "t.csv", TABLE, digits)
        assert (tmp_path / "t.csv").read_text().splitlines()[1].split(",")[2] == text


def test_a_table_that_is_missing_or_empty_is_named(tmp_path):
    (tmp_path / "empty.csv").touch()
    for name, found in (("none.csv", "no file"), ("empty.csv", "nothing")):
        with pytest.raises(InputError, match=f"{name}: found {found}"):
            tables.read(tmp_path / name)


def test_half_a_table_is_never_left(tmp_path):
    with pytest.raises(AttributeError):
        tables.write(tmp_path / "t.csv", None)
    assert not list(tmp_path.iterdir())
