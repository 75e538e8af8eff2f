"""Load Mitsuba in a variant that works on this machine, and say so when none does."""

import os
from pathlib import Path
from types import ModuleType

from dapple.errors import InputError

LIBLLVM_PATTERNS = (
    "/usr/lib/*/libLLVM*19*.so*",
    "/usr/lib/llvm-19/lib/libLLVM*.so*",
    "/opt/homebrew/opt/llvm/lib/libLLVM.dylib",
)


def find_libllvm() -> Path | None:
    """Return the LLVM library that Dr.Jit shall load, or None where the loader may search.

    Debian 12 has LLVM 14 to 16 as well, which Dr.Jit refuses or aborts with; 19 works.
    """
    candidates = list(LIBLLVM_PATTERNS)
    if prefix := os.environ.get("CONDA_PREFIX"):
        candidates.insert(0, f"{prefix.lstrip('/')}/lib/libLLVM*.so*")
    for pattern in candidates:
        if found := sorted(Path("/").glob(pattern.lstrip("/"))):
            return found[0]
    return None


def load(variant: str = "llvm_ad_rgb") -> ModuleType:
    """Import Mitsuba and set its variant.

    Parameters
    ----------
    variant : str
        `llvm_ad_mono`, `llvm_ad_rgb` (three spectral bands at once), `cuda_ad_*` on a GPU.

    Returns
    -------
    module
        `mitsuba`, ready to use.

    Raises
    ------
    InputError
        The variant does not exist or its back end cannot be loaded.
    """
    if variant.startswith("llvm") and (library := find_libllvm()):
        os.environ.setdefault("DRJIT_LIBLLVM_PATH", str(library))
    import mitsuba

    try:
        mitsuba.set_variant(variant)
        _probe(variant)
    except (ImportError, AttributeError, RuntimeError) as error:
        raise InputError(
            f"light.variant={variant}",
            f"a back end that does not start ({error})",
            f"one of {', '.join(mitsuba.variants())} with its back end installed",
            "For llvm_* install LLVM 19 (Debian: libllvm19 libatomic1) or set DRJIT_LIBLLVM_PATH; "
            "for cuda_* a recent NVIDIA driver is needed.",
        ) from error
    return mitsuba


def use_threads(n: int) -> None:
    """Let Dr.Jit and numba use so many threads: jobs that run side by side share the cores."""
    import drjit
    import numba

    load()
    drjit.set_thread_count(n)
    numba.set_num_threads(min(n, numba.config.NUMBA_NUM_THREADS))  # type: ignore[attr-defined]


def _probe(variant: str) -> None:
    """Compile and run the smallest kernel, so that a broken back end shows here and not later."""
    import drjit

    module = drjit.cuda if variant.startswith("cuda") else drjit.llvm
    if variant.startswith(("llvm", "cuda")):
        drjit.eval(module.Float([1.0, 2.0]) + 1.0)
