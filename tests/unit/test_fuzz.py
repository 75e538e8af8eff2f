"""Every reader takes or refuses a broken file, soon and in little memory: a sample of many.

`python -m tests.fuzz.run` is the long run, 20,000 files.
"""

from tests.fuzz import run, seeds

FILES = 160


def test_broken_files_are_read_or_refused_in_one_message(tmp_path):
    names = [one.path.name for one in seeds.make(tmp_path)]
    result = run.run(FILES, 11, tmp_path, names)
    assert dict(result.faults) == {}
    assert sum(sum(counts.values()) for counts in result.counts.values()) == FILES


def test_sound_files_are_read(tmp_path):
    for sound in seeds.make(tmp_path):
        if sound.path.name != "nothing.json":
            sound.read(sound.path)
