"""What a sweep costs beside the work itself: our process pool next to joblib and Dask.

    python -m benchmarks.sweep_overhead [--quick] [--million]

Cases wait 5 ms each. Overhead a case = (wall time x workers - work) / cases, taken from the difference between a
long and a short sweep, so that the start of workers cancels; work is the sum of the times that the cases themselves
took, so that a late timer is not counted. Ours also writes every row to disk; joblib and Dask return results in
memory. ``--million`` plans, runs and reads 1,000,000 empty cases.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.study.cases import Case
from trajopt.study.engines import Engine, dask_local, processes
from trajopt.study.sweeps import missing, sweep, tabled

CASE_SECONDS = 0.005
WORKERS = 2
TARGET = 0.2  # ms a case, from the issue


def paced(case: Case) -> float:
    """A case of 5 ms; returns what it took, s."""
    return _paced(case["x"])


def _paced(_: int) -> float:
    start = time.perf_counter()
    time.sleep(CASE_SECONDS)
    return time.perf_counter() - start


def _paced_many(xs: list[int]) -> list[float]:
    return [_paced(x) for x in xs]


def empty(case: Case) -> None:
    """No work at all."""


def ours(cases: int, engine: Engine) -> tuple[float, float]:
    """Wall time of a whole sweep and work in it, s."""
    with tempfile.TemporaryDirectory() as folder:
        begun = time.perf_counter()
        store = sweep([{"x": i} for i in range(cases)], paced, executor=engine, store=Path(folder) / "store")
        wall = time.perf_counter() - begun
        values = store.frame()["value"].to_numpy()
    assert len(values) == cases
    return wall, float(values.sum())


def joblib(cases: int, batch: int | str) -> tuple[float, float]:
    from joblib import Parallel, delayed

    begun = time.perf_counter()
    values = Parallel(n_jobs=WORKERS, batch_size=batch)(delayed(_paced)(i) for i in range(cases))
    return time.perf_counter() - begun, float(np.sum(values))


def dask(cases: int, chunk: int) -> tuple[float, float]:
    from distributed import Client, LocalCluster

    begun = time.perf_counter()
    with (LocalCluster(n_workers=WORKERS, threads_per_worker=1, host="127.0.0.1", dashboard_address=None,
                       silence_logs=40) as cluster, Client(cluster) as client):
        blocks = [list(range(i, min(i + chunk, cases))) for i in range(0, cases, chunk)]
        values = client.gather(client.map(_paced_many, blocks, pure=False))
    return time.perf_counter() - begun, float(np.sum([v for b in values for v in b]))


TRIALS: tuple[tuple[str, Callable[[int], tuple[float, float]]], ...] = (
    ("trajopt, process pool, rows on disk", lambda n: ours(n, processes(WORKERS))),
    ("trajopt, Dask, rows on disk", lambda n: ours(n, dask_local(WORKERS))),
    ("joblib, loky, automatic batches", lambda n: joblib(n, "auto")),
    ("joblib, loky, one by one", lambda n: joblib(n, 1)),
    ("Dask, chunks of 100", lambda n: dask(n, 100)),
    ("Dask, one by one", lambda n: dask(n, 1)),
)


def cpu_seconds() -> float:
    """CPU time of this process and of its ended children: unlike wall time, not changed by what else runs."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def overhead_table(short: int, long: int) -> ResultTable:
    rows = []
    for name, trial in TRIALS:
        try:
            before = cpu_seconds()
            wall, work = trial(short)
            middle = cpu_seconds()
            wall_long, work_long = trial(long)
            cpu = 1e3 * (cpu_seconds() - 2 * middle + before) / (long - short)
        except ImportError as error:
            rows.append((name, "not installed", str(error), "", ""))
            continue
        lost = 1e3 * ((wall_long - wall) * WORKERS - (work_long - work)) / (long - short)
        start = wall - work / WORKERS - 1e-3 * lost * short / WORKERS
        took = 1e3 * (work_long - work) / (long - short)
        rows.append((name, f"{lost:.3f}", f"{cpu:.3f}", f"{start:.2f}", f"{took:.2f}"))
    return ResultTable(f"{short} and {long} cases of 5 ms on {WORKERS} workers (target <= {TARGET} ms a case)",
                       ("engine", "overhead a case, ms", "CPU time a case, ms", "start and end, s", "a case took, ms"),
                       rows)


class PeakMemory:
    """Largest sum of proportional memory of this process and all below it, sampled twice a second, bytes."""

    def __init__(self) -> None:
        self.peak, self._end = 0, threading.Event()
        self._thread = threading.Thread(target=self._watch, daemon=True)

    def __enter__(self) -> PeakMemory:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._end.set()
        self._thread.join()

    def _watch(self) -> None:
        import psutil

        me = psutil.Process()
        while not self._end.wait(0.5):
            total = 0
            for process in (me, *me.children(recursive=True)):
                try:
                    total += process.memory_full_info().pss
                except psutil.Error:
                    continue
            self.peak = max(self.peak, total)


def million_table(cases: int) -> ResultTable:
    folder = Path(tempfile.mkdtemp())
    rows = []
    with PeakMemory() as memory:
        begun = last = time.perf_counter()

        def step(name: str) -> None:
            nonlocal last
            now = time.perf_counter()
            rows.append((name, f"{now - last:.1f}"))
            last = now

        table = tabled({"x": np.arange(cases), "y": np.linspace(0, 1, cases)}, empty, None, None)
        step("plan: identities")
        store = sweep(table, empty, executor=WORKERS, store=folder / "store")
        step(f"run, {len(store.parts())} parts")
        assert len(store.frame()) == cases
        step("read back")
        store.compact()
        step("compact")
        assert len(missing(table, store)) == 0
        step("find that nothing is missing")
        rows.append(("all", f"{time.perf_counter() - begun:.1f}"))
    rows.append(("peak memory of all processes, GB", f"{memory.peak / 1e9:.2f}"))
    shutil.rmtree(folder)
    return ResultTable(f"{cases} empty cases on {WORKERS} workers (target <= 30 min, 2 GB)", ("step", "s"), rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="few cases, and 20,000 empty ones")
    parser.add_argument("--million", action="store_true", help="1,000,000 empty cases too")
    options = parser.parse_args()
    tables = [overhead_table(400, 800 if options.quick else 4400)]
    if options.quick or options.million:
        tables.append(million_table(20_000 if options.quick else 1_000_000))
    publish("sweep_overhead", tables, packages=("numpy", "pyarrow", "joblib", "distributed"))


if __name__ == "__main__":
    main()
