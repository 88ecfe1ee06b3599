"""One part of a store: a Parquet file that is written once and verified whenever it is read.

Its name is ``<chunk>-<rows>-<random>-<checksum>.parquet``. The bytes are compared with the checksum
before a Parquet reader sees any of them; every page carries a checksum of its own for other readers.
The identities of cases stand in it uncompressed, so that a damaged part still tells most of them.
"""

from __future__ import annotations

import io
import os
import re
import uuid
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from trajopt.errors import TrajoptError
from trajopt.files import digest
from trajopt.sweeps.rows import arrow

_NAME = re.compile(r"(\w+)-(\d+)-[0-9a-f]{8}-([0-9a-f]{32})\.parquet")
_CASE = re.compile(rb"(?<![0-9a-f])[0-9a-f]{32}(?![0-9a-f])")
_SHOWN = 3  # cases of a damaged part that its line shows; chosen


class StoreError(TrajoptError):
    """A store cannot be used: a wrong format, a damaged part, no space left."""


@dataclass(frozen=True)
class Damage:
    """A damaged ``file``: ``why``, how many rows it had (0: not known), and which of its cases can
    still be told; all of them have to run again."""

    file: Path
    why: str
    rows: int = 0
    cases: tuple[str, ...] = ()

    def __str__(self) -> str:
        if not self.rows and not self.cases:
            return f"{self.file}: damaged: {self.why}"
        shown = ", ".join(c[:12] for c in self.cases[:_SHOWN])
        more = ", ..." if len(self.cases) > _SHOWN else ""
        number = max(self.rows, len(self.cases))
        return f"{self.file}: damaged: {self.why}; to run again: {number} cases ({shown}{more})"


class PartError(StoreError):
    """A damaged part; ``damage`` says which and what is lost."""

    def __init__(self, damage: Damage) -> None:
        self.damage = damage
        store = damage.file.parent.parent
        super().__init__(f"{damage}: trajopt sweep repair '{store}', then run the sweep again")


def parts_in(folder: Path) -> list[Path]:
    """Parquet files in a folder of a store, sorted by name; none where there is no folder."""
    try:
        return sorted(folder / e.name for e in os.scandir(folder) if e.name.endswith(".parquet"))
    except FileNotFoundError:
        return []


def chunk_of(file: Path) -> str:
    """Name of the chunk that a part holds."""
    return file.name.partition("-")[0]


def rows_in(file: Path) -> int:
    """Rows of a part, by its name."""
    found = _NAME.fullmatch(file.name)
    return int(found[2]) if found else 0


def encoded(chunk: str, table: Any) -> tuple[str, bytes]:
    """File name and content of a part with the rows of an Arrow table."""
    pa = arrow()
    import pyarrow.parquet as pq

    leaves = [f.name + ".list.element" * pa.types.is_list(f.type) for f in table.schema]
    packed = [leaf for leaf in leaves if leaf != "case"]
    buffer = io.BytesIO()
    pq.write_table(
        table,
        buffer,
        compression={leaf: "none" if leaf == "case" else "zstd" for leaf in leaves},
        use_dictionary=packed,
        write_statistics=packed,
        write_page_checksum=True,
    )
    data = buffer.getvalue()
    return f"{chunk}-{len(table)}-{uuid.uuid4().hex[:8]}-{digest(data)}.parquet", data


def opened(file: Path) -> Any:
    """A part as an Arrow ParquetFile. Raises PartError, and FileNotFoundError as others may merge
    parts away at any time."""
    pa = arrow()
    import pyarrow.parquet as pq

    try:
        data = file.read_bytes()
    except FileNotFoundError:
        raise
    except OSError as error:
        raise PartError(Damage(file, f"unreadable ({error})", rows_in(file))) from None
    name = _NAME.fullmatch(file.name)
    if name is None:
        raise PartError(Damage(file, "its name holds no checksum"))
    if digest(data) != name[3]:
        told = tuple(dict.fromkeys(c.decode() for c in _CASE.findall(data)))
        raise PartError(Damage(file, "it does not match its checksum", int(name[2]), told))
    try:
        return pq.ParquetFile(pa.BufferReader(data), page_checksum_verification=True)
    except (pa.ArrowException, OSError) as error:
        raise PartError(Damage(file, f"not Parquet ({error})", int(name[2]))) from None


def part_table(file: Path, columns: Sequence[str] | None = None) -> Any:
    """A part as an Arrow table, of ``columns`` those that it has. Raises as ``opened``."""
    part = opened(file)
    if columns is not None:
        has = part.schema_arrow.names
        columns = [name for name in dict.fromkeys(columns) if name in has]
    try:  # one thread: parts are small, and workers must not outnumber their cores
        table = part.read(columns=columns, use_threads=False)
    except (arrow().ArrowException, OSError) as error:
        raise PartError(Damage(file, f"not Parquet ({error})", rows_in(file))) from None
    return table if columns is None else table.select(columns)
