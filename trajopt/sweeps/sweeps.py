"""``sweep``: run a function over many cases, keep every finished one, and go on where the last run
ended."""

from __future__ import annotations

import os
import platform
import socket
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Literal

import numpy as np

from trajopt.arrays import AnyArray, IntArray
from trajopt.errors import ArgumentError
from trajopt.provenance import commit, versions
from trajopt.sweeps.cases import CaseTable, case_table, identity_base
from trajopt.sweeps.drive import Drive, Progress, Setup
from trajopt.sweeps.executors import Engine, engine_of
from trajopt.sweeps.host import CaseLimits, default_memory, parameter_kinds
from trajopt.sweeps.parts import StoreError, opened
from trajopt.sweeps.rows import DONE, FIXED_COLUMNS, KEY_COLUMNS, Kind, arrow, arrow_type
from trajopt.sweeps.runfunction import RunFunction, name_of, packed
from trajopt.sweeps.source import Code, code_of
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.upkeep import align

TIME_LIMIT = 3600.0  # s a case may take where nothing else is said; chosen
Old = Literal["keep", "rerun"]  # what to do with cases whose rows other code made


def sweep(
    cases: CaseTable | Iterable[Mapping[str, Any]] | Mapping[str, AnyArray],
    run: RunFunction,
    *,
    executor: Engine | Executor | Callable[[], Executor] | int | None = None,
    store: str | Path | Store,
    time_limit: float = TIME_LIMIT,
    memory_limit: int | None = None,
    code: str | None = None,
    problem: Any = None,
    retry_failed: bool = False,
    old: Old | None = None,
    source: str = "",
    progress: Callable[[Progress], None] | None = None,
) -> Store:
    """Run ``run(case)`` for every case that has no row in ``store`` yet, and return the store.

    ``run`` gets a ``Case`` (values by name, ``seed``, ``rng()``) and returns a mapping of names to
    results (numbers, texts, booleans, short lists; NumPy arrays are kept beside the table), a
    number, or None. A case that raises, dies, or takes longer than ``time_limit`` s or more than
    ``memory_limit`` bytes of private memory (0: unlimited; None: a fair share of the machine)
    becomes a row that says so; ``retry_failed`` runs such cases again.

    ``executor``: None (a process a processor), a number of processes, an ``Executor``, a factory
    for one (made anew when it breaks), or an ``Engine``. ``problem`` is what else a case's identity
    depends on, ``source`` a sweep file's text for the record.

    ``code`` says what code runs, instead of the source of ``run`` and of what it imports
    (``source.py``). Where cases have rows of other code, ``old`` says whether to "keep" these or to
    "rerun" their cases.

    Raises ArgumentError, StoreError (format, damage, full disk), OldCodeError, RunLoadError;
    KeyboardInterrupt only after finished cases are stored.
    """
    if not time_limit > 0:
        raise ArgumentError("time_limit", time_limit, "seconds > 0")
    if memory_limit is not None and memory_limit < 0:
        raise ArgumentError("memory_limit", memory_limit, "bytes >= 0, or None")
    arrow()
    table, made_by = tabled(cases, run, problem), code_of(run, code)
    engine, bundle = engine_of(executor), packed(run)
    place = open_store(store)
    limits = CaseLimits(
        float(time_limit), default_memory() if memory_limit is None else memory_limit
    )
    places = missing(table, place, made_by, retry_failed=retry_failed, old=old)
    about = (name_of(run), engine.name, source, limits, made_by)
    run_id = record_run(place, table, len(places), *about)
    setup = Setup(place, run_id, bundle, limits, parameter_kinds(table), made_by.digest)
    drive = Drive(
        table, places, setup, engine, progress or (lambda _: None), known_kinds(place, table)
    )
    outcome = "failed"
    try:
        if len(places):
            drive.go()
            align(place)
        outcome = "finished"
    except KeyboardInterrupt:
        outcome = "interrupted"
        raise
    finally:
        close_record(place, run_id, outcome, drive.counts)
    return place


def tabled(cases: Any, run: RunFunction, problem: Any) -> CaseTable:
    """Table of cases with identities for this run function and problem."""
    if isinstance(cases, CaseTable):
        return cases
    table = case_table(cases, identity_base(name_of(run), problem))
    reserved = sorted(set(table.columns) & set(FIXED_COLUMNS))
    if reserved:
        raise ArgumentError(
            "cases", reserved, "names other than those of the table: " + ", ".join(FIXED_COLUMNS)
        )
    return table


def missing(
    table: CaseTable,
    store: Store,
    code: Code,
    *,
    retry_failed: bool = False,
    old: Old | None = None,
) -> IntArray:
    """Positions of cases that have no row of ``code`` in the store (with ``retry_failed``: none
    that is done); with ``old`` = "keep" those that have none of any code.

    Raises OldCodeError where that makes a difference and ``old`` does not say which.
    """
    rows = store.rows(KEY_COLUMNS)
    if not len(rows):
        return np.arange(len(table))
    if retry_failed:
        rows = rows.filter(arrow().compute.equal(rows["status"], DONE))
    mine = arrow().compute.equal(rows["case_code"], code.digest)
    present = _without(table, rows.filter(mine))
    anyhow = _without(table, rows)
    if len(present) > len(anyhow) and old is None:
        raise _old_code(table.take(np.setdiff1d(present, anyhow)), store, code)
    return anyhow if old == "keep" else present


def _without(table: CaseTable, rows: Any) -> IntArray:
    """Positions of cases that are not among rows."""
    pa = arrow()
    stored = rows["case"].cast(pa.binary()).combine_chunks()  # hashed: a million in half a second
    found = pa.compute.is_in(pa.array(table.ids.tolist(), pa.binary()), value_set=stored)
    return np.flatnonzero(~found.to_numpy(zero_copy_only=False))


class OldCodeError(StoreError):
    """Cases have rows that other code made; ``count`` of them."""

    def __init__(self, count: int, message: str) -> None:
        self.count = count
        super().__init__(message)


def _old_code(old: CaseTable, store: Store, code: Code) -> OldCodeError:
    """Which code made the rows of ``old`` cases, and what of it has changed."""
    rows = store.table(["run_id"])
    rows = rows.filter(
        arrow().compute.is_in(rows["case"], arrow().array([i.decode() for i in old.ids.tolist()]))
    )
    latest = max(rows["run_id"].to_pylist())
    record = next((r for r in store.runs() if r["run"] == latest), None)
    changed = "its record is lost"
    if record is not None:
        names = ", ".join(code.changed(record["code"]))
        changed = f"changed since: {names}; commit then {record['commit']}, now {commit()}"
    return OldCodeError(
        len(old),
        f"{store.path}: {len(old)} cases have rows of other code (run {latest}; {changed}): "
        "--rerun runs them again, --keep-old keeps these rows (in Python: old='rerun', old='keep')",
    )


def known_kinds(store: Store, table: CaseTable) -> dict[str, Kind]:
    """Kinds of result columns that are already in the store, so that new parts agree with old
    ones."""
    told: tuple[Kind, ...] = ("number", "flag", "text", "numbers")
    kinds_by_type = {str(arrow_type(kind)): kind for kind in told}
    kinds: dict[str, Kind] = {}
    parts = store.parts()
    for file in parts[:1] + parts[-1:]:
        for column in opened(file).schema_arrow:
            kind = kinds_by_type.get(str(column.type))
            if kind and column.name not in table.columns and column.name not in FIXED_COLUMNS:
                kinds.setdefault(column.name, kind)
    return kinds


# -- record of runs


def record_run(
    store: Store,
    table: CaseTable,
    missing_cases: int,
    function: str,
    engine: str,
    source: str,
    limits: CaseLimits,
    code: Code,
) -> str:
    """Write who runs what, with which versions; returns the run's name."""
    now = time.time()
    run_id = time.strftime("%Y%m%dT%H%M%S", time.gmtime(now)) + "-" + uuid.uuid4().hex[:8]
    store.write_record(
        f"runs/{run_id}.json",
        {
            "run": run_id,
            "state": "running",
            "started": now,
            "cases": len(table),
            "missing": missing_cases,
            "function": function,
            "engine": engine,
            "time_limit_s": limits.seconds,
            "memory_limit_bytes": limits.memory,
            "host": socket.gethostname(),
            "pid": os.getpid(),
            "command": sys.argv,
            "platform": platform.platform(),
            "versions": versions(),
            "commit": commit(),
            "code": dict(code.parts),
            "sweep": source,
        },
    )
    return run_id


def close_record(store: Store, run_id: str, state: str, counts: Mapping[str, int]) -> None:
    """Note how a run ended. A run that was killed stays "running" in its record."""
    file = store.path / "runs" / f"{run_id}.json"
    try:
        ending = {"state": state, "ended": time.time(), "counts": dict(counts)}
        store.write_record(f"runs/{run_id}.json", {**store.record(file), **ending})
    except Exception:  # a full disk: the reason is on its way, and must not be hidden by this one
        if state == "finished":
            raise
