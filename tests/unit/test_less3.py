"""A program that waits for ever is begun anew; one that fails is not."""

import pytest

from dapple import less3
from dapple.programs import ProgramError

WAITS = "import time; time.sleep(1000)"


def script(folder, text):
    path = folder / "script.py"
    path.write_text(text)
    return path


def test_a_run_that_waits_for_ever_is_begun_anew_and_ends(tmp_path):
    once = f"""
import pathlib, sys
mark = pathlib.Path(sys.argv[1]) / "begun"
if not mark.exists():
    mark.touch()
    {WAITS}
print("light")
"""
    assert less3.run(script(tmp_path, once), tmp_path, idle_limit_s=0.5) == "light\n"


def test_a_run_that_always_waits_is_given_up_with_a_word(tmp_path):
    with pytest.raises(ProgramError, match=r"5 attempts that did nothing for 0\.2 s"):
        less3.run(script(tmp_path, WAITS), tmp_path, idle_limit_s=0.2)


def test_a_run_that_works_is_left_alone_however_long_it_takes(tmp_path):
    works = """
import time
end = time.monotonic() + 3.0
while time.monotonic() < end:
    pass
print("done")
"""
    assert less3.run(script(tmp_path, works), tmp_path, idle_limit_s=1.0) == "done\n"


def test_a_run_that_fails_is_told_with_its_last_words_and_not_repeated(tmp_path):
    fails = """
import pathlib, sys
(pathlib.Path(sys.argv[1]) / "runs").open("a").write("x")
sys.exit("no such scene")
"""
    with pytest.raises(ProgramError, match="exit code 1: no such scene"):
        less3.run(script(tmp_path, fails), tmp_path)
    assert (tmp_path / "runs").read_text() == "x"
