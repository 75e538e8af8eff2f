"""Mitsuba is loaded with a back end that starts, or the remedy is said."""

import drjit
import numba
import pytest

from dapple import engine
from dapple.errors import InputError


def test_the_environment_s_own_llvm_comes_before_the_system_s(tmp_path, monkeypatch):
    own = tmp_path / "lib" / "libLLVM-19.so"
    own.parent.mkdir()
    own.touch()
    monkeypatch.setenv("CONDA_PREFIX", str(tmp_path))
    assert engine.find_libllvm() == own
    monkeypatch.setenv("CONDA_PREFIX", str(tmp_path / "none"))
    assert engine.find_libllvm() != own


def test_where_there_is_no_llvm_the_loader_may_search(monkeypatch):
    monkeypatch.delenv("CONDA_PREFIX", raising=False)
    monkeypatch.setattr(engine, "LIBLLVM_PATTERNS", ("/nowhere/libLLVM*.so*",))
    assert engine.find_libllvm() is None


def test_a_variant_that_is_not_there_is_refused_with_those_that_are():
    with pytest.raises(InputError, match=r"(?s)one of .*llvm_ad_rgb.* install LLVM 19"):
        engine.load("llvm_of_nobody")


def test_jobs_use_the_threads_that_they_are_given():
    before = drjit.thread_count(), numba.get_num_threads()
    try:
        engine.use_threads(1)
        assert (drjit.thread_count(), numba.get_num_threads()) == (1, 1)
        engine.use_threads(1000)  # numba has no more than it began with
        assert numba.get_num_threads() == numba.config.NUMBA_NUM_THREADS
    finally:
        drjit.set_thread_count(before[0])
        numba.set_num_threads(before[1])
