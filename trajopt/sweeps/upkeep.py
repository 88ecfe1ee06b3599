"""Upkeep of a store: merging parts, finding damage, taking it out."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from trajopt.sweeps.merging import common_schema, conformed, one_row_a_case, united
from trajopt.sweeps.parts import (
    Damage,
    PartError,
    StoreError,
    chunk_of,
    opened,
    part_table,
    rows_in,
)
from trajopt.sweeps.rows import KEY_COLUMNS, arrow
from trajopt.sweeps.store import COMPACT, FORMAT, Store, open_store, present

_STALE = 24 * 3600.0  # s after which a temporary file's writer is taken for dead; chosen
_MOST_ROWS, _MOST_BYTES = 1_000_000, 256_000_000  # of a merged part, to bound memory; chosen
_ALIGNED_TOGETHER = 100  # parts of at most 10,000 rows that become one in ``align``; chosen


def compact(store: Store) -> tuple[int, int]:
    """Merge small parts into large ones, dropping double rows and their arrays; safe while sweeps
    run.

    Returns the number of parts before and after. New parts are on disk before old ones go. Raises
    StoreError for a damaged part, and leaves all parts then.
    """
    before = len(store.parts())
    for folder in ("arrays", "parts"):
        for batch in _batches(store.parts(folder)):
            if len(batch) > 1:
                _merge(store, folder, batch)
    with suppress(FileNotFoundError):
        for leftover in os.scandir(store.path / "temporary"):
            with suppress(FileNotFoundError):
                if time.time() - leftover.stat().st_mtime > _STALE:
                    os.unlink(leftover)
    align(store)
    return before, len(store.parts())


def align(store: Store) -> None:
    """Give all parts the same columns and types, as readers want that take the directory as it is.

    Parts differ where only some cases have a result. Those that lack a column are merged into one
    that has it.
    """
    schemas = {}
    for file in store.parts():
        with suppress(FileNotFoundError):
            schemas[file] = opened(file).schema_arrow
    common = common_schema(schemas.values())
    columns = {f.name: f.type for f in common}
    odd = [file for file, schema in schemas.items() if {f.name: f.type for f in schema} != columns]
    for start in range(0, len(odd), _ALIGNED_TOGETHER):
        _merge(store, "parts", odd[start : start + _ALIGNED_TOGETHER], common)


def _batches(files: Sequence[Path]) -> list[list[Path]]:
    """Files that become one: as many as its rows and bytes allow."""
    batches: list[list[Path]] = [[]]
    rows = size = 0
    for file in files:
        with suppress(FileNotFoundError):  # another compaction was here
            length = file.stat().st_size
            rows, size = rows + rows_in(file), size + length
            if batches[-1] and (rows > _MOST_ROWS or size > _MOST_BYTES):
                batches.append([])
                rows, size = rows_in(file), length
            batches[-1].append(file)
    return batches


def _merge(store: Store, folder: str, files: Sequence[Path], schema: Any = None) -> None:
    try:
        table = united([part_table(file) for file in files])
    except FileNotFoundError:  # another compaction was here
        return
    if folder == "parts":
        table = one_row_a_case(table)
    else:
        rows = store.rows(KEY_COLUMNS)
        if len(rows):  # arrays of rows that reading passes over; those still without a row stay
            current = one_row_a_case(rows)
            passed = present(table, rows) & ~present(table, current)
            table = table.filter(arrow().array(~passed))
        frame = table.select(["case", "run_started", "name"]).to_pandas()
        table = table.filter(arrow().array(~frame.duplicated().to_numpy()))
    store.write_part(folder, COMPACT, table if schema is None else conformed(table, schema))
    for file in files:
        file.unlink(missing_ok=True)


# -- damage


def verify(store: Store) -> list[Damage]:
    """Everything in a store that is damaged, or lacks its arrays; reads all of it."""
    found = []
    for folder in ("parts", "arrays"):
        for file in store.parts(folder):
            try:
                part_table(file)
            except FileNotFoundError:
                continue
            except PartError as error:
                found.append(error.damage)
    for file in store.records():
        try:
            store.record(file)
        except StoreError:
            found.append(Damage(file, "the record of a run does not match its checksum"))
    broken = {damage.file for damage in found}
    lacking = _lacking(store, broken)
    for file, cases in lacking.items():
        found.append(Damage(file, "arrays of its cases are lost", len(cases), tuple(cases)))
    return found


def repair(place: Path) -> list[Damage]:
    """Move what is damaged into ``damaged/``, each file with a list of the cases that can still be
    told, and drop rows whose arrays are lost: running the sweep again fills the gaps.

    Returns what was found. Raises StoreError for a directory that is no store.
    """
    found = []
    try:
        store = open_store(place, create=False)
    except StoreError:
        store = Store(place)
        if not _looks_like_a_store(store):
            raise
        found.append(Damage(place / "store.json", "written anew"))
        store.write_record("store.json", {"format": FORMAT, "kind": "trajopt sweep"})
    for damage in verify(store):
        found.append(damage)
        name = damage.file.name
        if damage.why.startswith("arrays of its cases"):
            table = part_table(damage.file)
            lost = arrow().compute.is_in(table["case"], arrow().array(damage.cases))
            rest = table.filter(arrow().compute.invert(lost))
            if len(rest):
                store.write_part("parts", chunk_of(damage.file), rest)
            damage.file.unlink()
            continue
        store.write(f"damaged/{name}.cases", "".join(f"{c}\n" for c in damage.cases).encode())
        os.replace(damage.file, store.path / "damaged" / name)
    return found


def _looks_like_a_store(store: Store) -> bool:
    """Whether a directory whose store.json is damaged holds parts of this format, or nothing."""
    parts = [*store.parts(), *store.parts("arrays")]
    return (store.path / "temporary").is_dir() and all(rows_in(file) for file in parts)


def _lacking(store: Store, broken: set[Path]) -> dict[Path, list[str]]:
    """Cases by part whose arrays are not in the whole files of ``arrays/``."""
    whole = [f for f in store.parts("arrays") if f not in broken]
    tables = [part_table(file, ["case", "run_started", "name"]) for file in whole]
    keys = ["case", "run_started"]
    counts: dict[Any, int] = {}
    if tables:
        counts = united(tables).to_pandas().drop_duplicates().groupby(keys).size().to_dict()
    parts = {}
    for file in store.parts():
        with suppress(FileNotFoundError):
            if file not in broken:
                parts[file] = part_table(file, [*KEY_COLUMNS, "case_arrays"])
    if not parts:
        return {}
    current = one_row_a_case(united(list(parts.values()))).to_pandas()
    lost = {
        (row.case, row.run_started)
        for row in current[current["case_arrays"] > 0].itertuples()
        if counts.get((row.case, row.run_started), 0) < row.case_arrays
    }
    found = {}
    for file, table in parts.items() if lost else ():
        pairs = zip(*(table[k].to_pandas() for k in keys), strict=True)
        if cases := [pair[0] for pair in pairs if pair in lost]:
            found[file] = cases
    return found
