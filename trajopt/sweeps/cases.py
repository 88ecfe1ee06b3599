"""Cases of a sweep: their values, their identity and their seeds.

A case is a mapping of names to plain values. Its identity is a hash of that content together with
what it is run on (problem, name of the run function); its seed comes from the identity. So nothing
depends on the order of cases, on how they are chunked, or on how many workers there are. A row also
has the checksum of the code that made it (``source.py``): only rows of a case's present code count
as its own, while its seed stays when the code changes.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from trajopt.arrays import AnyArray, IntArray
from trajopt.errors import ArgumentError

SAMPLED = 3  # cases run first, to learn their time and columns
ID_BYTES = 16  # 128 bit: two of 1e9 cases collide with probability 1e-21
_BLOCK = 20_000  # cases hashed at a time, to bound memory; chosen
_INT64 = 2**63


@dataclass(frozen=True, slots=True)
class Case:
    """One case: ``id`` (32 hexadecimal digits) and its values by name; ``case["name"]`` is one
    value."""

    id: str
    values: Mapping[str, Any]

    def __getitem__(self, name: str) -> Any:
        return self.values[name]

    @property
    def seed(self) -> int:
        """Seed in 0 .. 2^63 - 1, from the identity."""
        return int(self.id[:16], 16) >> 1

    def rng(self) -> Generator:
        """A fresh random generator; every call gives the same stream."""
        return np.random.default_rng(int(self.id, 16))


@dataclass(frozen=True)
class CaseTable:
    """Cases as columns, which keeps a million of them small.

    ``columns`` maps names to arrays (n,): bool, int64, float64, or object. ``ids`` (n,) are the
    identities as bytes. Equal cases appear once.
    """

    columns: Mapping[str, AnyArray]
    ids: NDArray[np.bytes_]

    def __len__(self) -> int:
        return len(self.ids)

    def take(self, positions: IntArray) -> CaseTable:
        """The cases at ``positions``."""
        return CaseTable(
            {name: column[positions] for name, column in self.columns.items()}, self.ids[positions]
        )

    @property
    def name(self) -> str:
        """Name of a chunk of these cases: a hash of their identities."""
        return hashlib.blake2b(self.ids.tobytes(), digest_size=8).hexdigest()

    def sampled(self) -> CaseTable:
        """First, middle and last case, for estimates."""
        return self.take(spread(len(self)))

    def rows(self) -> list[Case]:
        """All cases, one object each."""
        names = list(self.columns)
        lists = [column.tolist() for column in self.columns.values()]
        values = zip(*lists, strict=True) if lists else iter([()] * len(self))
        return [
            Case(key.decode(), dict(zip(names, row, strict=True)))
            for key, row in zip(self.ids.tolist(), values, strict=True)
        ]


def spread(count: int) -> IntArray:
    """SAMPLED positions or fewer, from the first to the last of ``count``."""
    return np.unique(np.linspace(0, count - 1, min(SAMPLED, count)).round().astype(np.int64))


def case_table(
    cases: Iterable[Mapping[str, Any]] | Mapping[str, AnyArray], base: bytes = b""
) -> CaseTable:
    """Table of cases, given as mappings with equal keys or as columns; ``base`` comes from
    ``identity_base``.

    Raises ArgumentError for unequal keys, reserved names, and values that are not finite numbers,
    texts, booleans, None, or lists and mappings of those.
    """
    if isinstance(cases, Mapping):
        columns = {name: as_column(name, values) for name, values in cases.items()}
    else:
        columns = _columns_of(cases)
    sizes = {len(c) for c in columns.values()}
    if len(sizes) > 1:
        raise ArgumentError(
            "cases", {name: len(c) for name, c in columns.items()}, "columns of equal length"
        )
    ids = _identities(columns, base, sizes.pop() if sizes else 0)
    _, first = np.unique(ids, return_index=True)
    table = CaseTable(columns, ids)
    return table if len(first) == len(ids) else table.take(np.sort(first))


def identity_base(run: str, problem: Any) -> bytes:
    """What all identities of a sweep share: name of the run function, content of the problem."""
    text = json.dumps([run, canonical("problem", problem)], sort_keys=True, separators=(",", ":"))
    return hashlib.blake2b(text.encode(), digest_size=ID_BYTES).digest()


def canonical(name: str, value: Any) -> Any:
    """A value in plain Python: finite numbers (-0.0 becomes 0.0), texts, booleans, None, lists,
    mappings.

    Raises ArgumentError for anything else.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        try:
            return value if value.isascii() or value.encode() else ""
        except UnicodeEncodeError:
            raise ArgumentError(name, value, "a text that UTF-8 can hold") from None
    if isinstance(value, int):
        if not -_INT64 <= value < _INT64:
            raise ArgumentError(name, value, "a whole number of at most 64 bits")
        return value
    if isinstance(value, float):
        if not math.isfinite(
            value
        ):  # fifty times faster than NumPy's, on every value of every case
            raise ArgumentError(name, value, "a finite number")
        return value + 0.0
    if isinstance(value, np.ndarray):
        return canonical(name, value.tolist())
    if isinstance(value, (list, tuple)):
        return [canonical(name, v) for v in value]
    if isinstance(value, Mapping) and all(isinstance(k, str) for k in value):
        return {k: canonical(f"{name}.{k}", value[k]) for k in sorted(value)}
    raise ArgumentError(
        name, value, "numbers, texts, booleans, None, or lists and mappings of those"
    )


def as_column(name: str, values: Sequence[Any] | AnyArray) -> AnyArray:
    """One column (n,) of canonical values; whole numbers mixed with others become floats."""
    if isinstance(values, np.ndarray) and values.ndim == 1 and values.dtype.kind in "biuf":
        if values.dtype.kind == "f":
            if not np.all(np.isfinite(values)):
                raise ArgumentError(name, values[~np.isfinite(values)][0], "finite numbers")
            return values.astype(np.float64) + 0.0
        return values if values.dtype.kind == "b" else values.astype(np.int64)
    plain = [canonical(name, v) for v in values]
    types = {type(v) for v in plain}
    if types == {bool}:
        return np.array(plain, dtype=np.bool_)
    if types == {int}:
        return np.array(plain, dtype=np.int64)
    if types and types <= {int, float}:
        return np.array(plain, dtype=np.float64)
    column = np.empty(len(plain), dtype=object)
    column[:] = plain
    return column


def _columns_of(cases: Iterable[Mapping[str, Any]]) -> dict[str, AnyArray]:
    names: list[str] | None = None
    values: dict[str, list[Any]] = {}
    for case in cases:
        if not isinstance(case, Mapping):
            raise ArgumentError("cases", case, "mappings of names to values")
        if names is None:
            names = list(case)
            values = {name: [] for name in names}
        if case.keys() != values.keys():
            raise ArgumentError(
                "cases", sorted(case), f"the same names in every case ({sorted(values)})"
            )
        for name in names:
            values[name].append(case[name])
    return {name: as_column(name, column) for name, column in values.items()}


def _identities(columns: Mapping[str, AnyArray], base: bytes, size: int) -> NDArray[np.bytes_]:
    names = sorted(columns)
    prefix = hashlib.blake2b(base + json.dumps(names).encode(), digest_size=ID_BYTES)
    ids = np.empty(size, dtype=f"S{2 * ID_BYTES}")
    encode = json.JSONEncoder(sort_keys=True, separators=(",", ":"), allow_nan=False).encode
    for start in range(0, size, _BLOCK):
        lists = [columns[name][start : start + _BLOCK].tolist() for name in names]
        digests = []
        for row in zip(*lists, strict=True):
            digest = prefix.copy()
            digest.update(encode(row).encode())
            digests.append(digest.hexdigest())
        ids[start : start + _BLOCK] = digests
    return ids
