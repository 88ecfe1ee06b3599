"""Sweeps as plain Slurm job arrays: one array element a group of chunks, and no submitter that must
stay alive.

``submit`` writes what each element is to do into the store and calls ``sbatch``; ``element`` is
what runs on the node. An element that is preempted or asked to end stores what it has finished;
when Slurm runs it again it does only what is missing.
"""

from __future__ import annotations

import os
import pickle
import shlex
import shutil
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import IntArray
from trajopt.errors import ArgumentError, TrajoptError
from trajopt.files import DamageError, digest
from trajopt.sweeps.cases import CaseTable
from trajopt.sweeps.child import THREAD_VARIABLES
from trajopt.sweeps.drive import MOST_CASES, Setup
from trajopt.sweeps.host import CaseLimits, ChunkJob, parameter_kinds, run_chunk
from trajopt.sweeps.rows import arrow
from trajopt.sweeps.runfunction import RunFunction, name_of, packed
from trajopt.sweeps.source import code_of
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.supervisor import end_child
from trajopt.sweeps.sweeps import Old, close_record, known_kinds, missing, record_run, sweep
from trajopt.sweeps.upkeep import align

CHUNK_SECONDS = 5.0  # work between two parts of an element: what a killed element loses; chosen
ELEMENT_SECONDS = 300.0  # work of an element, against the 0.5 s that Slurm takes for one; chosen
_WAIT = 2.0  # s between looks at the queue; chosen
MOST_ELEMENTS = 1000  # Slurm's default MaxArraySize is 1001


class SlurmError(TrajoptError):
    """Slurm is not there, or refused a job."""


@dataclass(frozen=True)
class SlurmOptions:
    """What ``sbatch`` is asked for. ``at_once``: elements running together (0: no limit);
    ``elements``: how many (0: by measured time). ``extra``: further arguments of sbatch, as
    given."""

    time: str = "01:00:00"
    memory: str = "2G"
    partition: str | None = None
    at_once: int = 0
    elements: int = 0
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not 0 <= self.elements <= MOST_ELEMENTS:
            raise ArgumentError("elements", self.elements, f"0 .. {MOST_ELEMENTS}")
        for name in ("time", "memory", "partition", "extra"):
            value = getattr(self, name)
            texts = value if name == "extra" else () if value is None else (value,)
            if not all(isinstance(t, str) and t and t.isprintable() for t in texts):
                raise ArgumentError(name, value, "a text in one line, as sbatch takes it")

    def arguments(self, folder: Path, count: int) -> list[str]:
        """Arguments of sbatch for ``count`` elements that log into ``folder``. Never read by a
        shell. Raises ArgumentError for a folder that Slurm cannot be told."""
        if "\\" in str(folder) or not str(folder).isprintable():
            raise ArgumentError("store", str(folder), "a printable path without backslashes")
        limit = f"%{self.at_once}" if self.at_once else ""
        return [
            "--job-name=trajopt-sweep",
            f"--array=0-{count - 1}{limit}",
            "--ntasks=1",
            "--cpus-per-task=1",
            f"--mem={self.memory}",
            f"--time={self.time}",
            "--requeue",
            "--open-mode=append",
            f"--output={str(folder).replace('%', '%%')}/element-%a.log",
            *([f"--partition={self.partition}"] if self.partition else []),
            *self.extra,
        ]


@dataclass(frozen=True)
class Submission:
    """An array that was handed to Slurm: its job number ("" when nothing was missing), elements,
    and cases."""

    job: str
    elements: int
    cases: int
    folder: Path


def submit(
    table: CaseTable,
    run: RunFunction,
    store: Store,
    *,
    limits: CaseLimits,
    options: SlurmOptions,
    source: str = "",
    code: str | None = None,
    retry_failed: bool = False,
    old: Old | None = None,
    wait: bool = False,
    case_seconds: float | None = None,
) -> Submission:
    """Hand all missing cases to Slurm; ``wait`` until the array has ended.

    Three sampled cases run here first, to learn the time and the columns of a case, unless
    ``case_seconds`` says the time. Raises SlurmError.
    """
    if shutil.which("sbatch") is None:
        raise SlurmError(
            "sbatch is not installed here: submit from a Slurm login node, or use sweep run"
        )
    made_by = code_of(run, code)
    choice: dict[str, Any] = {"retry_failed": retry_failed, "old": old}
    places = missing(table, store, made_by, **choice)
    if case_seconds is None:
        case_seconds = _sampled_seconds(table, run, store, limits, code, choice)
        places = missing(table, store, made_by, **choice)
    folder = (
        store.path
        / "jobs"
        / (time.strftime("%Y%m%dT%H%M%S", time.gmtime()) + "-" + uuid.uuid4().hex[:8])
    )
    if not len(places):
        return Submission("", 0, 0, folder)
    engine = "Slurm array"
    run_id = record_run(store, table, len(places), name_of(run), engine, source, limits, made_by)
    setup = Setup(store, run_id, packed(run), limits, parameter_kinds(table), made_by.digest)
    jobs = _chunks(table, places, setup, case_seconds)
    count = options.elements or round(len(places) * case_seconds / ELEMENT_SECONDS)
    count = min(max(count, 1), len(jobs), MOST_ELEMENTS)
    for number in range(count):
        store.write(f"jobs/{folder.name}/element-{number}.log", b"")
        todo = pickle.dumps(jobs[number::count])
        store.write(f"jobs/{folder.name}/element-{number}.pickle", digest(todo).encode() + todo)
    store.write(f"jobs/{folder.name}/array.sh", _script(folder).encode())
    job = _sbatch(folder / "array.sh", options.arguments(folder.resolve(), count))
    close_record(store, run_id, f"submitted as job {job}", {})
    if wait:
        while subprocess.run(
            ["squeue", "--noheader", f"--jobs={job}"], capture_output=True, text=True, check=False
        ).stdout.strip():
            time.sleep(_WAIT)
        align(store)
    return Submission(job, count, len(places), folder)


def element(folder: str, number: int) -> int:
    """Run one array element: exit code 0 when all its cases have rows, 75 (try again) when it was
    told to stop."""
    file = Path(folder) / f"element-{number}.pickle"
    data = file.read_bytes()
    if digest(data[32:]).encode() != data[:32]:
        raise DamageError(f"{file}: damaged: submit the sweep again")
    jobs: list[ChunkJob] = pickle.loads(data[32:])
    known = _stored(jobs)
    told: list[int] = []

    def tell(signum: int, _: FrameType | None) -> None:
        told.append(signum)

    signal.signal(signal.SIGTERM, tell)
    signal.signal(signal.SIGINT, tell)
    try:
        for job in jobs:
            left = _left(job, known)
            if left is not None and not told:
                report = run_chunk(left, lambda: bool(told))
                print(f"{job.name}: {dict(report.counts)}, {report.unfinished} left", flush=True)
            if told:
                return os.EX_TEMPFAIL
    finally:
        end_child()
    return 0


def _stored(jobs: Sequence[ChunkJob]) -> NDArray[np.bytes_]:
    """Cases that an earlier life of this element has stored."""
    store = open_store(jobs[0].store, create=False)
    return store.finished(where=("run_id", jobs[0].run_id), chunks={job.name for job in jobs})


def _left(job: ChunkJob, known: NDArray[np.bytes_]) -> ChunkJob | None:
    """The job without the ``known`` cases; None when none is left."""
    places = np.flatnonzero(~np.isin(job.cases.ids, known))
    return replace(job, cases=job.cases.take(places)) if len(places) else None


def _sampled_seconds(
    table: CaseTable,
    run: RunFunction,
    store: Store,
    limits: CaseLimits,
    code: str | None,
    choice: Mapping[str, Any],
) -> float:
    trial = table.sampled()
    sweep(
        trial,
        run,
        executor=1,
        store=store,
        time_limit=limits.seconds,
        memory_limit=limits.memory,
        code=code,
        **choice,
    )
    rows = store.table(["run_seconds"])
    keys = arrow().array([i.decode() for i in trial.ids.tolist()])
    seconds = rows.filter(arrow().compute.is_in(rows["case"], keys))["run_seconds"].to_pylist()
    return float(max(np.median(seconds), 1e-5))


def _chunks(
    table: CaseTable, places: IntArray, setup: Setup, case_seconds: float
) -> list[ChunkJob]:
    size = int(min(max(CHUNK_SECONDS / case_seconds, 1), MOST_CASES))
    kinds, place = known_kinds(setup.store, table), str(setup.store.path.resolve())
    return [
        setup.job(table.take(places[start : start + size]), kinds, place)
        for start in range(0, len(places), size)
    ]


def _script(folder: Path) -> str:
    place = folder.resolve()
    program = (
        f"import sys; sys.path[:] = {list(sys.path)!r}; from trajopt.sweeps.slurm import element; "
        f"sys.exit(element({str(place)!r}, int(sys.argv[1])))"
    )
    lines = [
        "#!/bin/bash",
        *(f"export {name}=1" for name in THREAD_VARIABLES),
        f'exec {shlex.quote(sys.executable)} -c {shlex.quote(program)} "$SLURM_ARRAY_TASK_ID"',
    ]
    return "\n".join(lines) + "\n"


def _sbatch(script: Path, arguments: Sequence[str]) -> str:
    command = ["sbatch", "--parsable", *arguments, str(script)]
    told = subprocess.run(command, capture_output=True, text=True, check=False)
    job = told.stdout.strip().split(";")[0]
    if not job or told.returncode != 0:
        raise SlurmError(f"sbatch refused {script}: {told.stderr.strip() or told.stdout.strip()}")
    return job
