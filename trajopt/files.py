"""Files that are whole or not there, and checksums: damage is noticed, not read. Tables of numbers."""

from __future__ import annotations

import csv
import hashlib
import io
import json
import math
import os
import re
import stat
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, TrajoptError

LARGEST = 1e9  # of a number, m, kg, s, N m, ...: beyond, products leave the numbers; chosen
LARGEST_TABLE = (
    100_000_000  # bytes of a table of numbers; chosen: an hour in steps of a millisecond
)
_KEY = "checksum"  # the key of sealed JSON that the checksum of all others stands under


class DamageError(TrajoptError):
    """A file does not hold what was written."""


@contextmanager
def whole_file(file: Path) -> Iterator[Path]:
    """A name beside ``file`` to write under, with the same suffix: becomes ``file`` when all is
    written, and goes where that fails."""
    part = file.with_name(f".part-{os.getpid()}-{file.name}")
    try:
        yield part
        os.replace(part, file)
    finally:
        part.unlink(missing_ok=True)


def content_of(file: str | Path, most: int) -> bytes:
    """Bytes of a file, ``most`` of them. Raises OSError and ValueError: for a name that is none, what
    is no file (a device without end, a pipe), and a larger one."""
    path = Path(file)  # a number would be an open file
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError("not a regular file")
    with open(path, "rb") as stream:
        data = stream.read(most + 1)
    if len(data) > most:
        raise ValueError(f"larger than {most:,} bytes")
    return data


def read_table(
    file: str | Path, columns: Sequence[str], free: Collection[str] = ()
) -> dict[str, Array]:
    """Those ``columns`` of a CSV file, every bit of their numbers: finite ones, but for ``free``
    columns, where an empty field is NaN. Lines that start with # are passed over.

    Raises ArgumentError, naming file, row and column, where the table is another.
    """
    number = 0
    found: list[list[float]] = [[] for _ in columns]

    def lines(text: str) -> Iterator[str]:
        nonlocal number
        for number, line in enumerate(io.StringIO(text, newline=""), 1):  # noqa: B007
            if not line.startswith("#"):
                yield line

    try:
        rows = csv.reader(lines(content_of(file, LARGEST_TABLE).decode("utf-8-sig")), strict=True)
        header = next(rows, [])
        places = [header.index(name) for name in columns if header.count(name) == 1]
        if len(places) < len(columns):
            raise ValueError(f"its columns are {', '.join(header) or 'none'}")
        for row in rows:
            if len(row) != len(header):
                raise ValueError(f"{len(row)} fields instead of {len(header)}")
            for name, place, values in zip(columns, places, found, strict=True):
                value = float(row[place] or "nan") if "_" not in row[place] else math.nan
                if name not in free and not abs(value) <= LARGEST:
                    raise ValueError(f"{name} = {row[place]!r}, beyond {LARGEST:g} or not finite")
                values.append(value)
    except (OSError, TypeError, ValueError, csv.Error) as error:
        where = f"{file}, row {number}" if number else str(file)
        raise ArgumentError(
            where, str(error), f"a table with columns {', '.join(columns)}"
        ) from None
    return {name: np.array(values) for name, values in zip(columns, found, strict=True)}


def file_name(name: str) -> str:
    """A name for a file out of any text, in no other folder: other characters than letters, digits,
    ``_``, ``-`` and ``.`` become ``_``, and a checksum tells such names apart.

    >>> file_name("track"), file_name("../track")
    ('track', '_.._track-87273933')
    """
    plain = re.sub(r"[^\w.-]", "_", name)[:100]
    if plain == name and not plain.startswith("."):
        return name
    return f"_{plain}-{digest(name.encode(errors='backslashreplace'))[:8]}"


def digest(data: bytes) -> str:
    """Checksum of bytes: the first 32 hexadecimal digits of their SHA-256."""
    return hashlib.sha256(data).hexdigest()[:32]


def checksums(folder: Path, names: Collection[str]) -> dict[str, str]:
    """Checksums of those files that are in ``folder``, by name."""
    files = {name: folder / name for name in names}
    return {n: digest(file.read_bytes()) for n, file in files.items() if file.exists()}


def require_unchanged(folder: Path, sums: Mapping[str, str]) -> None:
    """Raises DamageError for a file of ``folder`` that is missing or does not match its checksum."""
    found = checksums(folder, sums)
    for name, expected in sums.items():
        if found.get(name) != expected:
            why = "its content does not match its checksum" if name in found else "it is missing"
            raise DamageError(f"{folder / name}: damaged: {why}")


def seal(content: Mapping[str, Any]) -> str:
    """JSON text of ``content`` with a checksum over it as the last key.

    >>> unseal(seal({"a": 1}), "file")
    {'a': 1}
    """
    return json.dumps({**content, _KEY: digest(_plain(content))}, indent=2) + "\n"


def unseal(text: str | bytes, file: str) -> dict[str, Any]:
    """The content of sealed JSON; ``file`` is its name for the message. Raises DamageError."""
    try:
        found = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise DamageError(f"{file}: damaged: not readable as JSON ({error})") from None
    if not isinstance(found, dict) or _KEY not in found:
        raise DamageError(f"{file}: damaged: a JSON object with the key '{_KEY}' is expected")
    if found.pop(_KEY) != digest(_plain(found)):
        raise DamageError(f"{file}: damaged: its content does not match its checksum")
    return found


def _plain(content: Mapping[str, Any]) -> bytes:
    return json.dumps(content, sort_keys=True).encode()
