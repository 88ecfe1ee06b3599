"""The process that runs cases: loads a run function, runs what its host sends, and sends rows back.

It may die at any time, by a case's fault; its host (``supervisor.py``) then knows which case it was
from a few bytes of memory they share. Standard output and error are the host's to read.
"""

from __future__ import annotations

import contextlib
import ctypes
import faulthandler
import mmap
import os
import pickle
import signal
import struct
import sys
import threading
import time
import traceback
from multiprocessing.connection import Connection
from typing import Any

from trajopt.sweeps.cases import Case
from trajopt.sweeps.rows import DONE, ERROR, Row, failed_row, results_of
from trajopt.sweeps.runfunction import RunFunction, unpacked

# Monotonic time at which the case in work started (s), then its index (-1: none). The time comes
# first: the host may read while both change, and an old index with a new time harms nobody.
PROGRESS = struct.Struct("<dq")
_FLUSH_INTERVAL = 0.05  # s between messages to the host: what a crash makes run again; chosen
_PR_SET_PDEATHSIG = 1  # Linux, prctl(2)
_TRACEBACK_LINES = 40  # chosen
_LONGEST_MESSAGE = 2_000  # characters of an error message kept; chosen

# One thread a worker: what BLAS, OpenMP and numba read at import.
THREAD_VARIABLES = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
    "BLIS_NUM_THREADS",
    "NUMEXPR_NUM_THREADS",
    "ARROW_NUM_THREADS",
)


def main(connection_handle: int, progress_handle: int, parent: int, memory_limit: int) -> None:
    """Serve the host at the other end of ``connection_handle`` until it closes."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    end_with_parent(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the host decides when to stop
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    faulthandler.enable()
    if memory_limit:
        import resource

        with contextlib.suppress(ValueError, OSError):  # where the system does not limit it
            resource.setrlimit(resource.RLIMIT_DATA, (memory_limit, memory_limit))
    connection: Connection[Any, Any] = Connection(connection_handle)
    progress = mmap.mmap(progress_handle, PROGRESS.size)
    try:
        run = unpacked(pickle.loads(connection.recv_bytes()))
    except EOFError:
        return
    except BaseException as error:  # whatever the user's module raises
        connection.send(("unloadable", f"{type(error).__name__}: {error}", _traceback(error)))
        return
    connection.send(("ready",))
    while True:
        try:
            cases: list[tuple[int, str, dict[str, Any]]] = pickle.loads(connection.recv_bytes())
        except EOFError:
            return
        rows: list[Row] = []
        sent = time.monotonic()
        for index, identity, values in cases:
            now = time.monotonic()
            if now - sent > _FLUSH_INTERVAL:
                rows, sent = _sent(connection, rows), now
            note_progress(progress, index)
            rows.append(_row(run, index, Case(identity, values)))
        note_progress(progress, -1)
        _sent(connection, rows)
        connection.send(("finished",))


def note_progress(progress: mmap.mmap, index: int) -> None:
    """Say that case ``index`` (-1: none) starts now. One copy: ``pack_into`` would write zeros
    first, which the host could read as a case that has been running since the machine was
    started."""
    progress[:] = PROGRESS.pack(time.monotonic(), index)


def noted_progress(progress: mmap.mmap) -> tuple[int, float]:
    """Index of the case in work (-1: none) and the monotonic time it started at, s."""
    started, index = PROGRESS.unpack(progress[:])
    return index, started


def _row(run: RunFunction, index: int, case: Case) -> Row:
    started, clock = time.time(), time.perf_counter()
    try:
        results, arrays = results_of(run(case), case.values)
    except BaseException as error:  # a case's SystemExit and KeyboardInterrupt are its errors
        seconds = time.perf_counter() - clock
        name = type(error).__name__
        return failed_row(index, ERROR, name, _message(error), _traceback(error), seconds)
    return Row(index, DONE, results, arrays, "", "", "", started, time.perf_counter() - clock)


def _sent(connection: Connection[Any, Any], rows: list[Row]) -> list[Row]:
    if rows:
        connection.send(("rows", [tuple(r) for r in rows]))
    return []


def _message(error: BaseException) -> str:
    try:
        text = str(error)
    except Exception as inner:  # an exception that cannot even say what it is
        text = f"(its text could not be made: {type(inner).__name__})"
    return text if len(text) <= _LONGEST_MESSAGE else text[:_LONGEST_MESSAGE] + "..."


def _traceback(error: BaseException) -> str:
    try:
        lines = traceback.format_exception(type(error), error, error.__traceback__)
    except Exception:
        lines = traceback.format_tb(error.__traceback__)
    return "".join(lines[-_TRACEBACK_LINES:])[-20 * _LONGEST_MESSAGE :]


def end_with_parent(parent: int, grace: float = 0.0) -> None:
    """Make this process end ``grace`` s after its parent has ended, however that ends: seen on
    every system by looking."""

    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(0.5)
        time.sleep(grace)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()
