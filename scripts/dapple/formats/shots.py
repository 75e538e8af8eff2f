"""Laser shots: every pulse with its returns, misses included."""

import json
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
from pyarrow import parquet

from dapple.errors import InputError
from dapple.formats.atomic import atomic
from dapple.formats.clouds import Cloud
from dapple.progress import followed

SHOT_COLUMNS = ("scan", "dx", "dy", "dz")
OFFSET_COLUMNS = ("ox", "oy", "oz")
RETURN_COLUMNS = ("range_m", "reflectance_db", "deviation")
METADATA_KEY = "dapple"
ROW_GROUP_SHOTS = 1 << 16


@dataclass(frozen=True)
class Shots:
    """Pulses in firing order; the returns of shot i are `first[i]:first[i + 1]`, near to far.

    Attributes
    ----------
    origin_m : (n, 3) float64
        Where the beam leaves the scanner, local frame [m].
    direction : (n, 3) float64
        Unit vectors, local frame.
    scan : (n,) uint16
        Number of the scan position.
    first : (n + 1,) int64
        Index of each shot's first return; a miss has none.
    range_m : (m,) float64
        Distance of each return from the origin [m].
    reflectance_db, deviation : (m,) float32
        As the scanner reports them; NaN where it does not.
    world_origin_m : (3,) float64
        World coordinates of the local origin [m].
    truth : (m,) uint8 or None
        Virtual worlds only: class of each return (4 leaf, 0 wood, 2 ground, 7 noise).
    """

    origin_m: np.ndarray
    direction: np.ndarray
    scan: np.ndarray
    first: np.ndarray
    range_m: np.ndarray
    reflectance_db: np.ndarray
    deviation: np.ndarray
    world_origin_m: np.ndarray
    truth: np.ndarray | None = None

    def __len__(self) -> int:
        return len(self.direction)

    @classmethod
    def none(cls, world_origin_m: np.ndarray) -> "Shots":
        """No shot at all, in a local frame."""
        nothing = np.empty(0, np.float32)
        return cls(
            np.empty((0, 3)),
            np.empty((0, 3)),
            np.empty(0, np.uint16),
            np.zeros(1, np.int64),
            np.empty(0),
            nothing,
            nothing,
            np.asarray(world_origin_m, float),
        )

    @property
    def n_returns(self) -> np.ndarray:
        """(n,) number of returns of each shot."""
        return np.diff(self.first)

    @property
    def shot_of_return(self) -> np.ndarray:
        """(m,) index of the shot that each return belongs to."""
        return np.repeat(np.arange(len(self)), self.n_returns)

    @property
    def return_xyz_m(self) -> np.ndarray:
        """(m, 3) position of each return, local frame [m]."""
        shot = self.shot_of_return
        return self.origin_m[shot] + self.direction[shot] * self.range_m[:, None]


def concatenate(chunks: Iterable[Shots]) -> Shots:
    """Put shots together in the order given; all share the first one's world origin.

    Raises
    ------
    InputError
        No shots at all, or some with truth and some without.
    """
    chunks = list(chunks)
    if not chunks:
        raise InputError("shots", "none", "at least one chunk", "Check the scanner's window.")
    if len({chunk.truth is None for chunk in chunks}) > 1:
        raise InputError(
            "shots", "some with truth, some without", "one kind", "Drop the truth of all."
        )

    def joined(name: str) -> np.ndarray:
        return np.concatenate([getattr(chunk, name) for chunk in chunks])

    n_returns = np.concatenate([chunk.n_returns for chunk in chunks])
    return Shots(
        first=_first(n_returns),
        world_origin_m=chunks[0].world_origin_m,
        truth=None if chunks[0].truth is None else joined("truth"),
        **{name: joined(name) for name in ("origin_m", "direction", "scan", *RETURN_COLUMNS)},
    )


def select(shots: Shots, chosen: np.ndarray) -> Shots:
    """The shots that a mask (n,) chooses, with their returns."""
    returns = np.repeat(chosen, shots.n_returns)
    return _taken(shots, chosen, returns, _first(shots.n_returns[chosen]))


def to_cloud(shots: Shots) -> Cloud:
    """The returns of shots as points.

    Returns
    -------
    Cloud
        In the order of `shots`, with `Reflectance` [dB], `Deviation` where the scanner tells any,
        `ReturnNumber` (from 1), `NumberOfReturns`, `PointSourceId` (scan), and `TrueClass` where
        the truth is known.
    """
    n_returns, shot = shots.n_returns, shots.shot_of_return
    attributes = {
        "Reflectance": shots.reflectance_db.astype(np.float32),
        "ReturnNumber": (np.arange(len(shot)) - shots.first[shot] + 1).astype(np.uint8),
        "NumberOfReturns": n_returns[shot].astype(np.uint8),
        "PointSourceId": shots.scan[shot].astype(np.uint16),
    }
    if not np.isnan(shots.deviation).all():
        attributes["Deviation"] = shots.deviation.astype(np.float32)
    if shots.truth is not None:
        attributes["TrueClass"] = shots.truth.astype(np.uint8)
    return Cloud(shots.return_xyz_m, np.asarray(shots.world_origin_m, np.float64), attributes)


def write(path: str | Path, shots: Shots, facts: dict | None = None) -> None:
    """Write shots to one Parquet file; see `write_chunks`."""
    write_chunks(path, parts(shots), facts)


def parts(shots: Shots, most: int = ROW_GROUP_SHOTS) -> Iterator[Shots]:
    """Shots in pieces of at most `most`, sharing memory with the whole."""
    return (part(shots, at, at + most) for at in range(0, len(shots), most))


def part(shots: Shots, start: int, stop: int) -> Shots:
    """Shots `start` to `stop` (not included), sharing memory with the whole."""
    stop = min(stop, len(shots))
    returns = slice(shots.first[start], shots.first[stop])
    first = shots.first[start : stop + 1] - shots.first[start]
    return _taken(shots, slice(start, stop), returns, first)


def _taken(
    shots: Shots, own: slice | np.ndarray, returns: slice | np.ndarray, first: np.ndarray
) -> Shots:
    return Shots(
        shots.origin_m[own],
        shots.direction[own],
        shots.scan[own],
        first,
        shots.range_m[returns],
        shots.reflectance_db[returns],
        shots.deviation[returns],
        shots.world_origin_m,
        None if shots.truth is None else shots.truth[returns],
    )


def write_chunks(
    path: str | Path, chunks: Iterable[Shots], facts: dict | None = None, *, moving: bool = False
) -> int:
    """Write shots chunk by chunk, one row group each, so that memory holds one chunk.

    One row a shot, misses included: `scan`, `dx`, `dy`, `dz` and the lists `range_m`,
    `reflectance_db`, `deviation` and, where known, `truth`. Directions and ranges are float32:
    at 15 m that is 1 µm, at 250 m 15 µm. Scan positions and the world origin are float64 in
    the file's metadata (key `dapple`, JSON), with `facts`.

    Of a scanner that moves, each shot's place relative to its scan's position is written too:
    `ox`, `oy`, `oz`.

    Parameters
    ----------
    path : str or Path
        Parquet file; it appears whole or not at all.
    chunks : iterable of Shots
        Taken one at a time.
    facts : dict, optional
        What a reader may want to know, such as the scanner's settings; read after the last chunk.
    moving : bool
        Shots of one scan start from different places.

    Returns
    -------
    int
        Number of shots written.

    Raises
    ------
    InputError
        No chunk, or a scan whose shots start from more than one place.
    """
    positions: dict[int, list[float]] = {}
    writer, origin, n_shots = None, None, 0
    with atomic(path) as partial:
        try:
            for chunk in chunks:
                _note_positions(path, positions, chunk, moving)
                table = _table(chunk, positions if moving else None)
                if writer is None:
                    origin = np.asarray(chunk.world_origin_m, np.float64).tolist()
                    writer = parquet.ParquetWriter(
                        partial,
                        table.schema,
                        compression="zstd",
                        use_dictionary=["scan", "truth.list.element"],
                        use_byte_stream_split=["dx", "dy", "dz", "range_m.list.element"],
                    )
                writer.write_table(table, row_group_size=max(1, len(chunk)))
                n_shots += len(chunk)
            if writer is None:
                raise InputError(path, "no shots", "at least one chunk", "Check the window.")
            head = {"scan_positions_m": positions, "world_origin_m": origin, "facts": facts or {}}
            writer.add_key_value_metadata({METADATA_KEY: json.dumps(head)})
        finally:
            if writer is not None:
                writer.close()
    return n_shots


def read(path: str | Path) -> Shots:
    """Read every shot of a file; `iterate` needs less memory.

    Raises
    ------
    InputError
        The file is missing, truncated or not one of shots.
    """
    return concatenate(iterate(path, chunk_shots=1 << 20))


def iterate(path: str | Path, chunk_shots: int = ROW_GROUP_SHOTS) -> Iterator[Shots]:
    """Read shots in the file's order, at most `chunk_shots` at a time.

    Raises
    ------
    InputError
        The file is missing, truncated or not one of shots.
    """
    with _opened(path) as file:
        head = _head(path, file)
        for batch in file.iter_batches(batch_size=chunk_shots, use_threads=False):
            yield _shots(batch, head)


@dataclass(frozen=True)
class Stored:
    """Shots of a file to go through more than once; `what` is done is said now and then."""

    path: str | Path
    what: str

    def __iter__(self) -> Iterator[Shots]:
        return followed(iterate(self.path), self.what, read_head(self.path)["n_shots"], size=len)


def read_head(path: str | Path) -> dict:
    """Facts about a file of shots, without its rows.

    Returns
    -------
    dict
        `n_shots`, `scan_positions_m` (dict of int to (3,) float64), `world_origin_m` ((3,)
        float64), `facts` (as given to the writer).
    """
    with _opened(path) as file:
        return {"n_shots": file.metadata.num_rows, **_head(path, file)}


@contextmanager
def _opened(path: str | Path) -> Iterator[parquet.ParquetFile]:
    """Open a Parquet file; what is wrong with it becomes an InputError that names it."""
    expected, remedy = "a Parquet file of shots", "Write it anew with the scan step."
    if not Path(path).is_file():
        raise InputError(path, "no such file", expected, remedy)
    try:
        with parquet.ParquetFile(path) as file:
            yield file
    except (pa.ArrowException, OSError) as error:
        raise InputError(path, f"a damaged file ({error})", expected, remedy) from error


def _head(path: str | Path, file: parquet.ParquetFile) -> dict:
    """Scan positions, world origin and facts."""
    metadata = file.metadata.metadata or {}
    missing = {*SHOT_COLUMNS, *RETURN_COLUMNS} - set(file.schema_arrow.names)
    if missing or METADATA_KEY.encode() not in metadata:
        found = f"no column {', '.join(sorted(missing))}" if missing else "no scan positions"
        raise InputError(
            path, found, "shots with their scan positions", "Use formats.shots to write it."
        )
    head = json.loads(metadata[METADATA_KEY.encode()])
    positions = head["scan_positions_m"].items()
    head["scan_positions_m"] = {int(scan): np.array(place) for scan, place in positions}
    head["world_origin_m"] = np.array(head["world_origin_m"])
    return head


def _note_positions(
    path: str | Path, positions: dict[int, list[float]], chunk: Shots, moving: bool
) -> None:
    """Remember where each scan stands, or begins where it moves."""
    scans, at, which = np.unique(chunk.scan, return_index=True, return_inverse=True)
    places = chunk.origin_m[at]
    for scan, place in zip(scans.tolist(), places.tolist(), strict=True):
        known = positions.setdefault(scan, place)
        if moving:
            continue
        if known != place or not np.array_equal(chunk.origin_m, places[which]):
            raise InputError(
                path,
                f"scan {scan} from more than one place",
                "one position a scan",
                "Give every position its own scan number.",
            )


def _table(shots: Shots, positions: dict[int, list[float]] | None = None) -> pa.Table:
    """Shots as an Arrow table, one row each; with positions, of scanners that move."""
    first = pa.array(shots.first.astype(np.int32))
    columns = {"scan": pa.array(shots.scan.astype(np.uint16))}
    for k, name in enumerate(("dx", "dy", "dz")):
        columns[name] = pa.array(shots.direction[:, k].astype(np.float32))
    if positions is not None:
        places = np.array([positions[scan] for scan in shots.scan.tolist()]).reshape(-1, 3)
        for k, name in enumerate(OFFSET_COLUMNS):
            columns[name] = pa.array((shots.origin_m[:, k] - places[:, k]).astype(np.float32))
    lists = {name: getattr(shots, name).astype(np.float32) for name in RETURN_COLUMNS}
    if shots.truth is not None:
        lists["truth"] = shots.truth.astype(np.uint8)
    for name, values in lists.items():
        columns[name] = pa.ListArray.from_arrays(first, pa.array(values))
    return pa.table(columns)


def _shots(batch: pa.RecordBatch, head: dict) -> Shots:
    """The inverse of `_table`."""
    scan = batch.column("scan").to_numpy()
    numbers = np.array(sorted(head["scan_positions_m"]))
    places = np.array([head["scan_positions_m"][number] for number in numbers.tolist()])

    def column(name: str, dtype: type) -> np.ndarray:
        values = batch.column(name)
        values = values.flatten() if pa.types.is_list(values.type) else values
        return values.to_numpy(zero_copy_only=False).astype(dtype)

    n_returns = batch.column("range_m").value_lengths().to_numpy()
    origin = places.reshape(-1, 3)[np.searchsorted(numbers, scan)]
    if OFFSET_COLUMNS[0] in batch.schema.names:
        origin = origin + np.stack([column(n, np.float64) for n in OFFSET_COLUMNS], axis=1)
    return Shots(
        origin,
        np.stack([column(name, np.float64) for name in ("dx", "dy", "dz")], axis=1),
        scan.astype(np.uint16),
        _first(n_returns),
        column("range_m", np.float64),
        column("reflectance_db", np.float32),
        column("deviation", np.float32),
        head["world_origin_m"],
        column("truth", np.uint8) if "truth" in batch.schema.names else None,
    )


def _first(n_returns: np.ndarray) -> np.ndarray:
    """Index of each shot's first return, with the end."""
    return np.concatenate([[0], np.cumsum(n_returns, dtype=np.int64)])
