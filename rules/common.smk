"""
Configuration, names of files, and what rules of several stages share. No rules here.

Needs   config/config.yaml, merged with the file given as --configfile
Makes   nothing
"""

import sys
import tarfile
import tempfile
from pathlib import Path


def home():
    """Where dapple itself lies: results go to the working directory, which may be elsewhere.

    A module that was taken from a server by `github(...)` has no folder: all of it is laid out
    beside Snakemake's own copy of the repository, once for each commit.
    """
    rules = workflow.current_basedir
    if not hasattr(rules, "hosted_repo"):
        return Path(str(rules)).parent
    commit = rules.hosted_repo.repo.commit(rules.ref)
    folder = Path(rules.cache_path) / "dapple" / commit.hexsha
    if not folder.is_dir():
        folder.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder.parent) as partial:
            with tempfile.TemporaryFile() as packed:
                commit.repo.archive(packed, commit.hexsha)
                packed.seek(0)
                tarfile.open(fileobj=packed).extractall(f"{partial}/all", filter="data")
            try:
                Path(partial, "all").rename(folder)
            except OSError:
                if not folder.is_dir():  # else another run was first
                    raise
    return folder


HOME = home()
SCRIPTS = HOME / "scripts"
sys.path.append(str(SCRIPTS))

from dapple.clock import time_range
from dapple.cloud.classifiers import CLASSIFIERS
from dapple.config.settings import validate
from dapple.errors import InputError
from dapple.estimate.beginning import Known, configuration_before, tell
from dapple.estimate.planned import edited, planned, total
from dapple.estimate.sizes import sizes
from dapple.optics import responses
from dapple.streams import stream_seed
from dapple.structure.voxel_sizes import finer_than
from dapple.workflow import code_of, evenly, let_jobs_import, short

if hasattr(workflow.current_basedir, "hosted_repo"):
    let_jobs_import(SCRIPTS)

try:
    settings = validate(
        config, " + ".join(short(Path(file)) for file in workflow.configfiles)
    )
except InputError as error:
    sys.exit(f"dapple: {error}")

N_TIMES = len(time_range(**dict(settings.time)))
# Leaves that come with real wood, where the user has them.
REAL_LEAVES = bool(settings.leaves.path) and (
    (Path(settings.data_dir) / settings.leaves.path).is_file()
)
PLACEMENTS = range(
    settings.leaves.placements if settings.source == "wood" and not REAL_LEAVES else 1
)
VOXELS = [name for name in settings.reconstructions if name.startswith("voxels_")]
# Those whose signals of trust are known.
JUDGED = [
    name
    for name in settings.reconstructions
    if name in ("polygons", "surfels") or name.startswith("voxels_")
]
LIT = settings.reconstructions if settings.sensors.kind != "none" else ()
VARIANT = f"{settings.light.variant}_ad"
# The per-timestep engine computes some of the times, a few in each job.
REFERENCE_TIMES = list(
    range(
        0,
        N_TIMES,
        (
            max(1, round(settings.light.timestep.step_min / settings.time.step_min))
            if settings.light.engine == "transport"
            else 1
        ),
    )
)
SENSOR_TABLE = settings.sensors.path or "sensors"
BATCH = settings.light.timestep.times_per_job
REFERENCE_BATCHES = range(-(-len(REFERENCE_TIMES) // BATCH))
GROUND_Z_M = settings.ground_z_m or 0.0
ONE_OF_MANY = settings.tree.id is not None or settings.tree.at is not None
SKY = {
    "site": settings.site.model_dump(exclude={"timezone", "crs"}),
    "radiation": settings.radiation.broadband(),
    "atmosphere": settings.radiation.atmosphere(),
}
OF_BEAM = {
    "sun_diameter_deg": settings.light.sun_diameter_deg,
    "aperture_m": settings.light.entrance_m,
}
CHECKED = LIT if settings.light.engine == "transport" and settings.light.check else ()
CHECK_WITH = dict.fromkeys(settings.light.check_with)
ADVISED = settings.light.model == "advised"
COMPARED = LIT if settings.measured.kind != "none" else ()


wildcard_constraints:
    reconstruction=r"polygons|surfels|truth|voxels_[0-9.]+",
    meshed=r"polygons|surfels|truth",
    size=r"[0-9.]+",
    placement=r"[0-9]+",
    batch=r"[0-9]+",


def results(path):
    """A file of this experiment."""
    return f"results/{settings.experiment}/{path}"


# Frame and clock, where records are to tell them; else they are as configured.
FITTED = results("registration/registration.json") if settings.registration.fit else []
# A cloud has an origin of its own, unless the configuration knows another.
OWN_FRAME = (
    results("scan/frame.json")
    if settings.source == "cloud" and settings.registration.origin_m is None
    else []
)


def vectors(*paths):
    """The same figures of this experiment for print, beside those for the screen."""
    return [results(path.replace(".png", ".pdf")) for path in paths]


def logs(name):
    """The log of a rule."""
    return results(f"logs/{name}.log")


def benchmarks(name):
    """The time and memory that a rule took."""
    return results(f"benchmarks/{name}.tsv")


def said(text):
    """What a rule says when it runs; in a workflow of several, the experiment tells them apart."""
    return f"{settings.experiment}: {text}"


def memory(mb):
    """Memory of a job, and half as much again at each further attempt."""
    return lambda wildcards, attempt: mb * (attempt + 1) // 2


def code(script, unused=()):
    """The modules that a script is made of: an edit reruns the rule.

    Modules that this configuration does not use, by their names below dapple, are left out.
    """
    return [local(path) for path in code_of(SCRIPTS / f"{script}.py", unused)]


def beside_code(path):
    """A file that comes with the modules of dapple."""
    return local(short(SCRIPTS / "dapple" / path))


REPORT_TEMPLATES = [
    beside_code(f"report/templates/{file.name}")
    for file in sorted((SCRIPTS / "dapple/report/templates").iterdir())
]

# What data_dir lacks and a server has.
MISSING_DATA = {
    path: checksum
    for path, checksum in settings.download.sha256.items()
    if settings.download.url and not (Path(settings.data_dir) / path).is_file()
}
# What this run reads of data_dir.
DATA_FILES = []


def data(path):
    """A file of real data, which the configuration names relative to data_dir."""
    file = Path(settings.data_dir) / path
    if not file.is_file() and path not in MISSING_DATA:
        published = (
            "`tools/apple-data CLONE` lays them out from a clone of JulFrey/dotshadow. "
        )
        sys.exit(
            f"dapple: {file}: found no such file; expected the data that `{settings.experiment}` "
            f"reads. {published if path.startswith('apple/') else ''}"
            "Set data_dir in the configuration to the folder that has it."
        )
    DATA_FILES.append(local(str(file)))
    return DATA_FILES[-1]


def data_files(path):
    """A file of real data, or all that a pattern with `*` finds, in the order of their names."""
    if "*" not in path:
        return [data(path)]
    found = sorted(Path(settings.data_dir).glob(path))
    if not found:
        sys.exit(
            f"dapple: {settings.data_dir}: found no file like {path}; expected at least one. "
            "Correct the pattern or data_dir."
        )
    DATA_FILES.extend(local(str(file)) for file in found)
    return DATA_FILES[-len(found) :]


def leaf_wood_model():
    """The file of the learned classifier, where it is asked."""
    if settings.classify.method != "learned":
        return []
    own = settings.classify.model
    return data(own) if own else beside_code("cloud/leaf_wood_model.npz")


LEAF_WOOD_MODEL = leaf_wood_model()


def sky_table():
    """The measured sky, where one is configured."""
    radiation = settings.radiation
    return [data(radiation.sky_table)] if radiation.sky == "measured" else []


def optics():
    """Spectra as the configuration has them, tables as files."""
    spectra = settings.optics.model_dump()
    for surface in ("leaf", "bark", "ground"):
        if spectra[surface]["path"]:
            spectra[surface]["path"] = data(spectra[surface]["path"])
    return spectra


OPTICS = optics()
RESPONSE = (
    responses.read(data(settings.sensors.response_table))
    if settings.sensors.response == "table"
    else responses.NAMED[settings.sensors.response]
)
LESS = settings.light.less
LESS_RAYS = {
    "rays": LESS.rays,
    "suns": LESS.suns,
    "max_orders": settings.light.transport.max_orders,
    "sun_diameter_deg": OF_BEAM["sun_diameter_deg"],
}
BY_LESS = "less" in (settings.light.engine, *CHECK_WITH)
TRACING = settings.light.transport.model_dump() | OF_BEAM | {"response": RESPONSE}
REFERENCE = OF_BEAM | {"variant": f"{VARIANT}_rgb", "response": RESPONSE}
REFERENCE |= settings.light.timestep.model_dump(exclude={"step_min", "times_per_job"})


SURFELS = settings.surfels.model_dump() | {
    "max_deviation": settings.clean.max_deviation
}


def tracing(*names):
    """Some of the settings by which light is traced."""
    return {name: TRACING[name] for name in names}


def stream(*names):
    """The seed of one stage."""
    return stream_seed(settings.seed, *names)


GROUND = results("scan/ground.nc") if settings.source == "cloud" else []
SHADE = results("tree/neighbours.ply") if ONE_OF_MANY else []
# Where the local frame lies on the Earth; a virtual tree stands at the site.
WORLD_OF_CLOUD = results("scan/frame.json") if settings.source == "cloud" else []
WORLD = {
    "crs": settings.site.crs,
    "origin_m": settings.registration.origin_m,
    "site": (
        settings.site.model_dump(include={"latitude_deg", "longitude_deg"})
        if settings.source == "virtual"
        else None
    ),
}


def leaf_meshes(reconstruction):
    """The leaves of a reconstruction made of polygons, one file a placement."""
    return [results(f"structure/{reconstruction}/leaves_{p}.ply") for p in PLACEMENTS]


def leaf_geometry(wildcards):
    """The leaves that light meets: meshes or a voxel grid."""
    name = wildcards.reconstruction
    if name.startswith("voxels_"):
        return [results(f"structure/{name}/voxels.nc")]
    return leaf_meshes(name)


def placements(reconstruction):
    """Numbers of the geometries whose mean is a reconstruction's light."""
    return [0] if reconstruction.startswith("voxels_") else PLACEMENTS


def transports(wildcards):
    """The counted paths of all placements of a reconstruction."""
    name = wildcards.reconstruction
    return [results(f"light/transport/{name}_{p}.nc") for p in placements(name)]


def stem_wood():
    """The wood around whose stem a grid of sensors stands: true where it is known."""
    if settings.sensors.kind != "grid":
        return []
    meshed = "truth" if settings.source == "virtual" else "polygons"
    return results(f"structure/{meshed}/wood.ply")


def is_less_sample(reconstruction):
    """Whether LESS gets some sensors and times alone: turbid voxels are slow there."""
    return reconstruction.startswith("voxels_") and settings.light.engine != "less"


def less_times(reconstruction):
    """Times that LESS computes of a reconstruction."""
    n = len(REFERENCE_TIMES)
    most = LESS.voxel_times if is_less_sample(reconstruction) else n
    return [REFERENCE_TIMES[k] for k in evenly(n, most)]


def less_batches(wildcards):
    """The files of LESS' times, a few in each."""
    name = wildcards.reconstruction
    batches = range(-(-len(less_times(name)) // BATCH))
    return [results(f"light/less_timesteps/{name}/{batch}.nc") for batch in batches]


def batch_of(times, wildcards):
    """Those of some times that a job computes."""
    first = int(wildcards.batch) * BATCH
    return list(times[first : first + BATCH])


def timestep_positions(wildcards):
    """Which of the per-timestep engine's times a job computes."""
    return batch_of(range(len(REFERENCE_TIMES)), wildcards)


def wood_of(reconstruction):
    """The wood of a reconstruction: the truth's in the truth, else the polygons'."""
    meshed = "truth" if reconstruction == "truth" else "polygons"
    return results(f"structure/{meshed}/wood.ply")


def wood_mesh(wildcards):
    """The wood that light meets."""
    return wood_of(wildcards.reconstruction)


def clumping_correction(wildcards):
    """Parameters of the voxels' correction, with the finer size that it looks into, or None."""
    if not settings.corrections.clumping:
        return None
    return {
        "finer_m": finer_than(float(wildcards.size), settings.voxels.sizes_m),
        "fill_range_m": settings.corrections.fill_range_m,
    }


def sized(section):
    """Geometries of all sizes that a section asks for, with sensors and light, by name of input."""
    polygons = section.polygon_sizes_m if settings.source != "wood" else ()
    has_shots = settings.has_shots
    voxels = section.voxel_sizes_m if has_shots else ()
    truth = ("leaves_0", "wood") if settings.source == "virtual" else ()
    return {
        "leaves": leaf_meshes("polygons")[0],
        "wood": results("structure/polygons/wood.ply"),
        "surfels": (
            leaf_meshes("surfels") if "surfels" in settings.reconstructions else []
        ),
        "sized_leaves": [
            results(f"structure/polygons_{size}/leaves_0.ply") for size in polygons
        ],
        "sized_wood": [
            results(f"structure/polygons_{size}/wood.ply") for size in polygons
        ],
        "voxels": [results(f"structure/voxels_{size}/voxels.nc") for size in voxels],
        "truth": [results(f"structure/truth/{kind}.ply") for kind in truth],
        "sensors": results("sky/sensors.csv"),
        "sky": results("sky/sky.nc"),
        "optics": results("sky/optics.nc"),
    }


def without_shots(wildcards):
    """Why nothing can be predicted."""
    sys.exit(
        f"dapple: rescan: found no shots in `{settings.experiment}`; expected a scan with them. "
        "Points alone do not tell what a scanner saw through: see docs/input.md for how shots "
        "come with a cloud."
    )


def known_before():
    """Sizes of this run and of the one before it, and what was edited between."""
    old = configuration_before(Path(results("")))
    try:
        earlier = sizes(validate(old)) if old else None
    except InputError:  # written by another version
        earlier = None
    now = settings.model_dump(mode="json")
    return {
        "now": sizes(settings),
        "earlier": earlier,
        "edits": tuple(edited(old, now)) if old else None,
    }


def forewarning(dag):
    """What a run is going to do, and why."""
    jobs = planned(dag)
    names = [job.rule for job in jobs]
    if "estimate" in names or "check" in names:
        return ""
    known = Known(Path(results("")), workflow.cores or 1, **known_before())
    return tell(jobs, total(dag), known)
