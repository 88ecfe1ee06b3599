"""Runs a chunk of cases in a child process and writes its part of the store.

Every engine calls ``run_chunk``. A case that raises, exits, crashes, hangs, eats memory or prints
without end costs its own row: the child dies, the host goes on with a new one.
"""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection, Pipe, wait
from pathlib import Path
from typing import Any

from trajopt.errors import TrajoptError
from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.child import PROGRESS, THREAD_VARIABLES, note_progress, noted_progress
from trajopt.sweeps.rows import (
    CRASHED,
    TIMEOUT,
    Kind,
    Row,
    array_table,
    failed_row,
    fitted,
    parameter_kind,
    result_kinds,
    row_table,
)
from trajopt.sweeps.runfunction import Packed
from trajopt.sweeps.store import open_store

RETRIES = 3  # further tries after a first death, as the issue of a crash may be outside; chosen
POLL = 0.25  # s between looks at the stop mark and the clock; chosen
_TAIL = 4_000  # bytes of a child's output kept for the row of a crash; chosen
_IDLE_DEATHS = 20  # deaths between cases before giving up; chosen


class RunLoadError(TrajoptError):
    """The run function cannot be loaded where cases run; no case can."""


@dataclass(frozen=True)
class CaseLimits:
    """What one case may use: wall-clock ``seconds`` and ``memory``, bytes of private data (0:
    unlimited)."""

    seconds: float
    memory: int


@dataclass(frozen=True)
class ChunkJob:
    """A chunk of cases for a worker: everything it needs to know. ``stop_mark``: file whose
    presence says stop."""

    store: str
    name: str
    cases: CaseTable
    run: Packed
    limits: CaseLimits
    kinds: Mapping[str, Kind]
    parameter_kinds: Mapping[str, Kind]
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
    rows = fitted(sorted(rows), kinds) if rows else []
    if rows:
        store = open_store(job.store, create=False)
        beside = array_table(rows, job.cases)
        if beside is not None:  # first, so that no row ever lacks its arrays
            store.write_part("arrays", job.name, beside)
        table = row_table(rows, job.cases, job.parameter_kinds, kinds, socket.gethostname())
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
        child = _child_for(job.run, job.limits.memory)
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


class _Child:
    """A child process and the host's ends of its connections. It lives through many chunks."""

    def __init__(self, run: Packed, memory: int) -> None:
        ours, theirs = Pipe()
        self.run, self.memory = run, memory
        self.connection: Connection[Any, Any] = ours
        self.output = b""
        self.shared = tempfile.TemporaryFile()  # noqa: SIM115 - lives as long as the child
        self.shared.truncate(PROGRESS.size)
        self.progress = mmap.mmap(self.shared.fileno(), PROGRESS.size)
        note_progress(self.progress, -1)
        handles = (theirs.fileno(), self.shared.fileno())
        program = (
            f"import sys; sys.path[:] = {list(run.path)!r}; from trajopt.sweeps.child import main; "
            f"main({handles[0]}, {handles[1]}, {os.getpid()}, {memory})"
        )
        self.process = subprocess.Popen(
            [sys.executable, "-c", program],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            pass_fds=handles,
            bufsize=0,
            env={**os.environ, **dict.fromkeys(THREAD_VARIABLES, "1")},
        )
        theirs.close()
        self.ready = False
        with contextlib.suppress(
            OSError
        ):  # a child that is already dead is found when it is waited for
            ours.send_bytes(pickle.dumps(run))

    def work(
        self,
        cases: list[tuple[int, str, dict[str, Any]]],
        rows: dict[int, Row],
        limit: float,
        should_stop: Callable[[], bool],
    ) -> Row | None:
        """Run cases, adding to ``rows``; the child's death as the row of the case it was at (place
        -1: none), or None when finished or told to stop."""
        try:
            if not self.ready:
                if not self._until("ready", rows, limit, should_stop):
                    self.close()
                    return None
                self.ready = True
            self.connection.send_bytes(pickle.dumps(cases))
            if not self._until("finished", rows, limit, should_stop):
                self.close()
            return None
        except (EOFError, OSError):
            return self._death()
        except _Overdue as error:
            index, started = noted_progress(self.progress)
            self.close()
            seconds = time.monotonic() - started
            return failed_row(index, TIMEOUT, "TimeLimit", str(error), self._text(), seconds)

    def _until(
        self, what: str, rows: dict[int, Row], limit: float, should_stop: Callable[[], bool]
    ) -> bool:
        """Read messages until one says ``what``; False when told to stop before."""
        assert self.process.stdout is not None
        sources: list[Any] = [self.connection, self.process.stdout]
        while True:
            for source in wait(sources, POLL):
                if source is self.connection:
                    message = self.connection.recv()
                    if message[0] == "rows":
                        rows.update((r[0], Row(*r)) for r in message[1])
                    elif message[0] == "unloadable":
                        raise RunLoadError(
                            f"the run function cannot be loaded: {message[1]}\n{message[2]}"
                        )
                    elif message[0] == what:
                        return True
                else:
                    data = os.read(self.process.stdout.fileno(), 1 << 16)
                    self.output = (self.output + data)[-_TAIL:]
                    if not data:
                        sources.remove(source)
            index, started = noted_progress(self.progress)
            if index >= 0 and time.monotonic() - started > limit:
                raise _Overdue(f"longer than the limit of {limit:g} s")
            if should_stop():
                return False

    def _death(self) -> Row:
        index, started = noted_progress(self.progress)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(2.0)
        code = self.process.poll()
        if self.process.stdout is not None:
            os.set_blocking(self.process.stdout.fileno(), False)
            with contextlib.suppress(OSError):
                while data := os.read(self.process.stdout.fileno(), 1 << 16):
                    self.output = (self.output + data)[-_TAIL:]
        self.close()
        seconds = max(0.0, time.monotonic() - started) if index >= 0 else 0.0
        return failed_row(index, CRASHED, "WorkerDied", _why(code), self._text(), seconds)

    def _text(self) -> str:
        return self.output.decode(errors="replace")

    def close(self) -> None:
        """End the child now."""
        self.process.kill()
        self.process.wait()
        if self.process.stdout is not None:
            self.process.stdout.close()
        self.connection.close()
        with contextlib.suppress(BufferError):
            self.progress.close()
        self.shared.close()

    @property
    def alive(self) -> bool:
        return not self.connection.closed and self.process.poll() is None


class _Overdue(Exception):
    """A case is over its time limit."""


_thread = threading.local()  # the child of this thread: starting one costs 0.2 s and its imports


def warm_up(run: Packed, memory: int) -> None:
    """Start this thread's child, so that all workers start theirs at the same time, before any case
    waits.

    Raises RunLoadError. A child that dies here is no matter: the first chunk starts another.
    """
    import pyarrow.parquet  # noqa: F401 - the first part would pay for it

    _child_for(run, memory).work([], {}, math.inf, lambda: False)


def _child_for(run: Packed, memory: int) -> _Child:
    """The living child of this thread for this run function, a new one where there is none."""
    child: _Child | None = getattr(_thread, "child", None)
    if child is not None and child.alive and child.run == run and child.memory == memory:
        return child
    if child is not None and not child.connection.closed:
        child.close()
    child = _thread.child = _Child(run, memory)
    return child


def end_child() -> None:
    """End this thread's child, if it has one."""
    child: _Child | None = getattr(_thread, "child", None)
    if child is not None and not child.connection.closed:
        child.close()


def default_memory() -> int:
    """Bytes a case may use: nine tenths of the machine's memory, shared by its processors;
    chosen."""
    total = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    return int(0.9 * total / (os.cpu_count() or 1))


def stop_mark(store: Path, run_id: str) -> Path:
    """File whose presence tells the workers of a run to stop."""
    return store / "runs" / f"{run_id}.stop"


def _why(code: int | None) -> str:
    if code is None:
        return "the process closed its connection"
    if code >= 0:
        return f"the process exited with code {code}"
    with contextlib.suppress(ValueError):
        return f"the process was killed by signal {-code} ({signal.Signals(-code).name})"
    return f"the process was killed by signal {-code}"
