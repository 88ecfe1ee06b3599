"""Sweeps as a whole: equal tables everywhere, bad run functions, stops, and workers that die."""

from __future__ import annotations

import asyncio
import mmap
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.sweeps.crashes import ROOT, cases, digest, torment
from tests.sweeps.run_functions import cheap, mixed, noop, paced, poisoned
from tests.sweeps.same_table import swept
from trajopt.errors import ArgumentError
from trajopt.provenance import commit, versions
from trajopt.sweeps.cases import Case
from trajopt.sweeps.child import PROGRESS, note_progress, noted_progress
from trajopt.sweeps.dask_engines import dask_local
from trajopt.sweeps.drive import Progress
from trajopt.sweeps.executors import Engine, WorkerStartError
from trajopt.sweeps.store import StoreError, open_store
from trajopt.sweeps.supervisor import RunLoadError
from trajopt.sweeps.sweeps import sweep

KINDS = (
    "raise",
    "exit",
    "hard exit",
    "segfault",
    "hang",
    "spin",
    "deaf",
    "memory",
    "print",
    "unserialisable",
    "lambda",
    "kind",
)
EXPECTED = {
    "raise": ("error", "RuntimeError"),
    "exit": ("error", "SystemExit"),
    "hard exit": ("crashed", "WorkerDied"),
    "segfault": ("crashed", "WorkerDied"),
    "hang": ("timeout", "TimeLimit"),
    "spin": ("timeout", "TimeLimit"),
    "deaf": ("timeout", "TimeLimit"),
    "memory": ("error", "MemoryError"),
    "print": ("done", None),
    "unserialisable": ("error", "ArgumentError"),
    "lambda": ("error", "ArgumentError"),
    "kind": ("done", None),
}


def test_the_same_table_whatever_the_workers(tmp_path: Path) -> None:
    one = sweep(cases(300), mixed, executor=1, store=tmp_path / "one")
    two = sweep(list(reversed(cases(300))), mixed, executor=2, store=tmp_path / "two")
    assert one.counts() == {"done": 296, "error": 4}
    assert digest(one) == digest(two)
    with ThreadPoolExecutor(2) as threads:
        assert digest(
            sweep(cases(300), mixed, executor=threads, store=tmp_path / "threads")
        ) == digest(one)


@pytest.mark.slow
def test_the_same_table_on_dask(tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="Dask distributed is not installed")
    stores = [swept(engine, 2000, tmp_path) for engine in ("one", "two", "dask")]
    assert len({digest(store) for store in stores}) == 1
    assert all(len(store.parts()) > 5 for store in stores)


@pytest.mark.slow
def test_dask_listens_on_loopback_only() -> None:
    pytest.importorskip("distributed", reason="Dask distributed is not installed")
    psutil = pytest.importorskip("psutil")
    with dask_local(1).start() as executor:
        executor.submit(abs, -1).result()
        me = psutil.Process()
        found = {
            connection.laddr.ip
            for process in (me, *me.children(recursive=True))
            for connection in process.net_connections(kind="inet")
            if connection.status == psutil.CONN_LISTEN
        }
    assert found == {"127.0.0.1"}


@pytest.mark.slow
def test_bad_cases_cost_their_own_row(tmp_path: Path) -> None:
    many: list[dict[str, Any]] = [{"x": i, "kind": ""} for i in range(60)]
    many += [{"x": 100 + i, "kind": kind} for i, kind in enumerate(KINDS)]
    store = sweep(
        many,
        poisoned,
        executor=2,
        store=tmp_path / "store",
        time_limit=1.0,
        memory_limit=4_000_000_000,
    )
    frame = store.frame()
    good = frame[frame["kind"] == ""]
    assert (good["status"] == "done").all()
    assert (good["square"].astype(float) == good["x"] ** 2.0).all()
    assert "text where numbers are" in set(frame["square"])
    found = frame.set_index("kind").loc[list(KINDS)]
    told = {
        kind: (row["status"], row["error"] if isinstance(row["error"], str) else None)
        for kind, row in found.iterrows()
    }
    assert told == EXPECTED
    assert "string_at" in found.loc["segfault", "error_traceback"]
    assert "on purpose" in found.loc["raise", "error_traceback"]
    assert len(frame) == len(many)


@pytest.mark.slow
def test_a_case_that_kills_its_worker_is_found(tmp_path: Path) -> None:
    many = [{"x": i, "kind": "kill worker" if i == 23 else ""} for i in range(60)]
    store = sweep(many, poisoned, executor=2, store=tmp_path / "store")
    frame = store.frame()
    assert store.counts() == {"crashed": 1, "done": 59}
    assert frame[frame["status"] == "crashed"]["x"].tolist() == [23]


def test_rerunning_does_only_what_is_missing(tmp_path: Path) -> None:
    store = sweep(cases(20), cheap, executor=1, store=tmp_path / "store")
    parts = store.parts()
    sweep(cases(20), cheap, executor=1, store=store)
    assert store.parts() == parts
    seen: list[Progress] = []
    sweep(cases(25), cheap, executor=1, store=store, progress=seen.append)
    assert seen[-1].total == seen[-1].finished == 5
    assert len(store.frame()) == 25
    assert [r["state"] for r in store.runs()] == ["finished"] * 3
    record = store.runs()[-1]
    assert (record["versions"], record["commit"]) == (versions(), commit())
    assert record["function"] == "tests.sweeps.run_functions:cheap"


class Flag:
    """A run function that fails until a file exists."""

    def __init__(self, file: Path) -> None:
        self.file = file

    def __call__(self, case: Case) -> float:
        if not self.file.exists():
            raise FileNotFoundError(str(self.file))
        return float(case["x"])


def test_retry_failed(tmp_path: Path) -> None:
    run, store = Flag(tmp_path / "flag"), tmp_path / "store"
    assert sweep(cases(5), run, executor=1, store=store).counts() == {"error": 5}
    run.file.touch()
    assert sweep(cases(5), run, executor=1, store=store).counts() == {"error": 5}
    assert sweep(cases(5), run, executor=1, store=store, retry_failed=True).counts() == {"done": 5}


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_stopping_keeps_finished_cases(tmp_path: Path, number: int) -> None:
    # A shell that starts the tests in the background makes them ignore Ctrl-C; the program under
    # test must not.
    program = (
        f"import signal; signal.signal(signal.SIGTERM, signal.default_int_handler)\n"
        f"signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        f"from tests.sweeps.crashes import cases; from tests.sweeps.run_functions import paced\n"
        f"from trajopt.sweeps.sweeps import sweep\n"
        f"sweep(cases(4000), paced, executor=2, store={str(tmp_path / 'store')!r})"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=ROOT, stderr=subprocess.PIPE, text=True
    )
    store = open_store(tmp_path / "store")
    for _ in range(600):
        if len(store.parts()) > 1:
            break
        time.sleep(0.05)
    started = time.monotonic()
    process.send_signal(number)
    _, told = process.communicate(timeout=60)
    assert time.monotonic() - started < 30
    assert "KeyboardInterrupt" in told
    assert 3 < len(store.finished()) < 4000
    assert store.counts().keys() == {"done"}
    assert store.runs()[-1]["state"] == "interrupted"
    assert not list((store.path / "runs").glob("*.stop"))


def test_two_sweeps_on_one_store(tmp_path: Path) -> None:
    program = (
        f"from tests.sweeps.crashes import cases; from tests.sweeps.run_functions import paced\n"
        f"from trajopt.sweeps.sweeps import sweep\n"
        f"sweep(cases(200), paced, executor=1, store={str(tmp_path / 'store')!r})"
    )
    both = [subprocess.Popen([sys.executable, "-c", program], cwd=ROOT) for _ in range(2)]
    assert [p.wait(timeout=120) for p in both] == [0, 0]
    store = open_store(tmp_path / "store", create=False)
    assert digest(store) == digest(sweep(cases(200), paced, executor=2, store=tmp_path / "alone"))


def test_full_disk_stops_with_a_message(tmp_path: Path) -> None:
    """A limit on file sizes stands for a full disk: the worker's part cannot be written."""
    store = sweep(cases(5), mixed, executor=1, store=tmp_path / "store")
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    before = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (5_000, hard))
    try:
        with pytest.raises(StoreError, match="cannot write"):
            sweep(cases(300), mixed, executor=1, store=store)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
        signal.signal(signal.SIGXFSZ, before)
    assert len(store.frame()) >= 5
    assert not [p for p in (store.path / "temporary").iterdir() if p.suffix == ".parquet"]
    assert sum(sweep(cases(300), mixed, executor=1, store=store).counts().values()) == 300


@pytest.mark.slow
def test_killed_at_random(tmp_path: Path) -> None:
    """The short form of ``python -m tests.sweeps.crashes``."""
    outcome = torment(6, "processes", 300, 7, tmp_path)
    assert outcome.faults == []
    assert outcome.reads > 0


def test_a_run_function_that_cannot_be_loaded(tmp_path: Path) -> None:
    with pytest.raises(RunLoadError, match="nowhere"):
        sweep(cases(3), _Broken(), executor=1, store=tmp_path / "store")


class _Broken:
    def __reduce__(self) -> Any:
        return (__import__, ("nowhere",))

    def __call__(self, case: Case) -> None: ...


def test_lambdas_travel_by_value(tmp_path: Path) -> None:
    pytest.importorskip("cloudpickle")
    store = sweep(cases(4), lambda case: case["x"] + 0.5, executor=1, store=tmp_path / "store")
    assert sorted(store.frame()["value"]) == [0.5, 1.5, 2.5, 3.5]


def test_columns_and_bad_arguments(tmp_path: Path) -> None:
    store = sweep({"x": np.arange(3)}, noop, executor=1, store=tmp_path / "store")
    assert sorted(store.frame()["x"]) == [0, 1, 2]
    assert store.counts() == {"done": 3}
    with pytest.raises(ArgumentError, match="time_limit"):
        sweep(cases(1), noop, store=store, time_limit=0.0)
    with pytest.raises(ArgumentError, match="case_seed"):
        sweep([{"case_seed": 1}], noop, store=store)


@pytest.mark.slow
def test_workers_that_cannot_start_are_an_error_with_a_reason(tmp_path: Path) -> None:
    """A script without a guard: its workers run it again instead of starting."""
    script = tmp_path / "script.py"
    script.write_text(
        "from pathlib import Path\nfrom trajopt.sweeps.sweeps import sweep\n"
        "def run(case): return 1.0\n"
        f"sweep([{{'x': 1}}], run, executor=1, store=Path({str(tmp_path / 'store')!r}))\n"
    )
    done = subprocess.run(
        [sys.executable, str(script)],
        cwd=ROOT,
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 1
    assert "died at 6 starts in a row" in done.stderr.strip().splitlines()[-1]
    assert 'if __name__ == "__main__"' in done.stderr.strip().splitlines()[-1]


def test_an_engine_that_fails_a_few_starts_is_tried_again(tmp_path: Path) -> None:
    failures = [
        RuntimeError("a process of the cluster was killed"),
        asyncio.CancelledError(),
        OSError("no answer"),
    ]

    @contextmanager
    def start() -> Iterator[Executor]:
        if failures:
            raise failures.pop()
        with ThreadPoolExecutor(1) as executor:
            yield executor

    store = sweep(cases(10), cheap, executor=Engine("shaky", start, 1), store=tmp_path / "store")
    assert store.counts() == {"done": 10}
    failures += [RuntimeError("killed")] * 9
    with pytest.raises(WorkerStartError, match="shaky: workers died at 2 starts in a row"):
        sweep(cases(20), cheap, executor=Engine("shaky", start, 1, starts=2), store=store)
    assert store.counts() == {"done": 10}


_WRITER = """
import mmap, sys, time
from trajopt.sweeps.child import note_progress
with open(sys.argv[1], "r+b") as file:
    progress = mmap.mmap(file.fileno(), 16)
    end = time.monotonic() + 1.0
    while time.monotonic() < end:
        note_progress(progress, 3)
        note_progress(progress, -1)
"""


def test_progress_is_never_read_half_written(tmp_path: Path) -> None:
    """A start time of zero would be a case that runs since the machine was started, and would be
    ended for it."""
    file = tmp_path / "progress"
    file.write_bytes(bytes(PROGRESS.size))
    with file.open("r+b") as stream:
        progress = mmap.mmap(stream.fileno(), PROGRESS.size)
        note_progress(progress, -1)
        with subprocess.Popen([sys.executable, "-c", _WRITER, str(file)]) as writer:
            while writer.poll() is None:
                for _ in range(2000):
                    index, started = noted_progress(progress)
                    assert index in (-1, 3)
                    assert abs(time.monotonic() - started) < 5.0
        assert writer.returncode == 0
