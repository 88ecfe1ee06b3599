"""One finished case as a row, and rows as Arrow tables with columns of known kinds."""

from __future__ import annotations

import enum
import json
import time
from collections.abc import Container, Mapping, Sequence
from typing import Any, Literal, NamedTuple

import numpy as np

from trajopt.arrays import AnyArray
from trajopt.errors import ArgumentError, MissingDependencyError
from trajopt.sweeps.cases import CaseTable

Kind = Literal["number", "integer", "flag", "text", "numbers", "json"]

DONE, ERROR, TIMEOUT, CRASHED = "done", "error", "timeout", "crashed"
RUN_COLUMNS = (
    "run_id",
    "run_started",
    "run_seconds",
    "run_host",
    "run_attempts",
    "error_traceback",
)
KEY_COLUMNS = ("case", "status", "case_code", "run_started")  # which row of a case counts
FIXED_COLUMNS = (
    *("case", "status", "case_seed", "case_code", "case_arrays"),
    *("error", "error_message", *RUN_COLUMNS),
)
_EXACT = 2**53  # up to here a float64 holds every whole number
_LONGEST = 1_000  # numbers in a list that may be a cell; longer ones belong into an array; chosen


class Row(NamedTuple):
    """One finished case: ``place`` in its chunk, ``status``, flat ``results``, ``arrays`` kept
    beside the table."""

    place: int
    status: str
    results: dict[str, Any]
    arrays: dict[str, AnyArray]
    error: str = ""
    message: str = ""
    traceback: str = ""
    started: float = 0.0  # s since 1970
    seconds: float = 0.0
    attempts: int = 1


class Origin(NamedTuple):
    """What all rows of a chunk share: the run, the checksum of the code, the host."""

    run_id: str
    code: str
    host: str


def failed_row(
    place: int, status: str, error: str, message: str, output: str, seconds: float
) -> Row:
    """Row of a case that ends now without results; ``output`` is traceback or printed text."""
    message, output = (t.encode(errors="backslashreplace").decode() for t in (message, output))
    return Row(place, status, {}, {}, error, message, output, time.time() - seconds, seconds)


def results_of(
    returned: Any, taken: Container[str] = ()
) -> tuple[dict[str, Any], dict[str, AnyArray]]:
    """Table cells and arrays in what a run function returned: a mapping, a number, or None.

    Nested mappings become dotted names, enums their names, NumPy arrays of one dimension or more go
    beside the table. Raises ArgumentError, naming the key, for what no table can hold, for names
    that are ``taken`` by values of the case or columns of the table, and for a name given twice.
    """
    if returned is None:
        return {}, {}
    if not isinstance(returned, Mapping):
        returned = {"value": returned}
    cells: dict[str, Any] = {}
    arrays: dict[str, AnyArray] = {}
    _flatten("", returned, cells, arrays, taken)
    return cells, arrays


def _flatten(
    prefix: str,
    values: Mapping[Any, Any],
    cells: dict[str, Any],
    arrays: dict[str, AnyArray],
    taken: Container[str],
) -> None:
    for key, value in values.items():
        if not isinstance(key, str) or not _encodes(key):
            raise ArgumentError("result key", key, "a text")
        name = prefix + key
        if name in cells or name in arrays:
            raise ArgumentError(f"result '{name}'", value, "each name once")
        if name in taken or name in FIXED_COLUMNS:
            raise ArgumentError(
                f"result '{name}'", value, "a name that no value of the case and no column has"
            )
        kind = type(value)
        if kind is float or kind is bool:
            cells[name] = value
        elif isinstance(value, enum.Enum):
            cells[name] = value.name
        elif isinstance(value, Mapping):
            _flatten(name + ".", value, cells, arrays, taken)
        elif isinstance(value, np.ndarray) and value.ndim > 0 and value.dtype.kind in "biuf":
            if (
                value.dtype.kind in "iu"
                and value.size
                and np.abs(value.astype(np.float64)).max() > _EXACT
            ):
                raise ArgumentError(f"result '{name}'", value, "whole numbers up to 2^53")
            arrays[name] = value
        else:
            cells[name] = _cell(name, value)


def _cell(name: str, value: Any) -> Any:
    if isinstance(value, (np.generic, np.ndarray)) and value.ndim == 0:
        value = value.item()
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, str):
        if not _encodes(value):
            raise ArgumentError(f"result '{name}'", value, "a text that UTF-8 can hold")
        return str(value)
    if isinstance(value, int) and abs(value) > _EXACT:
        raise ArgumentError(
            f"result '{name}'", value, "a whole number up to 2^53; give larger ones as a text"
        )
    if isinstance(value, (int, float)):
        return float(value)  # one kind for all numbers, so that parts of a sweep never disagree
    if (
        isinstance(value, (list, tuple))
        and len(value) <= _LONGEST
        and all(isinstance(v, (int, float, np.number)) and not isinstance(v, bool) for v in value)
    ):
        return [float(v) for v in value]
    raise ArgumentError(
        f"result '{name}'",
        type(value),
        "a number, text, boolean, None, short list of numbers, NumPy "
        "array of numbers, or a mapping of those",
    )


def _encodes(text: str) -> bool:
    try:
        return text.isascii() or bool(text.encode())
    except UnicodeEncodeError:  # half of a surrogate pair
        return False


_CELL_KINDS: dict[type, Kind] = {bool: "flag", str: "text", list: "numbers", float: "number"}
_COLUMN_KINDS: dict[str, Kind] = {"b": "flag", "i": "integer", "f": "number"}


def kind_of(value: Any) -> Kind | None:
    """Kind of column that holds a cell; None for a missing value."""
    return _CELL_KINDS.get(type(value))


def result_kinds(rows: Sequence[Row], known: Mapping[str, Kind]) -> dict[str, Kind]:
    """Kinds of all result columns: the known ones and what these rows bring; "text", which holds
    other values as JSON, where they differ."""
    kinds = dict(known)
    for row in rows:
        for name, value in row.results.items():
            if (kind := kind_of(value)) is not None and kinds.setdefault(name, kind) != kind:
                kinds[name] = "text"
    return kinds


def parameter_kind(column: AnyArray) -> Kind:
    """Kind of the table column that holds a column of case values."""
    if column.dtype.kind in _COLUMN_KINDS:
        return _COLUMN_KINDS[column.dtype.kind]
    types = {type(v) for v in column.tolist()} - {type(None)}
    if types == {str}:
        return "text"
    if types == {list} and all(
        type(x) in (int, float) for v in column.tolist() if v is not None for x in v
    ):
        return "numbers"
    return "json"


def arrow() -> Any:
    """The pyarrow module. Raises MissingDependencyError."""
    try:
        import pyarrow
        import pyarrow.compute
    except ImportError:
        raise MissingDependencyError("pyarrow", "sweep", "storing sweeps") from None
    return pyarrow


def arrow_type(kind: Kind) -> Any:
    pa = arrow()
    return {
        "number": pa.float64(),
        "integer": pa.int64(),
        "flag": pa.bool_(),
        "text": pa.string(),
        "numbers": pa.list_(pa.float64()),
        "json": pa.string(),
    }[kind]


def row_table(
    rows: Sequence[Row],
    cases: CaseTable,
    parameter_kinds: Mapping[str, Kind],
    kinds: Mapping[str, Kind],
    origin: Origin,
) -> Any:
    """Arrow table of rows: fixed columns, case values, results; ``row.place`` points into
    ``cases``."""
    pa = arrow()
    places = np.array([r.place for r in rows], dtype=np.int64)
    picked = cases.take(places)
    ids = [i.decode() for i in picked.ids.tolist()]
    failed = [r.status != DONE for r in rows]
    data: dict[str, Any] = {
        "case": pa.array(ids, pa.string()),
        "status": pa.array([r.status for r in rows], pa.string()),
        "case_seed": pa.array([int(i[:16], 16) >> 1 for i in ids], pa.int64()),
        "case_code": pa.array([origin.code] * len(rows), pa.string()),
        "case_arrays": pa.array([len(r.arrays) for r in rows], pa.int32()),
    }
    for name, column in picked.columns.items():
        kind = parameter_kinds[name]
        values = column.tolist()
        if kind == "json":
            values = [None if v is None else json.dumps(v, sort_keys=True) for v in values]
        data[name] = pa.array(values, arrow_type(kind))
    for name in sorted(kinds):
        values = [r.results.get(name) for r in rows]
        if kinds[name] == "text":
            values = [v if v is None or type(v) is str else json.dumps(v) for v in values]
        data[name] = pa.array(values, arrow_type(kinds[name]))
    for column_name, texts in (
        ("error", [r.error for r in rows]),
        ("error_message", [r.message for r in rows]),
        ("error_traceback", [r.traceback for r in rows]),
    ):
        data[column_name] = pa.array(
            [t if f else None for t, f in zip(texts, failed, strict=True)], pa.string()
        )
    data["run_id"] = pa.array([origin.run_id] * len(rows), pa.string())
    data["run_started"] = _starts([r.started for r in rows])
    data["run_seconds"] = pa.array([r.seconds for r in rows], pa.float64())
    data["run_host"] = pa.array([origin.host] * len(rows), pa.string())
    data["run_attempts"] = pa.array([r.attempts for r in rows], pa.int32())
    return pa.table(data)


def array_table(rows: Sequence[Row], cases: CaseTable) -> Any:
    """Arrow table of the arrays beside the rows: case, start of its run, name, shape, values
    (row-major, float64); None if none."""
    pa = arrow()
    found = [
        (cases.ids[r.place].decode(), name, array, r.started)
        for r in rows
        for name, array in r.arrays.items()
    ]
    if not found:
        return None
    return pa.table(
        {
            "case": pa.array([f[0] for f in found], pa.string()),
            "run_started": _starts([f[3] for f in found]),
            "name": pa.array([f[1] for f in found], pa.string()),
            "shape": pa.array([list(f[2].shape) for f in found], pa.list_(pa.int32())),
            "values": pa.array(
                [np.asarray(f[2], dtype=np.float64).ravel() for f in found], pa.list_(pa.float64())
            ),
        }
    )


def _starts(seconds: Sequence[float]) -> Any:
    """Times since 1970, s, to the microsecond; with the case they link arrays to their row."""
    pa = arrow()
    return pa.array([round(s * 1e6) for s in seconds], pa.timestamp("us", tz="UTC"))
