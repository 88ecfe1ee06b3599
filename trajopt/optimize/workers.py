"""Slow objectives on several workers: processes, any executor, or a Dask cluster.

Candidates go out one by one, about as many at a time as there are workers, so that a search stops
within one evaluation. Answers count in the order of the candidates, whichever comes first: the bits
are those of a search without workers.
"""

from __future__ import annotations

import concurrent.futures as futures
import multiprocessing
import os
import signal
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import Evaluation, Objective

_objective: Objective | None = None  # in a worker process: what it evaluates


@dataclass
class Pool:
    """``count`` candidates at a time go to ``executor``; ``own`` where it is ours to shut down."""

    executor: Any
    count: int
    own: bool

    @classmethod
    def of(cls, workers: Any, objective: Objective) -> Pool | None:
        """From a number of processes, an executor (``concurrent.futures``) or a Dask client; None
        for one worker. Raises ArgumentError for anything else."""
        if workers is None or (workers == 1 and not isinstance(workers, bool)):
            return None
        if isinstance(workers, (int, np.integer)) and not isinstance(workers, bool):
            count = (os.cpu_count() or 1) if workers == -1 else int(workers)
            if count >= 1:
                return cls(_processes(count, objective), count, own=True)
        elif hasattr(workers, "get_executor"):  # a Dask client
            # One candidate more than there are threads waits at each, or the way there costs time.
            threads = sum(workers.nthreads().values())
            return cls(workers.get_executor(pure=False), max(2 * threads, 1), own=False)
        elif hasattr(workers, "submit"):
            count = int(getattr(workers, "_max_workers", 0) or os.cpu_count() or 1)
            return cls(workers, count, own=False)
        expected = "a number of processes >= 1 (-1: all cores), an executor or a Dask client"
        raise ArgumentError("workers", workers, expected)

    def answers(
        self, objective: Objective, rows: Array, late: Callable[[], bool]
    ) -> Iterator[tuple[int, Evaluation | BaseException]]:
        """Index of each of the candidates (n, d) and what came back or was raised, in their order.

        Those that have not begun when it is ``late`` are left out. Ctrl-C is raised after the
        answers that were there.
        """
        answers: dict[int, Evaluation | BaseException] = {}
        running: dict[Any, int] = {}
        sent = given = 0
        stop: KeyboardInterrupt | None = None
        try:
            while sent < len(rows) or running:
                try:
                    while sent < len(rows) and len(running) < self.count:
                        if sent and late():
                            rows = rows[:sent]
                            for one in [one for one in running if one.cancel()]:
                                del running[one]
                            break
                        running[self._submit(objective, rows[sent : sent + 1])] = sent
                        sent += 1
                    if not running:
                        break
                    for one in futures.wait(running, None, futures.FIRST_COMPLETED).done:
                        answers[running.pop(one)] = one.exception() or one.result()
                except KeyboardInterrupt as interrupt:
                    stop = interrupt
                    break
                while given in answers:
                    if isinstance(answers[given], futures.BrokenExecutor):
                        raise answers[given]  # type: ignore[misc]  # an exception, as just seen
                    yield given, answers.pop(given)
                    given += 1
            yield from sorted(answers.items())
            if stop is not None:
                raise stop
        finally:
            for one in running:
                one.cancel()

    def _submit(self, objective: Objective, row: Array) -> Any:
        return self.executor.submit(_evaluate, None if self.own else objective, row)

    def close(self) -> None:
        """Send own processes away, whatever they are doing."""
        if self.own:
            for process in list((getattr(self.executor, "_processes", None) or {}).values()):
                process.terminate()
            self.executor.shutdown(wait=False, cancel_futures=True)


def _processes(count: int, objective: Objective) -> futures.ProcessPoolExecutor:
    # Forked processes inherit the objective, which then need not be one that pickles.
    context = multiprocessing.get_context("fork" if sys.platform == "linux" else "spawn")
    executor = futures.ProcessPoolExecutor(count, context, _begin, (objective,))
    for begun in [executor.submit(int) for _ in range(count)]:  # before the clock is looked at
        begun.result()
    return executor


def _begin(objective: Objective) -> None:
    global _objective
    from trajopt.optimize.process import one_thread

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the main process decides when to stop
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    one_thread().__enter__()
    _objective = objective


def _evaluate(objective: Objective | None, row: Array) -> Evaluation:
    asked = objective or _objective
    assert asked is not None
    return asked.evaluate(row)
