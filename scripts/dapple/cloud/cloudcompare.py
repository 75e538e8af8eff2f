"""CloudCompare: statistical outliers and cloud-to-mesh distances.

CloudComPy is used where it can be imported, the command line of CloudCompare otherwise. Both
exchange binary PLY files around the middle of the cloud, because CloudCompare keeps coordinates in
single precision.
"""

import importlib.util
import re
import tempfile
from pathlib import Path
from typing import Protocol

import numpy as np
from scipy.spatial.transform import Rotation

from dapple import programs
from dapple.errors import EmptyCloudError
from dapple.formats.meshes import Mesh

REMEDY = (
    "Install CloudCompare (Debian: apt-get install --no-install-recommends cloudcompare), "
    "configure its path, or choose the outlier back end pdal."
)

INDEX_BASE = 2**20
"""Row numbers travel as two scalars, row // base and row % base: single precision is exact there,
while one scalar would be exact only up to 2**24 rows."""


class Engine(Protocol):
    """The two things that dapple asks of CloudCompare."""

    name: str
    version: str

    def inliers(self, xyz_m: np.ndarray, neighbours: int, multiplier: float) -> np.ndarray:
        """(k,) ascending indices of the points that are no statistical outliers.

        The mean distance of an outlier to its nearest neighbours, the point itself not counted,
        exceeds the mean over all points by more than `multiplier` standard deviations.
        """

    def distance_to_mesh(self, xyz_m: np.ndarray, mesh: Mesh) -> np.ndarray:
        """(n,) float64 distance of each point to the nearest place on the mesh [m]."""


def engine(program: str = "CloudCompare") -> Engine:
    """CloudComPy where `import cloudComPy` works, else CloudCompare's command line."""
    if importlib.util.find_spec("cloudComPy"):
        return CloudComPy()
    return CommandLine(program)


class CommandLine:
    """CloudCompare's command line, without a display.

    Parameters
    ----------
    program : str
        Name or path of the executable.
    """

    name = "CloudCompare"

    def __init__(self, program: str = "CloudCompare"):
        self.program = programs.find(program, REMEDY)
        self.version = "unknown"  # CloudCompare tells it only in the files that it writes

    def inliers(self, xyz_m: np.ndarray, neighbours: int, multiplier: float) -> np.ndarray:
        """See `Engine`."""
        with tempfile.TemporaryDirectory(prefix="cloudcompare-") as folder:
            given, kept = Path(folder, "given.ply"), Path(folder, "kept.ply")
            write_points(given, xyz_m, _middle(xyz_m))
            # CloudCompare counts the point itself among its neighbours, hence the + 1.
            limit_s = programs.limit_s(len(xyz_m))
            self._run(
                [given], ["-SOR", str(neighbours + 1), repr(float(multiplier))], kept, limit_s
            )
            return _rows(*_columns(self._read(kept), ("scalar_RowHigh", "scalar_RowLow")))

    def distance_to_mesh(self, xyz_m: np.ndarray, mesh: Mesh) -> np.ndarray:
        """See `Engine`."""
        with tempfile.TemporaryDirectory(prefix="cloudcompare-") as folder:
            given, surface = Path(folder, "given.ply"), Path(folder, "mesh.ply")
            result = Path(folder, "result.ply")
            points_m, vertices_m = _tilted(xyz_m, mesh.vertices_m)
            write_points(given, points_m, np.zeros(3))
            write_mesh(surface, vertices_m, mesh.faces)
            limit_s = programs.limit_s(len(xyz_m))
            self._run([given, surface], ["-C2M_DIST"], result, limit_s)
            points = self._read(result)
        rows = _rows(*_columns(points, ("scalar_RowHigh", "scalar_RowLow")))
        field = next((n for n in points.dtype.names or () if n.startswith("scalar_C2M")), "")
        if not field or not np.array_equal(np.sort(rows), np.arange(len(xyz_m))):
            found = f"{len(rows)} distances" if field else "points without distances"
            raise programs.failure([self.program, "-C2M_DIST"], found, f"{len(xyz_m)} points given")
        distance_m = np.empty(len(xyz_m))
        distance_m[rows] = np.abs(points[field])  # signed where triangles have a front side
        return distance_m

    def _run(self, opened: list[Path], action: list[str], saved: Path, limit_s: float) -> None:
        command = [self.program, "-SILENT", "-AUTO_SAVE", "OFF", "-NO_TIMESTAMP"]
        command += ["-C_EXPORT_FMT", "PLY", "-PLY_EXPORT_FMT", "BINARY_LE"]
        for path in opened:
            command += ["-O", "-GLOBAL_SHIFT", "AUTO", str(path)]
        command += [*action, "-SAVE_CLOUDS", "FILE", str(saved)]
        offscreen = {"QT_QPA_PLATFORM": "offscreen"}
        programs.run(command, limit_s=limit_s, makes=[saved], environment=offscreen)

    def _read(self, path: Path) -> np.ndarray:
        points, comments = read_points(path)
        if match := re.search(r"CloudCompare v(\S+)", comments):
            self.version = match.group(1)
        return points


class CloudComPy:
    """CloudCompare in this process, through its Python module (conda; on no package index).

    Its results are those of the command line: the same library does the work.
    """

    name = "CloudComPy"

    def __init__(self):
        import cloudComPy

        self._module = cloudComPy
        self._module.initCC()
        self.version = str(getattr(cloudComPy, "__version__", "unknown"))

    def inliers(self, xyz_m: np.ndarray, neighbours: int, multiplier: float) -> np.ndarray:
        """See `Engine`."""
        with tempfile.TemporaryDirectory(prefix="cloudcompy-") as folder:
            cloud = self._load(Path(folder, "given.ply"), xyz_m, _middle(xyz_m))
        kept = self._module.CloudSamplingTools.sorFilter(
            cloud=cloud, knn=neighbours + 1, nSigma=float(multiplier)
        )
        clone, _ = cloud.partialClone(kept)
        fields = clone.getScalarFieldDic()
        return _rows(
            *(clone.getScalarField(fields[name]).toNpArrayCopy() for name in ("RowHigh", "RowLow"))
        )

    def distance_to_mesh(self, xyz_m: np.ndarray, mesh: Mesh) -> np.ndarray:
        """See `Engine`."""
        module = self._module
        points_m, vertices_m = _tilted(xyz_m, mesh.vertices_m)
        with tempfile.TemporaryDirectory(prefix="cloudcompy-") as folder:
            cloud = self._load(Path(folder, "given.ply"), points_m, np.zeros(3))
            surface = Path(folder, "mesh.ply")
            write_mesh(surface, vertices_m, mesh.faces)
            loaded = module.loadMesh(str(surface))
        tools = module.DistanceComputationTools
        parameters = module.Cloud2MeshDistancesComputationParams()
        parameters.octreeLevel = tools.determineBestOctreeLevel(cloud, loaded)
        parameters.signedDistances = False
        tools.computeCloud2MeshDistances(cloud, loaded, parameters)
        last = cloud.getNumberOfScalarFields() - 1
        return np.abs(cloud.getScalarField(last).toNpArrayCopy()).astype(np.float64)

    def _load(self, path: Path, xyz_m: np.ndarray, middle_m: np.ndarray):
        write_points(path, xyz_m, middle_m)
        return self._module.loadPointCloud(str(path))


def cloud_to_mesh_distance(
    xyz_m: np.ndarray, mesh: Mesh, *, program: str = "CloudCompare"
) -> np.ndarray:
    """Distance of every point to the nearest place on a mesh.

    Parameters
    ----------
    xyz_m : (n, 3) float64
        Local frame [m].
    mesh : Mesh
        Triangles in the same frame.
    program : str
        CloudCompare's name or path.

    Returns
    -------
    (n,) float64
        Unsigned distances [m].

    Raises
    ------
    EmptyCloudError
        No points or no triangles.
    ProgramError
        CloudCompare failed.
    """
    for what, n in (("points", len(xyz_m)), ("triangles", len(mesh.faces))):
        if n == 0:
            raise EmptyCloudError(
                "cloud-to-mesh distance", f"no {what}", "some", "Check the step that made them."
            )
    distance_m = engine(program).distance_to_mesh(xyz_m, mesh)
    if unknown := np.count_nonzero(~np.isfinite(distance_m)):
        raise programs.ProgramError(
            "CloudCompare -C2M_DIST",
            f"{unknown} of {len(distance_m)} distances that are not numbers",
            "a distance for every point",
            "Look for NaN coordinates in the cloud and the mesh.",
        )
    return distance_m


def summary(distance_m: np.ndarray, *, close_m: float = 0.02) -> dict:
    """Mean, median and 95th percentile of distances [m], and the share within `close_m`."""
    return {
        "n": len(distance_m),
        "mean_m": float(np.mean(distance_m)),
        "median_m": float(np.median(distance_m)),
        "p95_m": float(np.percentile(distance_m, 95)),
        "close_m": close_m,
        "share_close": float(np.mean(distance_m <= close_m)),
    }


def write_points(path: Path, xyz_m: np.ndarray, middle_m: np.ndarray) -> None:
    """Write points about a middle and their row numbers as binary PLY, single precision."""
    names = (*"xyz", "scalar_RowHigh", "scalar_RowLow")
    with path.open("wb") as file:
        file.write(_header(("vertex", len(xyz_m), [f"float {name}" for name in names])))
        for at in range(0, len(xyz_m), INDEX_BASE):
            piece = xyz_m[at : at + INDEX_BASE] - middle_m
            points = np.empty(len(piece), [(name, "<f4") for name in names])
            for axis, name in enumerate("xyz"):
                points[name] = piece[:, axis]
            points["scalar_RowHigh"] = at // INDEX_BASE
            points["scalar_RowLow"] = np.arange(len(piece))
            points.tofile(file)


def write_mesh(path: Path, vertices_m: np.ndarray, faces: np.ndarray) -> None:
    """Write triangles as binary PLY, single precision."""
    triangles = np.empty(len(faces), [("n", "u1"), ("corner", "<i4", 3)])
    triangles["n"], triangles["corner"] = 3, faces
    vertex = ("vertex", len(vertices_m), [f"float {axis}" for axis in "xyz"])
    face = ("face", len(faces), ["list uchar int vertex_indices"])
    with path.open("wb") as file:
        file.write(_header(vertex, face))
        file.write(np.ascontiguousarray(vertices_m, "<f4").tobytes())
        triangles.tofile(file)


def read_points(path: Path) -> tuple[np.ndarray, str]:
    """Read the vertices of a binary PLY of floats, as CloudCompare writes it, and its header."""
    with path.open("rb") as file:
        lines = []
        while (line := file.readline().decode("ascii", "replace").strip()) != "end_header":
            if not file.peek(1):
                raise programs.failure(["CloudCompare"], "a PLY header without end", "")
            lines.append(line)
        types = {"float": "<f4", "double": "<f8", "uchar": "u1", "int": "<i4"}
        n_points = next((int(s.split()[2]) for s in lines if s.startswith("element vertex")), 0)
        properties = [line.split()[1:] for line in lines if line.startswith("property")]
        dtype = np.dtype([(name, types[kind]) for kind, name in properties])
        points = np.fromfile(file, dtype, n_points)
        if len(points) < n_points:
            raise programs.failure(["CloudCompare"], f"{len(points)} of {n_points} points", "")
        return points, "\n".join(lines)


def _header(*elements: tuple[str, int, list[str]]) -> bytes:
    lines = ["ply", "format binary_little_endian 1.0"]
    for name, n, properties in elements:
        lines += [f"element {name} {n}", *(f"property {entry}" for entry in properties)]
    return ("\n".join(lines) + "\nend_header\n").encode("ascii")


def _middle(xyz_m: np.ndarray) -> np.ndarray:
    return 0.5 * (np.min(xyz_m, axis=0) + np.max(xyz_m, axis=0))


def _tilted(xyz_m: np.ndarray, vertices_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points and vertices about the middle of the cloud, turned together.

    CloudCompare misses triangles that lie exactly on a face of its axis-aligned search cells; the
    turn keeps horizontal and vertical surfaces off them, and distances do not feel it.
    """
    turn = Rotation.from_euler("xyz", [0.61, 0.37, 0.83])
    middle = _middle(xyz_m)
    return turn.apply(xyz_m - middle), turn.apply(vertices_m - middle)


def _columns(points: np.ndarray, names: tuple[str, ...]) -> list[np.ndarray]:
    if lacking := set(names) - set(points.dtype.names or ()):
        raise programs.failure(["CloudCompare"], f"no {' and no '.join(sorted(lacking))}", "")
    return [points[name] for name in names]


def _rows(high: np.ndarray, low: np.ndarray) -> np.ndarray:
    return np.asarray(high).astype(np.int64) * INDEX_BASE + np.asarray(low).astype(np.int64)
