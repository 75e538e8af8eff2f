"""What a run was made from and what it made, as an RO-Crate.

The crate's metadata lie beside the results: every file with its size and SHA-256, the
configuration, the files of data outside the folder, and the programs with their versions. The form
is RO-Crate with the terms of Workflow Run Crate (Leo et al. 2024) for checksums.
"""

import hashlib
import platform
from collections.abc import Iterable, Sequence
from importlib import metadata
from pathlib import Path
from typing import Any

from rocrate.model.contextentity import ContextEntity
from rocrate.rocrate import ROCrate

from dapple.version import VERSION

WORKFLOW_RUN_TERMS = "https://w3id.org/ro/terms/workflow-run/context"
NAME = "ro-crate-metadata.json"
LICENSE = "https://spdx.org/licenses/GPL-3.0-or-later"
MEDIA_TYPES = {
    ".nc": "application/netcdf",
    ".csv": "text/csv",
    ".json": "application/json",
    ".yaml": "application/yaml",
    ".png": "image/png",
    ".pdf": "application/pdf",
    ".html": "text/html",
    ".laz": "application/vnd.laszip",
    ".ply": "model/ply",
    ".parquet": "application/vnd.apache.parquet",
}
_BLOCK = 1 << 20


def sha256(path: Path) -> str:
    """Checksum of a file, read block by block."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            digest.update(block)
    return digest.hexdigest()


def describe(
    folder: Path,
    *,
    experiment: str,
    data: Sequence[str | Path] = (),
    packages: Iterable[str] = (),
) -> dict[str, Any]:
    """Metadata of a run's crate.

    Parameters
    ----------
    folder : Path
        Results of the run.
    experiment : str
    data : sequence of str or Path
        Files outside the folder that the run has read.
    packages : iterable of str
        Python packages whose versions count.

    Returns
    -------
    dict
        To be written as `ro-crate-metadata.json` in the folder.
    """
    crate = ROCrate()
    crate.metadata.extra_contexts.append(WORKFLOW_RUN_TERMS)
    crate.name = f"dapple: {experiment}"
    crate.description = f"Results of the experiment `{experiment}`, made by dapple"
    made = [_file(crate, path, str(path.relative_to(folder))) for path in _results(folder)]
    read = [_file(crate, Path(path), Path(path).resolve().as_uri()) for path in data]
    versions = {"Python": platform.python_version()}
    versions |= {name: metadata.version(name) for name in packages}
    dapple = _software(crate, "dapple", VERSION)
    dapple["license"] = LICENSE
    dapple["softwareRequirements"] = [_software(crate, *used) for used in versions.items()]
    configuration = [entity for entity in made if entity.id == "config.yaml"]
    action = crate.add_action(
        dapple,
        identifier="#run",
        object=[*read, *configuration],
        result=made,
        properties={"name": experiment},
    )
    crate.root_dataset["mentions"] = [action]
    return crate.metadata.generate()


def _results(folder: Path) -> list[Path]:
    """Files of a run in the order of their names, without the crate and half-written ones."""
    return [
        path
        for path in sorted(folder.rglob("*"))
        if path.is_file() and path.name != NAME and not path.name.startswith(".")
    ]


def _file(crate: ROCrate, path: Path, name: str) -> Any:
    properties = {
        "name": path.name,
        "contentSize": str(path.stat().st_size),
        "sha256": sha256(path),
        "encodingFormat": MEDIA_TYPES.get(path.suffix, "application/octet-stream"),
    }
    if name.startswith("file:"):
        outside = crate.add(ContextEntity(crate, name, {"@type": "File", **properties}))
        crate.root_dataset.append_to("hasPart", outside)
        return outside
    return crate.add_file(dest_path=name, properties=properties)


def _software(crate: ROCrate, name: str, version: str) -> Any:
    properties = {"@type": "SoftwareApplication", "name": name, "softwareVersion": version}
    return crate.add(ContextEntity(crate, f"#{name.lower()}", properties))
