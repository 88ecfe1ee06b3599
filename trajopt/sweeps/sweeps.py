"""``sweep``: run a function over many cases, keep every finished one, and go on where the last run
ended."""

from __future__ import annotations

import json
import os
import platform
import socket
import sys
import time
import uuid
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import AnyArray, IntArray
from trajopt.errors import ArgumentError
from trajopt.provenance import commit, versions
from trajopt.sweeps.cases import CaseTable, case_table, identity_base
from trajopt.sweeps.drive import Drive, Progress, Setup
from trajopt.sweeps.executors import Engine, engine_of
from trajopt.sweeps.host import CaseLimits, default_memory, parameter_kinds
from trajopt.sweeps.rows import FIXED_COLUMNS, Kind, arrow, arrow_type
from trajopt.sweeps.runfunction import RunFunction, name_of, packed
from trajopt.sweeps.store import Store, open_store

TIME_LIMIT = 3600.0  # s a case may take where nothing else is said; chosen


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
    for one (made anew when it breaks), or an ``Engine``. ``code`` is the code version in a case's
    identity, ``problem`` what else it depends on, ``source`` a sweep file's text for the record.

    Raises ArgumentError, StoreError (format, full disk), RunLoadError; KeyboardInterrupt only after
    finished cases are stored.
    """
    if not time_limit > 0:
        raise ArgumentError("time_limit", time_limit, "seconds > 0")
    if memory_limit is not None and memory_limit < 0:
        raise ArgumentError("memory_limit", memory_limit, "bytes >= 0, or None")
    arrow()
    table = tabled(cases, run, code, problem)
    engine, bundle = engine_of(executor), packed(run)
    place = open_store(store)
    limits = CaseLimits(
        float(time_limit), default_memory() if memory_limit is None else memory_limit
    )
    places = missing(table, place, retry_failed=retry_failed)
    run_id = record_run(place, table, len(places), name_of(run), engine.name, source, limits)
    setup = Setup(place, run_id, bundle, limits, parameter_kinds(table))
    drive = Drive(
        table, places, setup, engine, progress or (lambda _: None), known_kinds(place, table)
    )
    outcome = "failed"
    try:
        if len(places):
            drive.go()
            place.align()
        outcome = "finished"
    except KeyboardInterrupt:
        outcome = "interrupted"
        raise
    finally:
        close_record(place, run_id, outcome, drive.counts)
    return place


def tabled(cases: Any, run: RunFunction, code: str | None, problem: Any) -> CaseTable:
    """Table of cases with identities for this run function, code and problem."""
    if isinstance(cases, CaseTable):
        return cases
    code = code or f"trajopt {versions(())['trajopt']}"
    table = case_table(cases, identity_base(name_of(run), problem, code))
    reserved = sorted(set(table.columns) & set(FIXED_COLUMNS))
    if reserved:
        raise ArgumentError(
            "cases", reserved, "names other than those of the table: " + ", ".join(FIXED_COLUMNS)
        )
    return table


def missing(table: CaseTable, store: Store, *, retry_failed: bool = False) -> IntArray:
    """Positions of cases that have no row in the store (with ``retry_failed``: none that is
    done)."""
    known = store.finished(with_failed=not retry_failed)
    if len(known) == 0:
        return np.arange(len(table))
    places = np.searchsorted(known, table.ids)
    found = known[np.minimum(places, len(known) - 1)] == table.ids
    return np.flatnonzero(~found)


def known_kinds(store: Store, table: CaseTable) -> dict[str, Kind]:
    """Kinds of result columns that are already in the store, so that new parts agree with old
    ones."""
    import pyarrow.parquet as pq

    told: tuple[Kind, ...] = ("number", "flag", "text", "numbers")
    kinds_by_type = {str(arrow_type(kind)): kind for kind in told}
    kinds: dict[str, Kind] = {}
    parts = store.parts()
    for file in parts[:1] + parts[-1:]:
        for column in pq.read_schema(file):
            kind = kinds_by_type.get(str(column.type))
            if kind and column.name not in table.columns and column.name not in FIXED_COLUMNS:
                kinds.setdefault(column.name.removeprefix("result."), kind)
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
) -> str:
    """Write who runs what, with which versions; returns the run's name."""
    now = time.time()
    run_id = time.strftime("%Y%m%dT%H%M%S", time.gmtime(now)) + "-" + uuid.uuid4().hex[:8]
    _write_record(
        store,
        run_id,
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
            "sweep": source,
        },
    )
    return run_id


def close_record(store: Store, run_id: str, state: str, counts: Mapping[str, int]) -> None:
    """Note how a run ended. A run that was killed stays "running" in its record."""
    file = store.path / "runs" / f"{run_id}.json"
    try:
        entry = json.loads(file.read_text(encoding="utf-8"))
        entry.update(state=state, ended=time.time(), counts=dict(counts))
        _write_record(store, run_id, entry)
    except Exception:  # a full disk: the reason is on its way, and must not be hidden by this one
        if state == "finished":
            raise


def _write_record(store: Store, run_id: str, entry: Mapping[str, Any]) -> None:
    store.write_text(f"runs/{run_id}.json", json.dumps(entry, indent=2) + "\n")
