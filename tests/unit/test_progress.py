"""How far a long step is, in its log and on the terminal."""

import io
import sys
from contextlib import redirect_stdout

import pytest

from dapple import progress
from dapple.progress import Progress, duration, followed


class Clock:
    """Seconds that go by when they are told to."""

    def __init__(self):
        self.now = 0.0

    def __call__(self):
        return self.now


def slowly(things, clock, seconds):
    for thing in things:
        clock.now += seconds
        yield thing


def test_a_step_that_takes_less_than_ten_seconds_says_nothing(capsys):
    clock = Clock()
    assert list(followed(slowly(range(5), clock, 1.9), "shots", 5, clock=clock)) == [0, 1, 2, 3, 4]
    assert capsys.readouterr().out == ""


def test_a_long_step_says_how_much_is_done_how_long_it_takes_and_when_it_is_done(capsys):
    clock = Clock()
    list(followed(slowly(range(4), clock, 100), "shots", 4, clock=clock))
    assert capsys.readouterr().out.splitlines() == [
        "shots: 25 %, about 5 min left",
        "shots: 50 %, about 3 min left",
        "shots: 75 %, about 2 min left",
        "shots: done in 7 min",
    ]


def test_things_count_as_much_as_they_are_large(capsys):
    clock = Clock()
    parts = slowly(["abc", "d"], clock, 30)
    list(followed(parts, "letters", 4, size=len, clock=clock))
    assert capsys.readouterr().out.splitlines()[0] == "letters: 75 %, about 10 s left"


def test_lines_are_ten_seconds_and_one_per_cent_apart(capsys):
    clock = Clock()
    list(followed(slowly(range(10_000), clock, 3600 / 10_000), "paths", 10_000, clock=clock))
    assert len(capsys.readouterr().out.splitlines()) <= 100
    list(followed(slowly(range(10_000), clock, 60 / 10_000), "paths", 10_000, clock=clock))
    assert len(capsys.readouterr().out.splitlines()) <= 6


def test_a_total_that_turns_out_to_be_less_only_moves_on(capsys):
    clock = Clock()
    rays = Progress("rays", 100, clock)
    for total in (100, 40):
        clock.now += 20
        rays.total = total
        rays.add(10)
    shown = [line.split()[1] for line in capsys.readouterr().out.splitlines()]
    assert shown == ["10", "50"]


def test_the_terminal_hears_which_step_speaks_past_its_log(tmp_path, monkeypatch):
    terminal = io.StringIO()
    monkeypatch.setattr(sys, "__stderr__", terminal)
    log = tmp_path / "results/apple/logs/transport/polygons/0.log"
    log.parent.mkdir(parents=True)
    with log.open("w") as file, redirect_stdout(file):
        progress.say("paths: 40 %, about 30 s left")
    assert log.read_text() == "paths: 40 %, about 30 s left\n"
    assert terminal.getvalue() == "dapple: transport/polygons/0: paths: 40 %, about 30 s left\n"


def test_nothing_at_all_is_done_at_once():
    assert list(followed([], "shots")) == []


@pytest.mark.parametrize(
    ("seconds", "said"), [(0.2, "1 s"), (40, "40 s"), (170, "3 min"), (7800, "2 h 10 min")]
)
def test_durations_are_said_as_people_do(seconds, said):
    assert duration(seconds) == said
