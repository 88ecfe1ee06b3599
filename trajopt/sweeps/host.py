"""Runs a chunk of cases in a child process and writes its part of the store.

Every engine calls ``run_chunk``. A case that raises, exits, crashes, hangs, eats memory or prints
without end costs its own row: the child dies, the host goes on with a new one.
"""

from __future__ import annotations

import os
import socket
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.rows import (
    CRASHED,
    TIMEOUT,
    Kind,
    Origin,
    Row,
    array_table,
    parameter_kind,
    result_kinds,
    row_table,
)
from trajopt.sweeps.runfunction import Packed
from trajopt.sweeps.store import open_store
from trajopt.sweeps.supervisor import POLL, RunLoadError, child_for

RETRIES = 3  # further tries after a first death, as the issue of a crash may be outside; chosen
_IDLE_DEATHS = 20  # deaths between cases before giving up; chosen


@dataclass(frozen=True)
class CaseLimits:
    """What one case may use: wall-clock ``seconds`` and ``memory``, bytes of private data (0:
    unlimited)."""

    seconds: float
    memory: int


@dataclass(frozen=True)
class ChunkJob:
    """A chunk of cases for a worker: everything it needs to know. ``code``: checksum of what runs
    them; ``stop_mark``: file whose presence says stop."""

    store: str
    name: str
    cases: CaseTable
    run: Packed
    limits: CaseLimits
    kinds: Mapping[str, Kind]
    parameter_kinds: Mapping[str, Kind]
    run_id: str
    code: str
    stop_mark: str | None = None


@dataclass(frozen=True)
class ChunkReport:
    """What became of a chunk: cases by status, how many were left, median and total case time,
    s."""

    counts: Mapping[str, int]
    unfinished: int
    median_seconds: float
    seconds: float
    kinds: Mapping[str, Kind]


def run_chunk(job: ChunkJob, should_stop: Callable[[], bool] | None = None) -> ChunkReport:
    """Run the cases of a chunk and store their rows; stops early, keeping what is finished, when
    told to.

    Raises StoreError when the store cannot be written, RunLoadError when the run function cannot be
    loaded.
    """
    clock = time.perf_counter()
    rows = _rows_of(job, should_stop or _StopMark(job.stop_mark))
    kinds = result_kinds(rows, job.kinds)
    if rows:
        rows.sort()
        store = open_store(job.store, create=False)
        beside = array_table(rows, job.cases)
        if beside is not None:  # first, so that no row ever lacks its arrays
            store.write_part("arrays", job.name, beside)
        origin = Origin(job.run_id, job.code, socket.gethostname())
        table = row_table(rows, job.cases, job.parameter_kinds, kinds, origin)
        store.write_part("parts", job.name, table)
    times = sorted(r.seconds for r in rows)
    return ChunkReport(
        Counter(r.status for r in rows),
        len(job.cases) - len(rows),
        times[len(times) // 2] if times else 0.0,
        time.perf_counter() - clock,
        kinds,
    )


def parameter_kinds(cases: CaseTable) -> dict[str, Kind]:
    """Kinds of the columns that hold case values; over all cases, so that all parts agree."""
    return {name: parameter_kind(column) for name, column in cases.columns.items()}


@dataclass
class _StopMark:
    """Whether to stop: the mark exists, or the process that started this one is gone. Looks a few
    times a second."""

    mark: str | None
    parent: int = field(default_factory=os.getppid)
    looked: float = 0.0
    stop: bool = False

    def __call__(self) -> bool:
        now = time.monotonic()
        if not self.stop and now - self.looked > POLL:
            self.looked = now
            self.stop = (
                self.mark is not None and os.path.exists(self.mark)
            ) or os.getppid() != self.parent
        return self.stop


def _rows_of(job: ChunkJob, should_stop: Callable[[], bool]) -> list[Row]:
    cases = job.cases.rows()
    rows: dict[int, Row] = {}
    deaths: Counter[int] = Counter()
    todo = list(range(len(cases)))
    while todo and not should_stop():
        child = child_for(job.run, job.limits.memory)
        death = child.work(
            [(i, cases[i].id, dict(cases[i].values)) for i in todo],
            rows,
            job.limits.seconds,
            should_stop,
        )
        todo = [i for i in todo if i not in rows]
        if death is None:
            continue
        deaths[death.place] += 1
        if death.place in rows or death.place < 0:  # between cases: nobody's fault
            if deaths[death.place] > _IDLE_DEATHS:
                raise RunLoadError(
                    f"worker processes keep dying between cases: {death.message}\n{death.traceback}"
                )
        elif death.status == TIMEOUT or deaths[death.place] > RETRIES:
            rows[death.place] = death
            todo.remove(death.place)
    return [
        row._replace(attempts=deaths[i] + (row.status not in (CRASHED, TIMEOUT)))
        for i, row in rows.items()
    ]


def default_memory() -> int:
    """Bytes a case may use: nine tenths of the machine's memory, shared by its processors;
    chosen."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return int(0.9 * total / (os.cpu_count() or 1))


def stop_mark(store: Path, run_id: str) -> Path:
    """File whose presence tells the workers of a run to stop."""
    return store / "runs" / f"{run_id}.stop"
