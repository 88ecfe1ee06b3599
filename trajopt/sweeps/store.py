"""The store of a sweep: a directory of Parquet parts that is whole at every instant.

- ``store.json``: format of the store
- ``parts/*.parquet``: finished cases, one row a case; pandas, polars, DuckDB read them as they are
- ``arrays/*.parquet``: arrays of run functions: case, start of its run, name, shape, values
- ``runs/*.json``: who ran what, with which versions and source, when
- ``jobs/``: what Slurm array elements are to do
- ``temporary/``: files being written; ``damaged/``: files that ``repair`` took out

A part is written under a temporary name, flushed to disk and renamed, and never changed afterwards.
Its name is its chunk's, a random one, so that several writers never meet, and its checksum. Rows of
the same case may exist several times; reading keeps one: of the code that ran last, a finished one
before a failed one, then the last. ``upkeep.py`` merges, verifies and repairs.
"""

from __future__ import annotations

import errno
import os
import time
import uuid
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, BoolArray
from trajopt.files import DamageError, seal, unseal
from trajopt.sweeps.merging import one_row_a_case, united
from trajopt.sweeps.parts import StoreError, chunk_of, encoded, part_table, parts_in
from trajopt.sweeps.rows import DONE, KEY_COLUMNS, RUN_COLUMNS, arrow

FORMAT = 2
COMPACT = "compact"  # chunk name of merged parts
_FOLDERS = ("temporary", "parts", "arrays", "runs", "jobs")  # the first marks a store
_READ_TRIES = 100  # listings of the parts before giving up, while compactions go on; chosen


@dataclass(frozen=True)
class Store:
    """Results in the directory ``path``. ``open_store`` makes or checks it."""

    path: Path

    # -- writing

    def write(self, place: str, data: bytes) -> None:
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
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            os.replace(temporary, target)
            _sync_directory(target.parent)
        except OSError as error:
            with suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise _write_error(self.path, error) from None

    def write_part(self, folder: str, chunk: str, table: Any) -> None:
        """Write an Arrow table durably as a part of ``folder``. Raises as ``write``."""
        name, data = encoded(chunk, table)
        self.write(f"{folder}/{name}", data)

    def write_record(self, place: str, content: Mapping[str, Any]) -> None:
        """Write JSON with its checksum durably. Raises as ``write``."""
        self.write(place, seal(content).encode())

    # -- reading

    def parts(self, folder: str = "parts") -> list[Path]:
        """Files of whole parts, sorted by name."""
        return parts_in(self.path / folder)

    def table(self, columns: Sequence[str] | None = None) -> Any:
        """All cases as one Arrow table, one row a case, sorted by case.

        ``columns`` limits what is read (case and status always are). Raises StoreError for a
        damaged part.
        """
        if columns is None:
            return one_row_a_case(self.rows())
        table = one_row_a_case(self.rows([*KEY_COLUMNS, *columns]))
        wanted = [n for n in dict.fromkeys(("case", "status", *columns)) if n in table.column_names]
        return table.select(wanted)

    def stable_table(self) -> Any:
        """``table`` without the columns of time, host and path: equal for equal sweeps, however
        they ran."""
        table = self.table()
        return table.select(sorted(n for n in table.column_names if n not in RUN_COLUMNS))

    def frame(self, columns: Sequence[str] | None = None) -> Any:
        """``table`` as a pandas data frame."""
        return self.table(columns).to_pandas(split_blocks=True, self_destruct=True)

    def finished(
        self,
        *,
        with_failed: bool = True,
        where: tuple[str, str] | None = None,
        chunks: Collection[str] | None = None,
    ) -> NDArray[np.bytes_]:
        """Identities (n,) of cases that have a row: all, or only those that are done; of all rows,
        or those ``where`` a column has a value; of all parts, or those of ``chunks`` and merged
        ones."""
        column = where[0] if where else "case"
        files = None if chunks is None else lambda f: chunk_of(f) in (COMPACT, *chunks)
        table = self.rows(["case", "status", column], files=files)
        compute = arrow().compute
        if where and len(table):
            table = table.filter(compute.equal(table[column], where[1]))
        if not with_failed:
            table = table.filter(compute.equal(table["status"], DONE))
        if len(table) == 0:
            return np.empty(0, dtype="S32")
        return np.unique(table["case"].to_numpy().astype("S32"))

    def counts(self) -> dict[str, int]:
        """Cases by status."""
        found = self.table(["status"])["status"].value_counts().to_pylist()
        return {
            entry["values"]: entry["counts"]
            for entry in sorted(found, key=lambda e: str(e["values"]))
        }

    def case(self, prefix: str) -> tuple[dict[str, Any], dict[str, Array]]:
        """Row and arrays, of the same run, of the one case whose identity starts with ``prefix``.
        Raises StoreError."""
        compute = arrow().compute
        table = self.table()
        table = table.filter(compute.starts_with(table["case"], prefix))
        if len(table) != 1:
            raise StoreError(
                f"{self.path}: {len(table)} cases start with {prefix!r}; give more digits of one case"
            )
        row = table.to_pylist()[0]
        arrays: dict[str, Array] = {}
        if row["case_arrays"]:

            def mine(part: Any) -> Any:
                same = compute.equal(part["run_started"], table["run_started"][0])
                return part.filter(compute.and_(compute.equal(part["case"], row["case"]), same))

            for entry in self.rows(folder="arrays", keep=mine).to_pylist():
                values = np.asarray(entry["values"], dtype=np.float64)
                arrays[entry["name"]] = values.reshape(entry["shape"])
        if len(arrays) != row["case_arrays"]:
            raise StoreError(
                f"{self.path}: case {row['case']} has {len(arrays)} of its {row['case_arrays']} "
                f"arrays: trajopt sweep repair '{self.path}', then run the sweep again"
            )
        return row, arrays

    def arrays(self) -> Any:
        """Arrays of all cases of ``table``, each from the run that its row is from, as an Arrow
        table sorted by case and name."""
        rows, table = self.table(["run_started"]), self.rows(folder="arrays")
        if not len(table):
            return table
        table = table.filter(arrow().array(present(table, rows)))
        return table.sort_by([("case", "ascending"), ("name", "ascending")])

    def rows(
        self,
        columns: Sequence[str] | None = None,
        *,
        folder: str = "parts",
        keep: Any = None,
        files: Any = None,
    ) -> Any:
        """Rows of all parts in one table, a case as often as it was stored; a column that a part
        lacks is null there. ``keep`` filters each part's table, ``files`` the parts. Raises
        StoreError."""
        pa = arrow()
        tables: dict[Path, Any] = {}  # parts never change, so what was read once stays good
        for attempt in range(_READ_TRIES):
            gone = False
            for file in self.parts(folder):
                if file in tables or (files and not files(file)):
                    continue
                try:
                    table = part_table(file, columns)
                except FileNotFoundError:  # merged away between listing and reading: list again
                    gone = True
                else:
                    tables[file] = keep(table) if keep else table
            if not gone:
                break
            time.sleep(0.01 * attempt)
        else:
            raise StoreError(f"{self.path}: compactions go on without end; read when they are done")
        if not tables:
            return pa.table(dict.fromkeys(("case", "status"), pa.array([], pa.string())))
        return united(list(tables.values()))

    def compact(self) -> tuple[int, int]:
        """Merge small parts into large ones; see ``upkeep.compact``."""
        from trajopt.sweeps.upkeep import compact

        return compact(self)

    def runs(self) -> list[dict[str, Any]]:
        """Metadata of all runs, oldest first. Raises StoreError for a damaged one."""
        found = [self.record(file) for file in self.records()]
        return sorted(found, key=lambda r: str(r.get("started")))

    def records(self) -> list[Path]:
        """Files of the records of runs."""
        folder = self.path / "runs"
        names = sorted(os.listdir(folder)) if folder.is_dir() else []
        return [folder / name for name in names if name.endswith(".json")]

    def record(self, file: Path) -> dict[str, Any]:
        """A record of a run. Raises StoreError."""
        try:
            return unseal(file.read_bytes(), str(file))
        except (DamageError, OSError) as error:
            raise StoreError(f"{error}: trajopt sweep repair '{self.path}'") from None


def present(table: Any, rows: Any) -> BoolArray:
    """Which entries (n,) of ``table`` have case and start of a run in common with one of
    ``rows``."""
    keys = ["case", "run_started"]
    known = rows.select(keys).to_pandas().drop_duplicates()
    merged = table.select(keys).to_pandas().merge(known, how="left", on=keys, indicator=True)
    found: BoolArray = (merged["_merge"] == "both").to_numpy()
    return found


def open_store(path: str | Path | Store, *, create: bool = True) -> Store:
    """The store at ``path``, made where there is none and ``create`` is set.

    Raises StoreError for a directory of another format, or one that is not a store.
    """
    if isinstance(path, Store):
        return path
    place = Path(path)
    file = place / "store.json"
    try:
        if not file.exists():
            if not create:
                raise StoreError(f"{place}: no sweep store here (store.json is missing)")
            if place.exists() and any(place.iterdir()) and not (place / "temporary").is_dir():
                raise StoreError(
                    f"{place}: neither empty nor a sweep store; give another directory"
                )
            for folder in _FOLDERS:
                (place / folder).mkdir(parents=True, exist_ok=True)
            Store(place).write_record("store.json", {"format": FORMAT, "kind": "trajopt sweep"})
        data = file.read_bytes()
    except OSError as error:
        raise _write_error(place, error) from None
    except ValueError as error:  # NUL in a name
        raise StoreError(f"{str(place)!r}: expected the directory of a store ({error})") from None
    if b'"format": 1,' in data and b"checksum" not in data:
        raise StoreError(
            f"{place}: store of format 1, but this version reads and writes format {FORMAT}; use "
            "the trajopt version that wrote it (see runs/*.json), read parts/ with pandas, or give "
            "another directory"
        )
    try:
        found = unseal(data, str(file))
    except DamageError as error:
        raise StoreError(f"{error}: trajopt sweep repair '{place}'") from None
    if found.get("format") != FORMAT:
        raise StoreError(
            f"{place}: store of format {found.get('format')!r}, but this version reads and writes "
            f"format {FORMAT}; use the trajopt version that wrote it, or another directory"
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
    return StoreError(f"{path}: cannot write or read the store ({error})")
