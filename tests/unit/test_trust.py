"""Files and settings of others run no code, write nowhere else, and fill no memory."""

import ast
import struct
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
import rasterio
from rasterio.transform import Affine

from dapple.config.settings import validate
from dapple.errors import InputError
from dapple.formats import clouds, meshes, rasters
from dapple.formats.clouds import Cloud

SCRIPTS = Path(__file__).parents[2] / "scripts"
RUNS_CODE = {"eval", "exec", "compile", "__import__"}
ATTRIBUTES = {("yaml", "load"), ("yaml", "unsafe_load"), ("os", "system"), ("os", "popen")}
MODULES = {"pickle", "marshal", "shelve", "dill", "joblib"}
FEW_BYTES = 100_000_000
BILLION = 10**9


def calls(tree):
    return (node for node in ast.walk(tree) if isinstance(node, ast.Call))


def dangers(tree):
    """What of a module could run code that it reads, by line."""
    for call in calls(tree):
        if isinstance(call.func, ast.Name) and call.func.id in RUNS_CODE:
            yield call.lineno, call.func.id
        if isinstance(call.func, ast.Attribute) and isinstance(call.func.value, ast.Name):
            named = (call.func.value.id, call.func.attr)
            if named in ATTRIBUTES:
                yield call.lineno, ".".join(named)
        for word in call.keywords:
            if word.arg in ("shell", "allow_pickle") and getattr(word.value, "value", None):
                yield call.lineno, word.arg
    for node in ast.walk(tree):
        names = [one.name for one in node.names] if isinstance(node, ast.Import) else []
        names += [node.module or ""] if isinstance(node, ast.ImportFrom) else []
        yield from ((node.lineno, name) for name in names if name.split(".")[0] in MODULES)


def test_no_module_runs_code_that_it_reads():
    found = [
        (path.relative_to(SCRIPTS), *danger)
        for path in sorted(SCRIPTS.rglob("*.py"))
        for danger in dangers(ast.parse(path.read_text()))
    ]
    assert not found


@pytest.mark.parametrize("text", ["eval(x)", "yaml.load(x)", "f(shell=True)", "import pickle"])
def test_what_runs_code_is_found(text):
    assert list(dangers(ast.parse(text)))


@pytest.mark.parametrize(
    "name",
    [
        "..",
        "../elsewhere",
        "/tmp/x",
        "a/b",
        "a\\b",
        "a\nb",
        "a\n",
        "",
        ".",
        ".hidden",
        "~",
        "a b",
        "$HOME",
    ],
)
def test_no_experiment_writes_outside_its_folder(name):
    with pytest.raises(InputError):
        validate({"experiment": name})


@pytest.mark.parametrize("name", ["..", "../x", "/tmp/x", "a/b", "a\nb", ""])
def test_no_reconstruction_writes_outside_its_folder(name):
    with pytest.raises(InputError):
        validate({"reconstructions": [name]})


def las(path):
    clouds.write(path, Cloud(np.random.default_rng(1).normal(size=(100, 3))))
    raw = bytearray(path.read_bytes())
    struct.pack_into("<Q", raw, 247, BILLION)
    path.write_bytes(raw)


def ply(path):
    path.write_text(
        f"ply\nformat ascii 1.0\nelement vertex {BILLION}\nproperty float x\nproperty float y\n"
        "property float z\nend_header\n0 0 0\n"
    )


def binary_ply(path):
    path.write_bytes(
        f"ply\nformat binary_little_endian 1.0\nelement vertex {BILLION}\nproperty float x\n"
        "property float y\nproperty float z\nend_header\n".encode()
        + bytes(12)
    )


def ptx(path):
    path.write_text(
        f"{BILLION // 1000}\n1000\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n"
        "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n1 2 3 0.5\n"
    )


def pcd(path):
    path.write_text(
        "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {BILLION}\nHEIGHT 1\nPOINTS {BILLION}\nDATA ascii\n0 0 0\n"
    )


@pytest.mark.parametrize(
    ("name", "write"),
    [
        ("a.las", las),
        ("a.laz", las),
        ("a.ply", ply),
        ("b.ply", binary_ply),
        ("a.ptx", ptx),
        ("a.pcd", pcd),
    ],
)
def test_a_header_that_claims_a_billion_points_takes_no_memory_for_them(tmp_path, name, write):
    write(tmp_path / name)
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            clouds.read(tmp_path / name)
        assert tracemalloc.get_traced_memory()[1] < FEW_BYTES
    finally:
        tracemalloc.stop()


def test_a_mesh_that_claims_a_billion_triangles_takes_no_memory_for_them(tmp_path):
    path = tmp_path / "mesh.ply"
    path.write_text(
        "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        f"property float z\nelement face {BILLION}\nproperty list uchar int vertex_indices\n"
        "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
    )
    tracemalloc.start()
    try:
        with pytest.raises(InputError):
            meshes.read_ply(path)
        assert tracemalloc.get_traced_memory()[1] < FEW_BYTES
    finally:
        tracemalloc.stop()


def test_an_image_of_a_million_by_a_million_pixels_is_refused_by_its_size(tmp_path):
    path = tmp_path / "huge.tif"
    with rasterio.open(
        path,
        "w",
        driver="GTiff",
        width=10**6,
        height=10**6,
        count=1,
        dtype="uint8",
        crs="EPSG:25832",
        transform=Affine(0.01, 0, 400000, 0, -0.01, 5300000),
        tiled=True,
        blockxsize=16384,
        blockysize=16384,
        SPARSE_OK=True,
        BIGTIFF="YES",
    ):
        pass
    assert path.stat().st_size < FEW_BYTES
    tracemalloc.start()
    try:
        with pytest.raises(InputError, match=r"1000000 x 1000000"):
            rasters.read(path)
        assert tracemalloc.get_traced_memory()[1] < FEW_BYTES
    finally:
        tracemalloc.stop()
