"""The page of a sweep: filters, heat maps, a table and each case, out of one file."""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.report.files import made_folder
from trajopt.report.viewer.pages import packed, write_page
from trajopt.sweeps.rows import DONE, FIXED_COLUMNS
from trajopt.sweeps.store import open_store

if TYPE_CHECKING:
    import pandas as pd

_DIGITS = 12  # of a case's identity, enough to find it by; chosen
_FEW = 40  # different values of a column that can be an axis, chosen
_LONG = 400  # characters of a text that are shown, chosen


def write_sweep_page(store: FilePath, file: FilePath, *, value: str | None = None) -> FilePath:
    """Write the page of a store into ``file``; its path. ``value``: the column that heat maps show first (None: the
    first outcome). Raises StoreError as ``open_store``."""
    frame = open_store(store, create=False).frame()
    data = sweep_data(frame, value)
    data |= {"title": f"Sweep {store.name}", "store": str(store)}
    made_folder(file.parent)
    return write_page("sweep", data, file)


def sweep_data(frame: pd.DataFrame, value: str | None = None) -> dict[str, Any]:
    """Columns of a sweep's table: what varied first, then outcomes, then how each case ran."""
    names = [name for name in frame.columns if frame[name].notna().any()]
    of_run = [name for name in names if name in FIXED_COLUMNS]
    own = [name for name in names if name not in of_run]
    axes = [name for name in own if name != "repeat" and _varies(frame[name])]
    columns = [_column(frame[name], name in axes) for name in [*own, *of_run]]
    outcomes = [name for name in own if name not in axes and frame[name].dtype.kind in "fib"]
    flags = [
        name
        for name in own
        if frame[name].dropna().isin([0, 1]).all() and frame[name].nunique() == 2
    ]
    done = int((frame["status"] == DONE).sum()) if "status" in frame else len(frame)
    return {
        "about": f"{len(frame):,} cases, {done:,} done; click a cell or a row",
        "count": len(frame),
        "value": value or next(iter([*flags, *outcomes]), ""),
        "columns": columns,
    }


def _varies(column: pd.Series) -> bool:
    """Whether a column has few values, each in several rows."""
    different = column.nunique()
    return bool(2 < different <= _FEW and different * 2 <= column.notna().sum()) or (
        different == 2 and column.dtype.kind not in "b"
    )


def _column(column: pd.Series, axis: bool) -> dict[str, Any]:
    found: dict[str, Any] = {"name": str(column.name), "axis": axis}
    if column.dtype.kind in "fiub":
        return found | {"values": packed(column.to_numpy(dtype=np.float64, na_value=np.nan))}
    texts = column.map(lambda v: "" if v is None else str(v)[:_LONG])
    if column.name == "case":
        texts = texts.str[:_DIGITS]
    kinds = texts.astype("category").cat
    codes = kinds.codes.to_numpy()
    return found | {
        "texts": list(kinds.categories),
        "values": packed(np.where(codes < 0, np.nan, codes)),
    }
