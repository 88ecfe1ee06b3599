"""The store of a sweep: a directory of Parquet parts that is whole at every instant.

- ``store.json``: format of the store
- ``parts/*.parquet``: finished cases, one row a case; pandas, polars and DuckDB read them as they
are
- ``arrays/*.parquet``: arrays that run functions returned: case, name, shape, values
- ``runs/*.json``: who ran what, with which versions, when
- ``jobs/``: what Slurm array elements are to do
- ``temporary/``: files being written

A part is written under a temporary name, flushed to disk and renamed, and never changed afterwards.
Its name is its chunk's and a random one, so that several writers never meet. Rows of the same case
may exist several times; reading keeps one: a finished one before a failed one, then the last.
"""

from __future__ import annotations

import errno
import json
import os
import time
import uuid
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array
from trajopt.errors import TrajoptError
from trajopt.sweeps.merging import (
    common_schema,
    conformed,
    one_array_a_name,
    one_row_a_case,
    united,
)
from trajopt.sweeps.rows import DONE, arrow

FORMAT = 1
_FOLDERS = ("temporary", "parts", "arrays", "runs", "jobs")  # the first marks a store
_STALE = 24 * 3600.0  # s after which a temporary file's writer is taken for dead; chosen
_READ_TRIES = 100  # listings of the parts before giving up, while compactions go on; chosen
_COMPACT_ROWS = 1_000_000  # rows of one compacted part, to bound memory; chosen
_ALIGNED_TOGETHER = 100  # parts of at most 10,000 rows that become one in ``align``; chosen


class StoreError(TrajoptError):
    """A store cannot be used: a wrong format, a damaged part, no space left."""


@dataclass(frozen=True)
class Store:
    """Results in the directory ``path``. ``open_store`` makes or checks it."""

    path: Path

    # -- writing

    def write(self, place: str, write: Callable[[BinaryIO], object]) -> None:
        """Write the file ``place`` of the store durably: temporary name, flush, rename.

        Raises StoreError when the disk is full or the directory cannot be written; nothing
        half-written stays.
        """
        target = self.path / place
        temporary = self.path / "temporary" / f"{uuid.uuid4().hex}-{target.name}"
        try:
            for folder in (temporary.parent, target.parent):  # git and some copies drop empty ones
                folder.mkdir(parents=True, exist_ok=True)
            with open(temporary, "wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, target)
            _sync_directory(target.parent)
        except OSError as error:
            temporary.unlink(missing_ok=True)
            raise _write_error(self.path, error) from None

    def write_part(self, folder: str, name: str, table: Any) -> None:
        """Write an Arrow table durably as ``folder/name-<random>.parquet``. Raises as ``write``."""
        import pyarrow.parquet as pq

        place = f"{folder}/{name}-{uuid.uuid4().hex[:12]}.parquet"
        self.write(place, lambda file: pq.write_table(table, file, compression="zstd"))

    def write_text(self, place: str, text: str) -> None:
        """Write a small file durably. Raises as ``write``."""
        self.write(place, lambda file: file.write(text.encode()))

    # -- reading

    def parts(self, folder: str = "parts") -> list[Path]:
        """Files of whole parts, sorted by name."""
        return sorted((self.path / folder).glob("*.parquet"))

    def table(self, columns: Sequence[str] | None = None) -> Any:
        """All cases as one Arrow table, one row a case, sorted by case.

        ``columns`` limits what is read (case and status always are). Raises StoreError for a
        damaged part.
        """
        return one_row_a_case(self._union("parts", columns))

    def frame(self, columns: Sequence[str] | None = None) -> Any:
        """``table`` as a pandas data frame."""
        return self.table(columns).to_pandas(split_blocks=True, self_destruct=True)

    def finished(self, *, with_failed: bool = True) -> NDArray[np.bytes_]:
        """Identities (n,) of cases that have a row: all, or only those that are done."""
        table = self._union("parts", ["case", "status"])
        if not with_failed:
            table = table.filter(arrow().compute.equal(table["status"], DONE))
        if len(table) == 0:
            return np.empty(0, dtype="S32")
        return np.unique(table["case"].to_numpy().astype("S32"))

    def counts(self) -> dict[str, int]:
        """Cases by status."""
        table = self.table(["case", "status"])
        found = table["status"].value_counts().to_pylist()
        return {
            entry["values"]: entry["counts"]
            for entry in sorted(found, key=lambda e: str(e["values"]))
        }

    def case(self, prefix: str) -> tuple[dict[str, Any], dict[str, Array]]:
        """Row and arrays of the one case whose identity starts with ``prefix``. Raises
        StoreError."""
        compute = arrow().compute
        table = self.table()
        table = table.filter(compute.starts_with(table["case"], prefix))
        if len(table) != 1:
            raise StoreError(
                f"{self.path}: {len(table)} cases start with '{prefix}'; give more digits of one case"
            )
        row = table.to_pylist()[0]
        arrays: dict[str, Array] = {}
        beside = self._union("arrays", None, ("case", "=", row["case"]))
        for entry in beside.to_pylist():
            arrays[entry["name"]] = np.asarray(entry["values"], dtype=np.float64).reshape(
                entry["shape"]
            )
        return row, arrays

    def _union(
        self, folder: str, columns: Sequence[str] | None, where: tuple[str, str, Any] | None = None
    ) -> Any:
        """Rows of all parts in one table; a column that a part lacks is null there."""
        pa = arrow()
        import pyarrow.parquet as pq

        tables: dict[Path, Any] = {}  # parts never change, so what was read once stays good
        for attempt in range(_READ_TRIES):
            gone = False
            for file in self.parts(folder):
                if file in tables:
                    continue
                try:
                    wanted = None
                    if columns is not None:
                        names = pq.read_schema(file).names
                        wanted = [
                            n for n in dict.fromkeys(["case", "status", *columns]) if n in names
                        ]
                    # One thread: parts are small, and workers must not outnumber their cores.
                    tables[file] = pq.read_table(
                        file,
                        columns=wanted,
                        use_threads=False,
                        memory_map=False,
                        filters=[where] if where else None,
                    )
                except FileNotFoundError:  # compacted away between listing and reading: list again
                    gone = True
                except (pa.ArrowInvalid, OSError) as error:
                    raise StoreError(
                        f"{file}: a damaged part ({error}); move it away, run again"
                    ) from None
            if not gone:
                break
            time.sleep(0.01 * attempt)
        else:
            raise StoreError(f"{self.path}: compactions go on without end; read when they are done")
        if not tables:
            return pa.table(
                {"case": pa.array([], pa.string()), "status": pa.array([], pa.string())}
            )
        return united(list(tables.values()))

    # -- upkeep

    def compact(self) -> tuple[int, int]:
        """Merge small parts into large ones, dropping double rows; safe while sweeps run.

        Returns the number of parts before and after. New parts are on disk before old ones go.
        """
        before = len(self.parts())
        import pyarrow.parquet as pq

        for folder in ("parts", "arrays"):
            sizes: dict[Path, int] = {}
            for file in self.parts(folder):
                with suppress(FileNotFoundError):  # another compaction was here
                    sizes[file] = pq.read_metadata(file).num_rows
            batches = np.cumsum(list(sizes.values()), dtype=np.int64) // _COMPACT_ROWS
            for number in np.unique(batches):
                batch = [f for f, n in zip(sizes, batches, strict=True) if n == number]
                if len(batch) > 1:
                    self._merge(folder, batch)
        for leftover in (self.path / "temporary").glob("*"):
            with suppress(FileNotFoundError):
                if time.time() - leftover.stat().st_mtime > _STALE:
                    leftover.unlink()
        self.align()
        return before, len(self.parts())

    def align(self) -> None:
        """Give all parts the same columns and types, as readers want that take the directory as it
        is.

        Parts differ where only some cases have a result. Those that lack a column are merged into
        one that has it.
        """
        import pyarrow.parquet as pq

        schemas = {}
        for file in self.parts():
            with suppress(FileNotFoundError):
                schemas[file] = pq.read_schema(file)
        common = common_schema(schemas.values())
        columns = {f.name: f.type for f in common}
        odd = [
            file for file, schema in schemas.items() if {f.name: f.type for f in schema} != columns
        ]
        for start in range(0, len(odd), _ALIGNED_TOGETHER):
            self._merge("parts", odd[start : start + _ALIGNED_TOGETHER], common)

    def _merge(self, folder: str, files: Sequence[Path], schema: Any = None) -> None:
        import pyarrow.parquet as pq

        try:
            tables = [pq.read_table(f, use_threads=False, memory_map=False) for f in files]
        except FileNotFoundError:  # another compaction was here
            return
        table = united(tables)
        table = one_row_a_case(table) if folder == "parts" else one_array_a_name(table)
        self.write_part(folder, "compact", table if schema is None else conformed(table, schema))
        for file in files:
            file.unlink(missing_ok=True)

    def runs(self) -> list[dict[str, Any]]:
        """Metadata of all runs, oldest first."""
        found = [
            json.loads(p.read_text(encoding="utf-8")) for p in (self.path / "runs").glob("*.json")
        ]
        return sorted(found, key=lambda r: str(r.get("started")))


def open_store(path: str | Path | Store, *, create: bool = True) -> Store:
    """The store at ``path``, made where there is none and ``create`` is set.

    Raises StoreError for a directory of another format, or one that is not a store.
    """
    if isinstance(path, Store):
        return path
    place = Path(path)
    file = place / "store.json"
    if not file.exists():
        if not create:
            raise StoreError(f"{place}: no sweep store here (store.json is missing)")
        if place.exists() and any(place.iterdir()) and not (place / "temporary").is_dir():
            raise StoreError(f"{place}: neither empty nor a sweep store; give another directory")
        try:
            for folder in _FOLDERS:
                (place / folder).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _write_error(place, error) from None
        Store(place).write_text(
            "store.json", json.dumps({"format": FORMAT, "kind": "trajopt sweep"}) + "\n"
        )
    try:
        found = json.loads(file.read_text(encoding="utf-8"))
    except (json.JSONDecodeError, UnicodeDecodeError) as error:
        raise StoreError(f"{file}: not readable as JSON ({error})") from None
    if not isinstance(found, Mapping) or found.get("format") != FORMAT:
        version = found.get("format") if isinstance(found, Mapping) else found
        raise StoreError(
            f"{place}: store of format {version!r}, but this version reads and writes format {FORMAT}; "
            "use the trajopt version that wrote it (see runs/*.json), or another directory"
        )
    return Store(place)


def _sync_directory(path: Path) -> None:
    """Make a rename durable."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _write_error(path: Path, error: OSError) -> StoreError:
    if error.errno in (errno.ENOSPC, errno.EDQUOT):
        return StoreError(
            f"{path}: no space left; free some and run the same command again: finished cases are kept"
        )
    return StoreError(f"{path}: cannot write the store ({error})")
