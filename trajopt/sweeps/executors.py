"""Where chunks run: existing executors only, each behind ``Engine``.

One machine: ``concurrent.futures.ProcessPoolExecutor`` with spawned processes. Many: Dask
distributed, through ``Client.get_executor`` (a local cluster, a scheduler's address, or Slurm by
dask-jobqueue). Anything else that is a ``concurrent.futures.Executor`` works too. Servers listen on
loopback unless another address is given.
"""

from __future__ import annotations

import contextlib
import os
import signal
from asyncio import CancelledError
from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, ProcessPoolExecutor, wait
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from multiprocessing import get_context, resource_tracker
from typing import Any

from trajopt.errors import ArgumentError, TrajoptError
from trajopt.sweeps.child import THREAD_VARIABLES, end_with_parent

_POOL_STARTS = 6  # in a row that may fail before an engine counts as broken; chosen
_GRACE = 5.0  # s an orphaned worker gets to store what it has; chosen


class WorkerStartError(TrajoptError):
    """Worker processes cannot start."""


@dataclass(frozen=True)
class Engine:
    """``start`` gives an executor for as long as its context lasts; ``workers`` is how many cases
    run at once.

    ``rebuilds``: whether ``start`` may be called again after the executor broke. ``starts``: how
    many in a row may fail before the engine counts as broken.
    """

    name: str
    start: Callable[[], AbstractContextManager[Executor]]
    workers: int
    rebuilds: bool = True
    starts: int = _POOL_STARTS


def engine_of(executor: Engine | Executor | Callable[[], Executor] | int | None) -> Engine:
    """Engine for what a caller gave: None (all processors), a number of processes, an executor or a
    factory."""
    if isinstance(executor, Engine):
        return executor
    if executor is None:
        return processes(available_processors())
    if isinstance(executor, int) and not isinstance(executor, bool):
        return processes(executor)
    if isinstance(executor, Executor):
        given = executor
        return Engine(
            type(given).__name__,
            lambda: contextlib.nullcontext(given),
            _width(given),
            rebuilds=False,
        )
    if callable(executor):
        factory = executor
        return Engine(
            getattr(factory, "__name__", "executor"),
            lambda: _closing(factory()),
            available_processors(),
        )
    raise ArgumentError(
        "executor", executor, "None, a number of processes, an Executor, a factory or an Engine"
    )


def processes(workers: int) -> Engine:
    """Engine of ``workers`` spawned processes on this machine."""
    if workers < 1:
        raise ArgumentError("workers", workers, "a whole number >= 1")

    def start() -> AbstractContextManager[Executor]:
        return _closing(
            ProcessPoolExecutor(
                workers,
                mp_context=get_context("spawn"),
                initializer=prepare_worker,
                initargs=(os.getpid(),),
            )
        )

    return Engine(f"{workers} processes", start, workers)


def available_processors() -> int:
    """Processors this process may use: fewer than the machine has under Slurm or taskset."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def prepare_worker(parent: int) -> None:
    """Make a spawned process a quiet worker: it leaves Ctrl-C to its parent and does not outlive
    it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in THREAD_VARIABLES:
        os.environ[name] = "1"
    # The chunk in work sees it too, stops, and stores what is finished.
    end_with_parent(parent, _GRACE)


def started(
    engine: Engine, task: Callable[..., object], *arguments: Any
) -> tuple[AbstractContextManager[Executor], Executor]:
    """A working executor and its context, entered: one of its workers has done ``task``, all got
    it. Workers that cannot even start are no case's fault: raises WorkerStartError."""
    fault: BaseException | None = None
    for _ in range(engine.starts):
        context = engine.start()
        try:
            with _uninterrupted():
                executor = context.__enter__()
        except TrajoptError:
            raise
        except (Exception, CancelledError) as error:  # a cluster that lost processes meanwhile
            fault = error
            continue
        try:
            with _uninterrupted():
                tasks = [executor.submit(task, *arguments) for _ in range(engine.workers)]
            done, _ = wait(tasks, return_when=FIRST_COMPLETED)
            for first in done:
                first.result()
            return context, executor
        except BaseException as error:
            end(context)
            if not isinstance(error, BrokenExecutor) and not is_death(error):
                raise
    raise WorkerStartError(
        f"{engine.name}: workers died at {engine.starts} starts in a row, before any "
        "case; finished cases are kept; a script that runs a sweep needs "
        '`if __name__ == "__main__":` around what it does'
    ) from fault


@contextmanager
def _uninterrupted() -> Iterator[None]:
    """Hold Ctrl-C back: processes and threads that start meanwhile, and all of theirs, never see
    it, so that it is this process alone that leaves, and tells it."""
    resource_tracker.ensure_running()  # its start would let Ctrl-C through again
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def end(context: AbstractContextManager[Executor]) -> None:
    """Leave an executor, also one that lost processes: all that counts is stored."""
    with contextlib.suppress(Exception):
        context.__exit__(None, None, None)


def is_death(error: BaseException) -> bool:
    """Whether an error of a future says that the worker is gone (Dask; its classes are not imported
    here)."""
    gone = ("KilledWorker", "CancelledError", "FutureCancelledError", "CommClosedError")
    return type(error).__name__ in gone


@contextmanager
def _closing(executor: Executor) -> Iterator[Executor]:
    try:
        yield executor
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _width(executor: Executor) -> int:
    """How many tasks an executor runs at once, where it says so; the processors of this machine
    otherwise."""
    for name in ("_max_workers", "max_workers"):
        found = getattr(executor, name, None)
        if isinstance(found, int) and found > 0:
            return found
    client: Any = getattr(executor, "_client", None)  # Dask's
    return available_processors() if client is None else max(1, sum(client.nthreads().values()))
