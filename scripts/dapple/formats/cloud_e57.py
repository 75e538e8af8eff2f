"""E57: every scan of the file, posed in the common frame."""

from pathlib import Path

import numpy as np
import pye57

from dapple.errors import InputError
from dapple.formats.cloud_raw import RawCloud

COLOURS = {"colorRed": "Red", "colorGreen": "Green", "colorBlue": "Blue"}


def read(path: Path) -> RawCloud:
    """Valid points of all scans; `PointSourceId` counts the scans from 1."""
    with _opened(path) as file:
        scans = [_scan(path, file, index) for index in range(file.scan_count)]
    if not scans:
        return RawCloud(np.empty((0, 3)))
    common = set.intersection(*(set(attributes) for _, attributes in scans))
    attributes = {
        name: np.concatenate([scan[1][name] for scan in scans]) for name in sorted(common)
    }
    return RawCloud(np.concatenate([xyz for xyz, _ in scans]), attributes=attributes)


def scan_positions(path: Path) -> np.ndarray:
    """(s, 3) world coordinates of the scanner of each scan [m]."""
    with _opened(path) as file:
        return np.array([_translation(file.get_header(k)) for k in range(file.scan_count)])


def _translation(header) -> np.ndarray:
    return np.asarray(header.translation if header.has_pose() else np.zeros(3), float)


def _scan(path: Path, file: pye57.E57, index: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    header = file.get_header(index)
    if not header.point_count:
        return np.empty((0, 3)), {"PointSourceId": np.empty(0, np.uint16)}
    try:
        data = file.read_scan(index, intensity=True, colors=True, ignore_missing_fields=True)
    except Exception as error:  # the library raises its own kinds on damaged sections
        raise _damaged(path, f"scan {index + 1}: {error}") from error
    xyz = np.stack([data[f"cartesian{axis}"] for axis in "XYZ"], axis=1)
    attributes = {"PointSourceId": np.full(len(xyz), index + 1, np.uint16)}
    if "intensity" in data:
        attributes["Intensity"] = np.asarray(data["intensity"])
    attributes |= {ours: np.asarray(data[name]) for name, ours in COLOURS.items() if name in data}
    return xyz, attributes


class _opened:
    """The open file; closed at the end, and an InputError where it is no E57 file."""

    def __init__(self, path: Path):
        self.path = path

    def __enter__(self) -> pye57.E57:
        try:
            self.file = pye57.E57(str(self.path))
        except Exception as error:
            raise _damaged(self.path, str(error)) from error
        return self.file

    def __exit__(self, *_) -> None:
        self.file.close()


def _damaged(path: Path, found: str) -> InputError:
    message = " ".join(found.split())[:200]
    return InputError(
        path, f"a damaged file ({message})", "a complete E57 file", "Copy or export it again."
    )
