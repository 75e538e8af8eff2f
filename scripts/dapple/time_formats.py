"""Ways in which people write times: which of them a column has."""

import re

import numpy as np
import pandas as pd

from dapple.errors import InputError

ISO = "ISO8601"
# Tried in this order; a column has the first in which every row is a time.
CLEAR = (
    "%Y%m%d%H%M",
    "%Y%m%d%H%M%S",
    "%Y%m%d%H:%M",
    "%Y%m%d:%H%M",
    "%Y%m%d %H:%M",
    "%Y%m%d %H:%M:%S",
    "%Y%m%d %H%M",
    "%Y%m%d %H%M%S",
    "%d.%m.%Y %H:%M",
    "%d.%m.%Y %H:%M:%S",
    "%d.%m.%y %H:%M",
    "%d.%m.%y %H:%M:%S",
    "%d.%m.%Y %H.%M",
    "%d.%m.%Y %H.%M.%S",
    "%Y-%m-%d %H.%M",
    "%Y-%m-%d %H.%M.%S",
    "%Y-%m-%d %I:%M %p",
    "%Y-%m-%d %I:%M:%S %p",
    "%d.%m.%Y %I:%M %p",
    "%d.%m.%Y %I:%M:%S %p",
    "%Y%m%d%H",
    "%d-%b-%Y %H:%M",
    "%d-%b-%Y %H:%M:%S",
    "%d %b %Y %H:%M",
    "%d %b %Y %H:%M:%S",
    "%b %d %Y %H:%M",
    "%b %d %Y %H:%M:%S",
    "%d %B %Y %H:%M",
    "%B %d %Y %H:%M",
    "%d. %b %Y %H:%M",
    "%d. %b %Y %H:%M:%S",
    "%d %b %Y %I:%M %p",
    "%b %d %Y %I:%M %p",
    "%d-%b-%y %H:%M",
    "%d-%b-%y %H:%M:%S",
)
CLOCKS = ("%H:%M", "%H:%M:%S", "%H:%M:%S.%f", "%I:%M %p", "%I:%M:%S %p")
DAY_FIRST, MONTH_FIRST = (
    [f"{date}{year} {clock}" for clock in CLOCKS for year in ("%Y", "%y")]
    for date in ("%d/%m/", "%m/%d/")
)
YEAR_FIRST = [f"%y/%m/%d {clock}" for clock in CLOCKS]
YEAR_BEFORE = r"^(\d{4})[-./](\d\d?)[-./](\d\d?)[ _](\d\d?)(?=[:. \d]|$)"
MONTHS = {
    "Jan": "january januar jänner janvier janv enero ene gennaio gen januari janeiro",
    "Feb": "february februar feber fevrier février févr fevr febrero febbraio februari fevereiro "
    "fev",
    "Mar": "march märz maerz mär mrz mars marzo maart mrt março marco",
    "Apr": "april avril avr abril abr aprile",
    "May": "mai mayo maggio mag mei maj maio",
    "Jun": "june juni juin junio giugno giu junho",
    "Jul": "july juli juillet juil julio luglio lug julho",
    "Aug": "august août aout agosto ago augustus augusti",
    "Sep": "september sept septembre septiembre settembre set setembro",
    "Oct": "october oktober okt octobre octubre ottobre ott outubro out",
    "Nov": "november novembre noviembre novembro",
    "Dec": "december dezember dez décembre decembre déc diciembre dic dicembre dezembro des",
}
"""Months in languages of Europe, by the letters that English writes them with."""
MONTH_OF = {name: month for month, names in MONTHS.items() for name in names.split()}
WEEKDAY = rf"^(?!(?:{'|'.join(MONTHS)})\b)[^\W\d_]{{2,10}}\.?\s+(?=\d)"
HALF_DAY = r"(?<=\d)\s*([AaPp])(?:\.?\s?[Mm])?\.?$"
"""AM, p.m. and a behind a time."""
FIRST_YEAR, LAST_YEAR = 1950, 2100
A_GAP = pd.Timedelta(days=2)
"""Rows of one table are rarely further apart: more tells that day and month are exchanged."""


def naive(text: pd.Series, where: str, time_format: str = "") -> pd.DatetimeIndex:
    """Times without a zone from text.

    Parameters
    ----------
    text : pandas.Series of str
        Without offsets.
    where : str
        File and column, for messages.
    time_format : str
        See `times.parse`.

    Raises
    ------
    InputError
        Text that is no time, in no known way of writing; or days and months that may be exchanged.
    """
    if time_format:
        return _declared(text, where, time_format)
    plain = (
        text.str.replace(r"(?<=\d)T(?=\d)", " ", regex=True)
        .str.replace(r",(?=\s)", "", regex=True)
        .str.replace(",", ".")
    )
    plain = plain.str.replace(HALF_DAY, r" \1M", regex=True)
    plain = plain.str.replace(r"\s*Uhr$", "", regex=True)
    plain = plain.str.replace(r"[^\W\d_]{3,}\.?", _in_english, regex=True)
    plain = plain.str.replace(WEEKDAY, "", regex=True).str.upper()
    plain = plain.str.replace(YEAR_BEFORE, _in_full, regex=True)
    plain, next_day = _midnights(plain)
    way, found = _first_of([ISO, *CLEAR], plain)
    if way.startswith("%d.%m."):
        found = _by_steps(plain, way, found)
    if found is None:
        # 8/10/2023, 8-10-2023 and 8.10.2023: which is the day?
        slashed = plain.str.replace(r"^(\d\d?)[-.](\d\d?)[-.](\d{2,4})", r"\1/\2/\3", regex=True)
        orders = [DAY_FIRST, MONTH_FIRST]
        if plain.str.match(r"\d\d-\d\d-\d\d ").all():
            orders.append(YEAR_FIRST)
        found = _day_or_month(slashed, where, orders)
    if found is None:
        raise _no_time(text, plain, where)
    return pd.DatetimeIndex(found) + pd.to_timedelta(next_day.to_numpy().astype(int), unit="D")


def _in_english(match: re.Match[str]) -> str:
    """The month that a word is, in three letters; 10. is 10 before it."""
    return MONTH_OF.get(match[0].lower().rstrip("."), match[0])


def _in_full(match: re.Match[str]) -> str:
    """A day with its year before it as ISO 8601 has it, and two digits of the hour."""
    year, month, day, hour = match.groups()
    return f"{year}-{month:0>2}-{day:0>2} {hour:0>2}"


def _by_steps(text: pd.Series, way: str, by_day: pd.Series | None) -> pd.Series | None:
    """Days and months with points, which Americans exchange: as the rows follow each other."""
    by_month = _first_of([way.replace("%d.%m.", "%m.%d.")], text)[1]
    if by_day is None or by_month is None:
        return by_day
    longest = [times.sort_values().diff().max() for times in (by_day, by_month)]
    return by_month if longest[1] <= A_GAP < longest[0] else by_day


def _declared(text: pd.Series, where: str, time_format: str) -> pd.DatetimeIndex:
    if time_format in ("epoch", "excel"):
        numbers = pd.to_numeric(text.str.replace(",", "."), errors="coerce")
        unit, origin = ("s", "unix") if time_format == "epoch" else ("D", "1899-12-30")
        if time_format == "epoch" and numbers.min() > 1e11:  # milliseconds
            numbers = numbers / 1e3
        times = pd.to_datetime(numbers, unit=unit, origin=origin, errors="coerce")
        times = times.dt.round("s") if time_format == "excel" else times
    else:
        plain = text.str.replace(HALF_DAY, r" \1M", regex=True) if "%p" in time_format else text
        time_format = re.sub(r"\s*%p", " %p", time_format)
        plain, next_day = _midnights(plain)
        times = pd.to_datetime(plain, format=time_format, errors="coerce")
        times = times + pd.to_timedelta(next_day.astype(int), unit="D")
    if (wrong := times.isna()).any():
        raise InputError(
            f"{where}, line {text.index[wrong][0]}",
            f"'{text[wrong].iloc[0]}'",
            f"a time written as `time_format: {time_format}` says",
            "Correct the row or the format.",
        )
    return pd.DatetimeIndex(times)


def _midnights(text: pd.Series) -> tuple[pd.Series, pd.Series]:
    """24:00 as 00:00, and whether a row was so."""
    # Behind a day: in 11:24:00 the 24 are minutes.
    is_24 = text.str.contains(r"(?:^|[^\d:.]|^\d{8}:?)24:?00(?::?00)?$", regex=True)
    plain = text.where(~is_24, text.str.replace(r"24(:?00(?::?00)?)$", r"00\1", regex=True))
    return plain, is_24


def _first_of(formats: list[str], text: pd.Series) -> tuple[str, pd.Series | None]:
    """The first format in which every row is a time, and these times."""
    for one in formats:
        if one == ISO and not text.str.match(r"^\d{4}-\d{2}-\d{2}").all():
            continue  # "20230810" alone, or a number, is not meant
        only_digits = re.fullmatch(r"(?:%[YmdHMS])+", one)
        if only_digits and not text.str.fullmatch(rf"\d{{{len(one) + 2}}}").all():
            continue  # their number tells the format: 2023081010 is no 01:00
        times = pd.to_datetime(text, format=one, errors="coerce")
        if times.notna().all() and times.dt.year.between(FIRST_YEAR, LAST_YEAR).all():
            return one, times
    return "", None


def _day_or_month(text: pd.Series, where: str, orders: list[list[str]]) -> pd.Series | None:
    """The one order of day, month and year in which rows are times, steps considered."""
    found: list[tuple[str, pd.Series]] = []
    for order in orders:
        way, times = _first_of(order, text)
        if times is not None and not any(times.equals(other) for _, other in found):
            found.append((way, times))
    close = [one for one in found if one[1].sort_values().diff().max() <= A_GAP]
    if len(found) < 2 or len(close) == 1:
        chosen = found if len(found) < 2 else close
        return chosen[0][1] if chosen else None
    ways = " or ".join(f"'{way}'" for way, _ in found)
    raise InputError(
        where,
        f"{text.iloc[0]}, which may be "
        + " or ".join(f"{times.iloc[0]:%d %B %Y}" for _, times in found),
        "a day and a month that can be told apart",
        f"Set `time_format` of this table to {ways}, or write times in ISO 8601 "
        "(2023-08-10 10:10:00).",
    )


def _no_time(text: pd.Series, plain: pd.Series, where: str) -> InputError:
    """Names the row that stops the way of writing that fits the others."""
    if text.str.fullmatch(r"\d{5,19}(\.\d+)?").all():
        number = float(text.iloc[0])
        hint = (
            "Set `time_format: epoch`."
            if len(text.iloc[0].split(".")[0]) in (9, 10, 12, 13)
            else "Set `time_format: excel`."
            if 20_000 < number < 60_000
            else "Seconds since 1970 have ten digits; write times in full, in ISO 8601."
        )
        return InputError(where, f"numbers such as {text.iloc[0]}", "times", hint)
    best = np.zeros(len(text), bool)
    for one in (ISO, *CLEAR, *DAY_FIRST, *MONTH_FIRST):
        fits = pd.to_datetime(plain, format=one, errors="coerce").notna().to_numpy()
        best = fits if fits.sum() > best.sum() else best
    row = int(best.argmin())
    has_clock = bool(re.search(r"\d:\d|\d{10}", text.iloc[row]))
    return InputError(
        f"{where}, line {text.index[row]}",
        f"'{text.iloc[row]}'" + ("" if has_clock else ", a day without a time"),
        "times such as 2023-08-10 10:10:00",
        "Write times in ISO 8601, or set `time_format` for this table.",
    )
