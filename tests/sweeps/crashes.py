"""Kill sweeps with SIGKILL at random instants, run them again, and check that nothing is lost or
doubled.

    python -m tests.sweeps.crashes --kills 300 --engine processes
    python -m tests.sweeps.crashes --kills 300 --engine dask
    python -m tests.sweeps.crashes --kills 20 --engine slurm        (needs a running Slurm)

A kill hits one process of the sweep (worker or its child), the submitting process, or the whole
tree. After it the sweep runs on, or is started again; a finished sweep is compared with one that
nobody disturbed, and a new one begins. A reader looks at the store all the time.
"""

from __future__ import annotations

import argparse
import hashlib
import io
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

from tests.sweeps.run_functions import paced
from trajopt.sweeps.dask_engines import dask_local
from trajopt.sweeps.executors import Engine, processes
from trajopt.sweeps.host import CaseLimits
from trajopt.sweeps.rows import RUN_COLUMNS
from trajopt.sweeps.slurm import SlurmOptions, submit
from trajopt.sweeps.store import Store, open_store
from trajopt.sweeps.sweeps import sweep, tabled

ROOT = Path(__file__).resolve().parents[2]
TARGETS = ("process", "submitter", "tree")


@dataclass
class Outcome:
    """What happened: kills by target, sweeps compared, reads of living stores, and every fault
    found."""

    kills: Counter[str] = field(default_factory=Counter)
    sweeps: int = 0
    reads: int = 0
    faults: list[str] = field(default_factory=list)


def cases(count: int) -> list[dict[str, int]]:
    return [{"x": i} for i in range(count)]


def digest(store: Store) -> str:
    """Hash of the sorted table without its columns of time, host and path, as CSV bytes, and of the
    arrays."""
    text = io.StringIO()
    table = store.table()
    table.select(sorted(set(table.column_names) - set(RUN_COLUMNS))).to_pandas().to_csv(
        text, index=False
    )
    beside = store.arrays()
    if len(beside):
        frame = beside.drop_columns(["run_started"]).to_pandas()
        frame = frame.assign(**{c: frame[c].map(list) for c in ("shape", "values")})
        frame.to_csv(text, index=False)
    return hashlib.sha256(text.getvalue().encode()).hexdigest()


def engine_named(name: str) -> Engine:
    return dask_local(2) if name == "dask" else processes(2)


def descendants(root: int) -> list[int]:
    """Processes below ``root``, from /proc."""
    parents: dict[int, int] = {}
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            try:
                parents[int(entry.name)] = int(
                    (entry / "stat").read_text().rsplit(")", 1)[1].split()[1]
                )
            except (OSError, IndexError):
                continue
    found, todo = [], [root]
    while todo:
        below = [pid for pid, parent in parents.items() if parent == todo[-1]]
        todo.pop()
        found += below
        todo += below
    return found


def kill(pids: list[int]) -> None:
    for pid in pids:
        try:
            os.kill(pid, signal.SIGKILL)
        except ProcessLookupError:
            continue


def torment(kills: int, engine: str, count: int, seed: int, folder: Path) -> Outcome:
    """Kill sweeps of ``count`` cases ``kills`` times; see the module's text."""
    draw, outcome = random.Random(seed), Outcome()
    reference = digest(sweep(cases(count), paced, executor=2, store=folder / "reference"))
    while sum(outcome.kills.values()) < kills:
        place = folder / f"sweep-{outcome.sweeps}"
        open_store(place)
        stop = threading.Event()
        reader = threading.Thread(target=_read_on, args=(place, count, stop, outcome))
        reader.start()
        try:
            _one_sweep(kills, engine, count, draw, outcome, place)
        finally:
            stop.set()
            reader.join()
        store = open_store(place, create=False)
        if digest(store) != reference:
            outcome.faults.append(f"{place}: another table; {store.counts()}")
        else:
            shutil.rmtree(place)
        outcome.sweeps += 1
    return outcome


def _one_sweep(
    kills: int, engine: str, count: int, draw: random.Random, outcome: Outcome, place: Path
) -> None:
    """Run one sweep to its end, killing on the way while kills are left."""
    while True:
        process = _start(engine, count, place)
        while process.poll() is None and sum(outcome.kills.values()) < kills:
            try:
                process.wait(
                    draw.uniform(0.0, 2.0 + (3.0 if engine == "dask" else 0.0) + 0.003 * count)
                )
                break
            except subprocess.TimeoutExpired:
                pass
            target = draw.choice(TARGETS)
            below = descendants(process.pid)
            if target == "process":
                kill(draw.sample(below, 1) if below else [])
            elif target == "submitter":
                process.kill()
            else:
                process.send_signal(
                    signal.SIGSTOP
                )  # so that it starts nothing between listing and killing
                kill([*descendants(process.pid), process.pid])
            outcome.kills[target] += 1
        if process.wait() == 0:
            return
        if process.returncode != -signal.SIGKILL:
            told = _said(place).read_text(errors="replace")[-6000:]
            outcome.faults.append(f"{place}: the sweep ended with {process.returncode}\n{told}")
            return


def _start(engine: str, count: int, place: Path) -> subprocess.Popen[bytes]:
    with _said(place).open("wb") as said:
        return subprocess.Popen(
            [
                sys.executable,
                "-m",
                "tests.sweeps.crashes",
                "--work",
                str(place),
                "--engine",
                engine,
                "--cases",
                str(count),
            ],
            cwd=ROOT,
            stdin=subprocess.DEVNULL,
            stderr=said,
        )


def _said(place: Path) -> Path:
    """What the last sweep in ``place`` wrote to standard error."""
    return place.with_suffix(".stderr")


def _read_on(place: Path, count: int, stop: threading.Event, outcome: Outcome) -> None:
    """Read a living store again and again: every read must succeed, and rows may never get
    fewer."""
    rows = 0
    while not stop.wait(0.3):
        try:
            now = len(open_store(place, create=False).table(["case"]))
        except Exception as error:
            outcome.faults.append(f"{place}: reading failed: {error!r}")
            return
        outcome.reads += 1
        if not rows <= now <= count:
            outcome.faults.append(f"{place}: {rows} rows, then {now}")
        rows = now


def torment_slurm(kills: int, count: int, seed: int, folder: Path) -> Outcome:
    """The same with job arrays: kill running elements (their processes) or the submitting
    process."""
    draw, outcome = random.Random(seed), Outcome()
    reference = digest(sweep(cases(count), paced, executor=2, store=folder / "reference"))
    while sum(outcome.kills.values()) < kills:
        place = folder / f"array-{outcome.sweeps}"
        open_store(place)
        while len(open_store(place).finished()) < count:
            process = _start("slurm", count, place)
            if sum(outcome.kills.values()) < kills and draw.random() < 0.6:
                time.sleep(draw.uniform(0.2, 4.0))
                process.kill()
                outcome.kills["submitter"] += 1
            process.wait()
            while _queued():
                time.sleep(draw.uniform(0.1, 1.5))
                below = _elements()
                if below and sum(outcome.kills.values()) < kills:
                    kill(draw.sample(below, 1))
                    outcome.kills["element"] += 1
        if digest(open_store(place)) != reference:
            outcome.faults.append(f"{place}: another table; {open_store(place).counts()}")
        outcome.sweeps += 1
    return outcome


def _queued() -> bool:
    told = subprocess.run(["squeue", "--noheader"], capture_output=True, text=True, check=True)
    return bool(told.stdout.strip())


def _elements() -> list[int]:
    """Processes of array elements on this node and what they started."""
    found = []
    for entry in Path("/proc").iterdir():
        try:
            if (
                entry.name.isdigit()
                and b"trajopt.sweeps.slurm import element" in (entry / "cmdline").read_bytes()
            ):
                found += [int(entry.name), *descendants(int(entry.name))]
        except OSError:
            continue
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kills", type=int, default=300)
    parser.add_argument("--engine", choices=("processes", "dask", "slurm"), default="processes")
    parser.add_argument("--cases", type=int, default=600)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--work", help="internal: run the sweep itself in this store")
    options = parser.parse_args()
    if options.work and options.engine == "slurm":
        table = tabled(cases(options.cases), paced, None)
        submit(
            table,
            paced,
            open_store(options.work),
            limits=CaseLimits(60.0, 0),
            case_seconds=0.02,
            options=SlurmOptions(elements=4, memory="500M"),
        )
        return 0
    if options.work:
        sweep(
            cases(options.cases), paced, executor=engine_named(options.engine), store=options.work
        )
        return 0
    with tempfile.TemporaryDirectory(prefix="trajopt-crashes-") as folder:
        started = time.monotonic()
        if options.engine == "slurm":
            outcome = torment_slurm(options.kills, options.cases, options.seed, Path(folder))
        else:
            outcome = torment(
                options.kills, options.engine, options.cases, options.seed, Path(folder)
            )
    print(
        f"{options.engine}: kills {dict(outcome.kills)}, {outcome.sweeps} sweeps of {options.cases} cases compared, "
        f"{outcome.reads} reads, {len(outcome.faults)} faults, {time.monotonic() - started:.0f} s"
    )
    for fault in outcome.faults:
        print("FAULT", fault)
    return 1 if outcome.faults else 0


if __name__ == "__main__":
    sys.exit(main())
