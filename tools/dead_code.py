"""Names that nothing uses, by vulture: `python tools/dead_code.py` prints them and then fails.

vulture reads Python alone, so that what only a rule or a template reads looks dead to it, and what
only a library calls or reads. Words of both count as uses here; names of libraries are listed.
"""

import re
import sys
from pathlib import Path

import vulture

ROOT = Path(__file__).parents[1]
FOLDERS = ("scripts", "benchmarks", "tools", "tests")
OF_LIBRARIES = {
    "pytest": "test_* one_thread pytestmark",
    "selenium": "binary_location",
    "pydantic": "model_config handler _no_truth_value_for_a_number",
    "vulture": "used_names",
    "Mitsuba and Dr.Jit": "m_flags parameters_changed eta sampled_type sampled_component maxt",
    "CSF": "bSloopSmooth cloth_resolution class_threshold",
    "CloudCompare": "octreeLevel signedDistances",
    "laspy": "generating_software wkt",
    "LESS 3": "surface_illumination illumination generate_pulses scene_w scene_d",
    "rpy2": "consolewrite_warnerror consolewrite_print",
}
"""What libraries call, or are told by setting it."""
BY_KIND = "leaf_reflectance_db wood_reflectance_db ground_reflectance_db neighbour_voxel_m"
"""Fields that are read by a name put together, or as `settings["..."]`."""


def main() -> int:
    """Print what is dead; the exit status says whether anything is."""
    known = " ".join([*OF_LIBRARIES.values(), BY_KIND]).split()
    seeker = vulture.Vulture(ignore_names=known)
    seeker.scavenge([str(ROOT / folder) for folder in FOLDERS])
    templates = ROOT.glob("scripts/**/*.j2")
    for path in (ROOT / "Snakefile", *ROOT.glob("rules/**/*.smk"), *templates):
        for word in re.findall(r"\w+", path.read_text()):
            seeker.used_names.add(word)
    dead = seeker.get_unused_code(min_confidence=60)
    for one in dead:
        where = Path(one.filename).relative_to(ROOT)
        print(f"{where}:{one.first_lineno}: {one.message}")
    return int(bool(dead))


if __name__ == "__main__":
    sys.exit(main())
