"""Many paths or many limits timed at once, on all cores."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from trajopt.errors import ArgumentError, TrajoptError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory

_CHUNKS = 4  # a worker, where processes take jobs in chunks; chosen


@dataclass(frozen=True)
class Failed:
    """Job ``index`` has no motion: ``error`` says why, as ``time_scale`` would have raised it."""

    index: int
    error: TrajoptError

    def __str__(self) -> str:
        return f"paths[{self.index}]: {self.error}"


def time_scale_many(
    paths: Path | Sequence[Path],
    limits: Sequence[Limit] | Sequence[Sequence[Limit]],
    *,
    executor: Executor | None = None,
    **options: Any,
) -> tuple[Trajectory | Failed, ...]:
    """``time_scale`` for many paths, many limits, or pairs of both, results in their order.

    ``paths``: one path or N; ``limits``: one list of limits or N lists. One goes with all of the
    other; both N are taken in pairs. ``options`` are those of ``time_scale``, the same for all. Where
    a job fails its result is ``Failed``, with its index and the error; the others go on.

    ``executor``: None for a thread a processor (about half of a call is compiled code that lets
    other threads run), or any ``concurrent.futures.Executor``: with processes all of it runs at once,
    but they must start and results travel. The caller ends an executor that was given.

    Raises ArgumentError where the numbers of paths and limits do not fit, TypeError for options that
    ``time_scale`` has not.
    """
    if executor is not None and not isinstance(executor, Executor):
        raise ArgumentError("executor", executor, "a concurrent.futures.Executor, or None")
    jobs = _jobs(paths, limits)
    run = partial(_timed, options)
    # The first one here: kernels are compiled and tables made once, not by all workers at a time.
    first = [run(job) for job in jobs[:1]]
    if len(jobs) < 2:
        return tuple(first)
    if executor is not None:
        size = max(1, len(jobs) // (_CHUNKS * _workers(executor)))
        return (*first, *executor.map(run, jobs[1:], chunksize=size))
    with ThreadPoolExecutor(min(len(jobs) - 1, _processors())) as threads:
        return (*first, *threads.map(run, jobs[1:]))


_Job = tuple[int, Path, Sequence[Limit]]


def _timed(options: dict[str, Any], job: _Job) -> Trajectory | Failed:
    index, path, limits = job
    try:
        return time_scale(path, limits, **options)
    except TrajoptError as error:
        return Failed(index, error)


def _jobs(
    paths: Path | Sequence[Path], limits: Sequence[Limit] | Sequence[Sequence[Limit]]
) -> list[_Job]:
    """Paths with their limits. Raises ArgumentError."""
    all_paths: list[Any] = [paths] if isinstance(paths, Path) else _listed("paths", paths)
    given = _listed("limits", limits)
    nested = bool(given) and all(isinstance(entry, (list, tuple)) for entry in given)
    all_limits: list[Any] = given if nested else [given]
    counts = (len(all_paths), len(all_limits))
    count = max(counts)
    if min(counts) not in (1, count):
        expected = "one list of limits, or one a path, or one path"
        raise ArgumentError("paths, limits", counts, expected)
    if counts[0] == 1:
        all_paths = all_paths * count
    if counts[1] == 1:
        all_limits = all_limits * count
    return list(zip(range(count), all_paths, all_limits, strict=True))


def _listed(name: str, values: Iterable[Any]) -> list[Any]:
    try:
        found = [] if isinstance(values, (str, bytes)) else list(values)
    except TypeError:
        found = []
    if not found:
        raise ArgumentError(name, values, f"a list of {name}, at least one")
    return found


def _workers(executor: Executor) -> int:
    return int(getattr(executor, "_max_workers", _processors()))


def _processors() -> int:
    """That this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1
