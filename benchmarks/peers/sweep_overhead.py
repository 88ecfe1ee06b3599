"""What a sweep costs beside the work itself: our process pool next to joblib and Dask.

    python -m benchmarks.peers.sweep_overhead [--quick] [--part pool|dask|million]

Cases wait 5 ms each. Overhead a case = (wall time x workers - work) / cases, taken from the
difference between a long and a short sweep, so that the start of workers cancels; work is the sum
of the times that the cases themselves took, so that a late timer is not counted. Such pairs are
repeated; the table shows median, least and largest. Waiting costs no processor time, so the
processor time a case, of all processes together, is overhead too. A bare pool that only runs the
cases is measured the same way. Ours also writes every row to disk; the others return results in
memory. ``--part million`` plans, runs and reads 1,000,000 empty cases.
"""

from __future__ import annotations

import argparse
import resource
import shutil
import statistics
import tempfile
import threading
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path

import numpy as np

from benchmarks.common import ResultTable, publish
from trajopt.sweeps.cases import Case
from trajopt.sweeps.dask_engines import dask_local
from trajopt.sweeps.executors import Engine, processes
from trajopt.sweeps.source import code_of
from trajopt.sweeps.sweeps import missing, sweep, tabled

CASE_SECONDS = 0.005
WORKERS = 2
TARGET = 0.2  # ms a case; chosen


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
        store = sweep(
            [{"x": i} for i in range(cases)], paced, executor=engine, store=Path(folder) / "store"
        )
        wall = time.perf_counter() - begun
        values = store.frame()["value"].to_numpy()
    assert len(values) == cases
    return wall, float(values.sum())


def bare(cases: int, chunk: int) -> tuple[float, float]:
    """The same cases in a process pool of their own, and nothing else."""
    begun = time.perf_counter()
    blocks = [list(range(i, min(i + chunk, cases))) for i in range(0, cases, chunk)]
    with ProcessPoolExecutor(WORKERS, mp_context=get_context("spawn")) as pool:
        values = [v for block in pool.map(_paced_many, blocks) for v in block]
    return time.perf_counter() - begun, float(np.sum(values))


def joblib(cases: int, batch: int | str) -> tuple[float, float]:
    from joblib import Parallel, delayed

    begun = time.perf_counter()
    values = Parallel(n_jobs=WORKERS, batch_size=batch)(delayed(_paced)(i) for i in range(cases))
    return time.perf_counter() - begun, float(np.sum(values))


def dask(cases: int, chunk: int) -> tuple[float, float]:
    from distributed import Client, LocalCluster

    begun = time.perf_counter()
    with (
        LocalCluster(
            n_workers=WORKERS,
            threads_per_worker=1,
            host="127.0.0.1",
            dashboard_address=None,
            silence_logs=40,
        ) as cluster,
        Client(cluster) as client,
    ):
        blocks = [list(range(i, min(i + chunk, cases))) for i in range(0, cases, chunk)]
        values = client.gather(client.map(_paced_many, blocks, pure=False))
    return time.perf_counter() - begun, float(np.sum([v for b in values for v in b]))


@dataclass(frozen=True)
class Trial:
    """A way to run cases: their number -> wall time and work, s. ``pairs`` of a short and a
    ``long`` run."""

    name: str
    run: Callable[[int], tuple[float, float]]
    pairs: int = 3
    long: int = 4400


SHORT = 400  # cases of the short run
POOL = (
    Trial("trajopt, process pool, rows on disk", lambda n: ours(n, processes(WORKERS))),
    Trial("bare process pool, chunks of 100", lambda n: bare(n, 100)),
    Trial("joblib, loky, automatic batches", lambda n: joblib(n, "auto")),
)
DASK = (
    Trial("trajopt, Dask, rows on disk", lambda n: ours(n, dask_local(WORKERS))),
    Trial("Dask, chunks of 100", lambda n: dask(n, 100)),
    Trial("Dask, one by one", lambda n: dask(n, 1), 1, 800),
    Trial("joblib, loky, one by one", lambda n: joblib(n, 1), 1),
)


def cpu_seconds() -> float:
    """CPU time of this process and of its ended children: unlike wall time, not changed by what
    else runs."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(u.ru_utime + u.ru_stime for u in used)


def overhead_table(name: str, trials: tuple[Trial, ...], quick: bool) -> ResultTable:
    rows = []
    for trial in trials:
        long = 2 * SHORT if quick else trial.long
        try:
            pairs = [_pair(trial, long) for _ in range(1 if quick else trial.pairs)]
        except ImportError as error:
            rows.append((trial.name, "not installed", str(error), "", "", "", ""))
            continue
        lost, cpu, start, took = (sorted(column) for column in zip(*pairs, strict=True))
        rows.append(
            (
                trial.name,
                f"{statistics.median(lost):.3f}",
                f"{lost[0]:.3f} .. {lost[-1]:.3f}",
                f"{statistics.median(cpu):.3f}",
                f"{statistics.median(start):.2f}",
                f"{statistics.median(took):.2f}",
                str(len(pairs)),
            )
        )
    return ResultTable(
        f"{name}: {WORKERS} workers, cases of 5 ms (target <= {TARGET} ms a case)",
        (
            "engine",
            "overhead a case, ms",
            "least .. largest",
            "CPU time a case, ms",
            "start and end, s",
            "a case took, ms",
            "pairs",
        ),
        rows,
    )


def _pair(trial: Trial, long: int) -> tuple[float, float, float, float]:
    """Overhead a case (ms), processor time a case (ms), start and end (s), time that a case itself
    took (ms)."""
    before = cpu_seconds()
    wall, work = trial.run(SHORT)
    middle = cpu_seconds()
    wall_long, work_long = trial.run(long)
    cpu = 1e3 * (cpu_seconds() - 2 * middle + before) / (long - SHORT)
    lost = 1e3 * ((wall_long - wall) * WORKERS - (work_long - work)) / (long - SHORT)
    start = wall - work / WORKERS - 1e-3 * lost * SHORT / WORKERS
    return lost, cpu, start, 1e3 * (work_long - work) / (long - SHORT)


class PeakMemory:
    """Largest sum of proportional memory of this process and all below it, sampled twice a second,
    bytes."""

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

        table = tabled({"x": np.arange(cases), "y": np.linspace(0, 1, cases)}, empty, None)
        step("plan: identities")
        store = sweep(table, empty, executor=WORKERS, store=folder / "store")
        step(f"run, {len(store.parts())} parts")
        assert len(store.frame()) == cases
        step("read back")
        store.compact()
        step("compact")
        assert len(missing(table, store, code_of(empty))) == 0
        step("find that nothing is missing")
        rows.append(("all", f"{time.perf_counter() - begun:.1f}"))
    rows.append(("peak memory of all processes, GB", f"{memory.peak / 1e9:.2f}"))
    shutil.rmtree(folder)
    return ResultTable(
        f"{cases} empty cases on {WORKERS} workers (target <= 30 min, 2 GB)", ("step", "s"), rows
    )


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument(
        "--quick", action="store_true", help="few cases, one pair, and 20,000 empty ones"
    )
    parser.add_argument(
        "--part",
        choices=("pool", "dask", "million"),
        help="one part; its own files in out/benchmarks",
    )
    options = parser.parse_args()
    tables = []
    if options.part in (None, "pool"):
        tables.append(overhead_table("Process pool", POOL, options.quick))
    if options.part in (None, "dask"):
        tables.append(overhead_table("Dask, and one by one", DASK, options.quick))
    if options.part in (None, "million"):
        tables.append(million_table(20_000 if options.quick else 1_000_000))
    publish(
        "sweep_overhead" + (f"_{options.part}" if options.part else ""),
        tables,
        packages=("numpy", "pyarrow", "joblib", "distributed"),
    )


if __name__ == "__main__":
    main()
