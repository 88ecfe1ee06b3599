"""Drives chunks through an executor: sizes them by measured time, and survives workers that die.

A chunk whose worker died is tried again; after three more deaths it runs alone, and from then on
halves that die are halved again, until the one case whose worker always dies is found and recorded.
"""

from __future__ import annotations

import contextlib
import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import IntArray
from trajopt.errors import TrajoptError
from trajopt.sweeps.cases import SAMPLED, CaseTable, spread
from trajopt.sweeps.executors import Engine, end, is_death, started
from trajopt.sweeps.host import (
    RETRIES,
    CaseLimits,
    ChunkJob,
    ChunkReport,
    run_chunk,
    stop_mark,
)
from trajopt.sweeps.rows import CRASHED, Kind, Origin, failed_row, row_table
from trajopt.sweeps.runfunction import Packed
from trajopt.sweeps.store import Store
from trajopt.sweeps.supervisor import warm_up

# s of work; chosen: a part costs some 10 ms, a crash costs a chunk
SHORTEST_CHUNK, LONGEST_CHUNK = 0.25, 5.0
_SHARE = 4  # a chunk is a quarter of what is left for its worker: large first; chosen
MOST_CASES = 10_000  # cases of one chunk, whatever their time; chosen
_AHEAD = 2  # chunks in flight a worker, so that none waits for the submitter; chosen
_STOP_GRACE = 20.0  # s that workers get to store what they have after a stop; chosen
_MOST_REBUILDS = 1_000  # of executors, before something else must be wrong; chosen


@dataclass(frozen=True)
class Setup:
    """What all chunks of a run share."""

    store: Store
    run_id: str
    run: Packed
    limits: CaseLimits
    parameter_kinds: Mapping[str, Kind]
    code: str

    def job(self, cases: CaseTable, kinds: Mapping[str, Kind], store: str) -> ChunkJob:
        """A chunk of cases for a worker that sees the store at ``store``."""
        return ChunkJob(
            store,
            cases.name,
            cases,
            self.run,
            self.limits,
            kinds,
            self.parameter_kinds,
            self.run_id,
            self.code,
        )


@dataclass(frozen=True)
class Progress:
    """State of a run: cases ``done`` by status in this run, ``total`` to do, ``seconds`` since the
    start."""

    counts: Mapping[str, int]
    total: int
    seconds: float

    @property
    def finished(self) -> int:
        return sum(self.counts.values())

    @property
    def remaining_seconds(self) -> float | None:
        """Estimate from the rate so far; None before the first case."""
        return (
            (self.total - self.finished) * self.seconds / self.finished if self.finished else None
        )


@dataclass
class _Chunk:
    places: IntArray
    deaths: int = 0


@dataclass
class Drive:
    """One run over the cases of ``table`` at ``places``. Mutable by nature; lives for one run."""

    table: CaseTable
    places: IntArray
    setup: Setup
    engine: Engine
    report: Callable[[Progress], None]
    kinds: dict[str, Kind] = field(default_factory=dict)
    counts: Counter[str] = field(default_factory=Counter)
    retried: deque[_Chunk] = field(default_factory=deque)
    suspects: deque[_Chunk] = field(default_factory=deque)
    seconds_a_case: float | None = None
    next: int = 0
    stopping: bool = False

    def go(self) -> None:
        """Run everything. Raises KeyboardInterrupt after a clean stop, StoreError, RunLoadError."""
        self.started = time.monotonic()
        self._sample_first()
        mark = stop_mark(self.setup.store.path, self.setup.run_id)
        flights: dict[Future[ChunkReport], _Chunk] = {}
        rebuilds = 0
        context, executor = self._started()
        try:
            while flights or self._waiting():
                try:
                    self._submit(executor, flights)
                    done, _ = wait(flights, timeout=1.0, return_when=FIRST_COMPLETED)
                    broken = self._collect({f: flights.pop(f) for f in done})
                except BrokenExecutor:
                    broken = True
                if broken:
                    rebuilds += 1
                    self._blame(flights)
                    context, executor = self._rebuilt(context, rebuilds)
        except BaseException:  # Ctrl-C, a full disk: workers keep what they have, then pass it on
            self._stop(flights, mark)
            raise
        finally:
            end(context)
            mark.unlink(missing_ok=True)

    # -- chunks

    def _sample_first(self) -> None:
        """Bring a first, a middle and a last case to the front."""
        front = spread(len(self.places))
        self.places = np.concatenate([self.places[front], np.delete(self.places, front)])

    def _waiting(self) -> bool:
        return bool(self.retried or self.suspects or self.next < len(self.places))

    def _size(self) -> int:
        left = len(self.places) - self.next
        if self.seconds_a_case is None:
            return SAMPLED
        time_left = left * self.seconds_a_case / self.engine.workers
        target = min(max(time_left / _SHARE, SHORTEST_CHUNK), LONGEST_CHUNK)
        return int(min(max(target / max(self.seconds_a_case, 1e-9), 1), MOST_CASES, left))

    def _take(self) -> _Chunk | None:
        if self.retried:
            return self.retried.popleft()
        if self.next >= len(self.places):
            return None
        size = self._size()
        chunk = _Chunk(self.places[self.next : self.next + size])
        self.next += size
        return chunk

    def _submit(self, executor: Executor, flights: dict[Future[ChunkReport], _Chunk]) -> None:
        alone = any(c.deaths > RETRIES for c in flights.values())
        while not alone and len(flights) < self.engine.workers * _AHEAD:
            if self.seconds_a_case is None and flights:
                return  # the sampled cases run first
            chunk = self._take()
            if chunk is None:
                if flights or not self.suspects:
                    return
                chunk, alone = self.suspects.popleft(), True
            try:
                flights[executor.submit(run_chunk, self._job(chunk))] = chunk
            except BaseException:
                self.retried.appendleft(chunk)
                raise

    def _job(self, chunk: _Chunk) -> ChunkJob:
        setup = self.setup
        mark = stop_mark(setup.store.path, setup.run_id)
        job = setup.job(self.table.take(chunk.places), dict(self.kinds), str(setup.store.path))
        return replace(job, stop_mark=str(mark))

    # -- outcomes

    def _collect(self, done: dict[Future[ChunkReport], _Chunk]) -> bool:
        """Take in finished chunks; True when the executor broke."""
        broken = False
        for future, chunk in done.items():
            try:
                outcome = future.result()
            except BrokenExecutor:
                broken = True
                self._died(chunk)
            except TrajoptError:
                raise
            except Exception as error:  # Dask's KilledWorker and its like: the worker is gone
                if not is_death(error):
                    raise
                self._died(chunk)
            else:
                self._learn(outcome, chunk)
        return broken

    def _learn(self, outcome: ChunkReport, chunk: _Chunk) -> None:
        self.counts.update(outcome.counts)
        for name, kind in outcome.kinds.items():
            if self.kinds.setdefault(name, kind) != kind:
                self.kinds[name] = "text"
        finished = sum(outcome.counts.values())
        if outcome.unfinished and not self.stopping:  # stopped from outside: the rest runs again
            self.next_missing(chunk)
        if finished:
            if self.seconds_a_case is None:
                self.seconds_a_case = outcome.median_seconds
            else:
                self.seconds_a_case = 0.5 * (self.seconds_a_case + outcome.seconds / finished)
        self.report(Progress(dict(self.counts), len(self.places), time.monotonic() - self.started))

    def next_missing(self, chunk: _Chunk) -> None:
        """Queue those cases of a chunk that have no row yet."""
        known = self.setup.store.finished(where=("run_id", self.setup.run_id))
        left = chunk.places[~np.isin(self.table.ids[chunk.places], known)]
        if len(left):
            self.retried.append(_Chunk(left))

    def _died(self, chunk: _Chunk) -> None:
        """The worker of a chunk died: try again, then alone, then in halves, then record the one
        case."""
        chunk.deaths += 1
        if chunk.deaths <= RETRIES:
            self.retried.append(chunk)
        elif chunk.deaths == RETRIES + 1:
            self.suspects.append(chunk)
        elif len(chunk.places) > 1:
            middle = len(chunk.places) // 2
            # Already suspected: each half runs alone once, and is halved again if its worker dies.
            self.suspects.extend(
                _Chunk(half, RETRIES + 1) for half in (chunk.places[:middle], chunk.places[middle:])
            )
        elif chunk.deaths <= 2 * RETRIES + 1:
            self.suspects.append(chunk)
        else:
            self._record_guilty(chunk)

    def _record_guilty(self, chunk: _Chunk) -> None:
        cases = self.table.take(chunk.places)
        told = f"its worker died {chunk.deaths} times while running this case"
        row = failed_row(0, CRASHED, "WorkerDied", told, "", 0.0)._replace(attempts=chunk.deaths)
        origin = Origin(self.setup.run_id, self.setup.code, "submitter")
        table = row_table([row], cases, self.setup.parameter_kinds, self.kinds, origin)
        self.setup.store.write_part("parts", cases.name, table)
        self.counts[CRASHED] += 1
        if self.seconds_a_case is None:
            self.seconds_a_case = SHORTEST_CHUNK

    def _blame(self, flights: dict[Future[ChunkReport], _Chunk]) -> None:
        """After a break: results that are there count, all other chunks in flight are under
        suspicion."""
        wait(flights, timeout=5.0)
        self._collect({f: c for f, c in flights.items() if f.done()})
        for future, chunk in flights.items():
            if not future.done():
                self._died(chunk)
        flights.clear()

    def _started(self) -> tuple[AbstractContextManager[Executor], Executor]:
        return started(self.engine, warm_up, self.setup.run, self.setup.limits.memory)

    def _rebuilt(
        self, context: AbstractContextManager[Executor], rebuilds: int
    ) -> tuple[AbstractContextManager[Executor], Executor]:
        end(context)
        if not self.engine.rebuilds or rebuilds > _MOST_REBUILDS:
            raise BrokenExecutor(
                f"the executor ({self.engine.name}) broke and cannot be made anew; finished cases "
                "are kept: run the sweep again, or give a factory instead of an executor"
            )
        if self.seconds_a_case is None and rebuilds > RETRIES:
            # The sampled cases kill their worker: go on with small chunks.
            self.seconds_a_case = SHORTEST_CHUNK
        return self._started()

    def _stop(self, flights: dict[Future[ChunkReport], Any], mark: Path) -> None:
        self.stopping = True
        with contextlib.suppress(OSError):
            mark.touch()
        for future in flights:
            future.cancel()
        with contextlib.suppress(KeyboardInterrupt):
            done, _ = wait([f for f in flights if not f.cancelled()], timeout=_STOP_GRACE)
            for future in done:
                with contextlib.suppress(Exception):
                    self._learn(future.result(timeout=0), flights[future])
