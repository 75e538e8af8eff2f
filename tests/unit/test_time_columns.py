"""Times in several columns are read as they were written, at every minute of a day."""

import pandas as pd
import pytest

from dapple.sky.radiation_table import read

WAYS = {
    "date,time": "%Y-%m-%d,%H:%M",
    "Datum,Uhrzeit": "%d.%m.%Y,%H:%M:%S",
    "date,clock": "%Y%m%d,%H:%M",
    "date,hhmm": "%Y-%m-%d,%H%M",
    "day,time": "%Y-%m-%d,%I:%M:%S %p",
    "year,doy,hhmm": "%Y,%j,%H%M",
    "year,doy,hour,minute": "%Y,%j,%H,%M",
    "year,month,day,time": "%Y,%m,%d,%H:%M:%S",
    "year,month,day,hour,minute": "%Y,%m,%d,%H,%M",
    "Year,Month,Day,Hour,Minute,Second": "%Y,%m,%d,%H,%M,%S",
}


@pytest.mark.parametrize("names", WAYS)
def test_every_minute_in_columns_is_read_as_it_was_written(tmp_path, names):
    step = "30s" if "Second" in names else "1min"
    index = pd.date_range("2023-08-10", periods=1445, freq=step, tz="UTC", unit="ns")
    rows = "".join(f"{text},{k}\n" for k, text in enumerate(index.strftime(WAYS[names])))
    (tmp_path / "a.csv").write_text(f"{names},global [W/m2]\n{rows}")
    found = read(tmp_path / "a.csv", timezone="UTC").table
    assert (found.index == index).all()
    assert found["global_w_m2"].tolist() == list(range(1445))
