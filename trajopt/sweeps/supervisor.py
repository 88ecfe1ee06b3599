"""Starts the process that runs cases (``child.py``), watches it, and says how it died."""

from __future__ import annotations

import contextlib
import math
import mmap
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from multiprocessing.connection import Connection, Pipe, wait
from typing import Any

from trajopt.errors import TrajoptError
from trajopt.sweeps.child import PROGRESS, THREAD_VARIABLES, note_progress, noted_progress
from trajopt.sweeps.rows import CRASHED, TIMEOUT, Row, failed_row
from trajopt.sweeps.runfunction import Packed

POLL = 0.25  # s between looks at the stop mark and the clock; chosen
_TAIL = 4_000  # bytes of a child's output kept for the row of a crash; chosen


class RunLoadError(TrajoptError):
    """The run function cannot be loaded where cases run; no case can."""


class Child:
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
        with contextlib.suppress(OSError):  # one that is already dead is found when waited for
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

    child_for(run, memory).work([], {}, math.inf, lambda: False)


def child_for(run: Packed, memory: int) -> Child:
    """The living child of this thread for this run function, a new one where there is none."""
    child: Child | None = getattr(_thread, "child", None)
    if child is not None and child.alive and child.run == run and child.memory == memory:
        return child
    if child is not None and not child.connection.closed:
        child.close()
    child = _thread.child = Child(run, memory)
    return child


def end_child() -> None:
    """End this thread's child, if it has one."""
    child: Child | None = getattr(_thread, "child", None)
    if child is not None and not child.connection.closed:
        child.close()


def _why(code: int | None) -> str:
    if code is None:
        return "the process closed its connection"
    if code >= 0:
        return f"the process exited with code {code}"
    with contextlib.suppress(ValueError):
        return f"the process was killed by signal {-code} ({signal.Signals(-code).name})"
    return f"the process was killed by signal {-code}"
