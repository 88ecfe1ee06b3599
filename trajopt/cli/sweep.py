"""The commands ``trajopt sweep ...``."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from trajopt.cli.shared import (
    Force,
    FormatOption,
    console,
    leaving,
    picture_kind,
    require_free,
    switched,
)
from trajopt.errors import ArgumentError
from trajopt.report.words import words

if TYPE_CHECKING:
    from collections.abc import Callable

    from trajopt.sweeps.drive import Progress
    from trajopt.sweeps.executors import Engine
    from trajopt.sweeps.store import Store
    from trajopt.sweeps.sweepfile import SweepPlan
    from trajopt.sweeps.sweeps import Old

app = typer.Typer(
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Run a study over many cases, on one machine or on a cluster, and lose nothing.",
)
_KEPT = "interrupted: finished cases are kept, the same command goes on; once more: at once"
_SUBMITTED = "interrupted: finished cases are kept; an array that was submitted goes on"
_SHOWN = 5  # cases shown by --dry-run

SweepFile = Annotated[Path, typer.Argument(help="sweep file (*.toml)", show_default=False)]
StorePath = Annotated[
    Path, typer.Argument(help="store of a sweep (its directory)", show_default=False)
]
StoreOption = Annotated[
    Path | None, typer.Option("--store", help="store; default: out/sweeps/<name of the file>")
]
Workers = Annotated[int, typer.Option(help="worker processes or jobs (0: all processors)")]
EngineName = Annotated[
    str,
    typer.Option(
        "--engine", help="processes, dask, dask-slurm, or tcp://host:port of a Dask scheduler"
    ),
]
Rerun = Annotated[bool, typer.Option("--rerun", help="run cases again whose rows other code made")]
KeepOld = Annotated[bool, typer.Option("--keep-old", help="keep rows that other code made")]
Host = Annotated[str, typer.Option(help="address at which Dask's servers listen")]
Tls = Annotated[
    Path | None,
    typer.Option(help="folder with ca.pem, cert.pem, key.pem: Dask lets only their holders in"),
]


@app.command()
@switched
def run(
    sweep_file: SweepFile,
    store: StoreOption = None,
    workers: Workers = 0,
    engine: EngineName = "processes",
    host: Host = "127.0.0.1",
    tls: Tls = None,
    rerun: Rerun = False,
    keep_old: KeepOld = False,
    dry_run: Annotated[
        bool, typer.Option(help="show cases and an estimate of the time; store nothing")
    ] = False,
) -> None:
    """Run every case that has no row yet."""
    from trajopt.sweeps.sweepfile import load_sweep

    plan = load_sweep(sweep_file)
    if dry_run:
        _dry_run(plan, workers)
        return
    _go(
        plan,
        store or _default_store(sweep_file),
        _engine(engine, workers, host, tls),
        retry_failed=False,
        old=old_rows(rerun, keep_old),
    )


@app.command("retry-failed")
@switched
def retry_failed(
    sweep_file: SweepFile,
    store: StoreOption = None,
    workers: Workers = 0,
    engine: EngineName = "processes",
    host: Host = "127.0.0.1",
    tls: Tls = None,
    rerun: Rerun = False,
    keep_old: KeepOld = False,
) -> None:
    """Run cases again that failed, timed out or crashed, and those without a row."""
    from trajopt.sweeps.sweepfile import load_sweep

    _go(
        load_sweep(sweep_file),
        store or _default_store(sweep_file),
        _engine(engine, workers, host, tls),
        retry_failed=True,
        old=old_rows(rerun, keep_old),
    )


@app.command()
@switched
def submit(
    sweep_file: SweepFile,
    store: StoreOption = None,
    slurm: Annotated[bool, typer.Option("--slurm", help="as a Slurm job array")] = False,
    elements: Annotated[int, typer.Option(help="array elements (0: by measured time)")] = 0,
    at_once: Annotated[int, typer.Option(help="elements running together (0: no limit)")] = 0,
    time_: Annotated[str, typer.Option("--time", help="time limit of an element")] = "01:00:00",
    memory: Annotated[str, typer.Option(help="memory of an element")] = "2G",
    partition: Annotated[str | None, typer.Option(help="Slurm partition")] = None,
    wait: Annotated[bool, typer.Option(help="wait until the array has ended")] = False,
    failed: Annotated[bool, typer.Option("--retry-failed", help="failed cases too")] = False,
    rerun: Rerun = False,
    keep_old: KeepOld = False,
) -> None:
    """Hand the missing cases to Slurm and return; nothing here needs to stay alive."""
    from trajopt.sweeps.host import CaseLimits
    from trajopt.sweeps.slurm import SlurmOptions
    from trajopt.sweeps.slurm import submit as hand_over
    from trajopt.sweeps.store import open_store
    from trajopt.sweeps.sweepfile import load_sweep

    if not slurm:
        raise ArgumentError("--slurm", False, "--slurm: job arrays are submitted to Slurm only")
    plan = load_sweep(sweep_file)
    place = open_store(store or _default_store(sweep_file))
    with leaving(_SUBMITTED):
        done = hand_over(
            plan.table,
            plan.run,
            place,
            limits=CaseLimits(plan.time_limit, plan.memory_limit or 0),
            options=SlurmOptions(time_, memory, partition, at_once, elements),
            source=plan.text,
            code=plan.code,
            retry_failed=failed,
            old=old_rows(rerun, keep_old),
            wait=wait,
        )
    if not done.job:
        console.print("nothing is missing")
    else:
        console.print(
            f"job {done.job}: {done.cases} cases in {done.elements} elements; store {place.path}"
        )


@app.command()
@switched
def status(store: StorePath) -> None:
    """Cases by status, the last runs, and the commonest errors."""
    from trajopt.sweeps.store import open_store

    place = open_store(store, create=False)
    counts, runs = place.counts(), place.runs()
    from rich.table import Table

    shown = Table("status", "cases", title=str(store), title_justify="left")
    for name, count in counts.items():
        shown.add_row(name, str(count))
    if runs:
        shown.add_row(
            "missing (of the last sweep)",
            str(max(0, int(runs[-1]["cases"]) - sum(counts.values()))),
        )
    console.print(shown)
    listing = Table(
        "run", "state", "engine", "missing then", "commit", title="runs", title_justify="left"
    )
    for entry in runs[-_SHOWN:]:
        listing.add_row(
            entry["run"],
            entry["state"],
            entry["engine"],
            str(entry["missing"]),
            str(entry["commit"])[:10],
        )
    console.print(listing)
    _print_errors(place)


@app.command()
@switched
def show(
    store: StorePath, case: Annotated[str, typer.Argument(help="first digits of a case")]
) -> None:
    """One case: its values, results, arrays, and the traceback of its error."""
    from trajopt.sweeps.store import open_store

    row, arrays = open_store(store, create=False).case(case)
    from rich.table import Table

    shown = Table("name", "value", title=f"case {row['case']}", title_justify="left")
    for name, value in row.items():
        if value is not None and name not in ("case", "error_traceback"):
            shown.add_row(name, str(value))
    for name, array in arrays.items():
        shown.add_row(name, f"array {array.shape}")
    console.print(shown)
    if row.get("error_traceback"):
        console.print(row["error_traceback"])


def report(
    source: Annotated[
        Path, typer.Argument(help="sweep file (*.toml), the store of a sweep, or a run folder")
    ],
    case: Annotated[str, typer.Argument(help="first digits of a case; none for a run folder")] = "",
    out: Annotated[
        Path | None, typer.Option("--out", help="folder; default: out/report/<case>")
    ] = None,
    store: StoreOption = None,
    format_: FormatOption = None,
) -> None:
    """Draw the pictures of one case out of a sweep, or of a folder that solve wrote, again."""
    from trajopt.sweeps.store import open_store

    kind = picture_kind(True, format_) or "png"
    if not case:
        from trajopt.report.pictures import save_pictures
        from trajopt.report.run_folder import read_solution

        files = list(save_pictures(read_solution(source), out or source, kind))
    else:
        from trajopt.report.sweep_case import report_case
        from trajopt.sweeps.sweepfile import load_sweep

        plan = None if source.is_dir() else load_sweep(source)
        place = source if plan is None else store or _default_store(source)
        files = report_case(
            open_store(place, create=False), case, out or Path("out") / "report" / case, plan, kind
        )
    for file in files:
        console.print(f"wrote {file}", soft_wrap=True)


@app.command()
@switched
def compact(store: StorePath) -> None:
    """Merge the parts of a store into large ones."""
    from trajopt.sweeps.store import open_store

    before, after = open_store(store, create=False).compact()
    console.print(f"{before} parts before, {after} after")


@app.command()
@switched
def verify(store: StorePath) -> None:
    """Read everything in a store and compare it with its checksums; exit code 1 for damage."""
    from trajopt.sweeps.store import open_store
    from trajopt.sweeps.upkeep import verify as verify_store

    found = verify_store(open_store(store, create=False))
    for damage in found:
        console.print(str(damage))
    if found:
        raise typer.Exit(1)
    console.print("whole")


@app.command()
@switched
def repair(store: StorePath) -> None:
    """Take out what is damaged, with lists of the cases to run again, into <store>/damaged."""
    from trajopt.sweeps.upkeep import repair as repair_store

    found = repair_store(store)
    for damage in found:
        console.print(str(damage))
    console.print("now run the sweep again: it fills the gaps" if found else "whole")


@app.command()
@switched
def export(
    store: StorePath,
    out: Annotated[Path, typer.Argument(help="file: *.csv, *.parquet or *.jsonl")],
    force: Force = False,
) -> None:
    """Write all rows, one a case, to one file."""
    from trajopt.sweeps.store import open_store

    require_free("out", out, force)
    place = open_store(store, create=False)
    if out.suffix not in (".csv", ".parquet", ".jsonl"):
        raise ArgumentError("out", str(out), "a file ending in .csv, .parquet or .jsonl")
    from trajopt.files import whole_file

    with whole_file(out) as part:
        match out.suffix:
            case ".csv":
                place.frame().to_csv(part, index=False)
            case ".jsonl":
                place.frame().to_json(part, orient="records", lines=True, date_format="iso")
            case ".parquet":
                import pyarrow.parquet as pq

                pq.write_table(place.table(), part)
    console.print(f"written to {out}", soft_wrap=True)


@app.command()
@switched
def plot(
    store: StorePath,
    out: Annotated[Path, typer.Argument(help="picture to write (*.png, *.pdf, *.svg)")],
    value: Annotated[str, typer.Option(help="result to show")] = "",
    x: Annotated[str, typer.Option(help="column along x")] = "",
    y: Annotated[str, typer.Option(help="column along y: a heat map")] = "",
    by: Annotated[str, typer.Option(help="a line for each of its values")] = "",
    pair: Annotated[
        list[str] | None, typer.Option("--pair", help="column of a picture of pairs; repeat")
    ] = None,
    force: Force = False,
) -> None:
    """Draw a sweep: --x --y --value (heat map), --x --value [--by] (lines), or --pair twice or
    more."""
    from trajopt.report.sweeps import draw

    require_free("out", out, force)

    draw(store, out, value=value, x=x, y=y, by=by, pair=pair)
    console.print(f"written to {out}", soft_wrap=True)


def old_rows(rerun: bool, keep_old: bool) -> Old | None:
    """What to do with cases whose rows other code made. Raises ArgumentError for both at once."""
    if rerun and keep_old:
        raise ArgumentError("--rerun", "--keep-old", "one of the two")
    return "rerun" if rerun else "keep" if keep_old else None


def _go(
    plan: SweepPlan, store: Path, engine: Engine, *, retry_failed: bool, old: Old | None
) -> None:
    from trajopt.sweeps.source import code_of
    from trajopt.sweeps.store import open_store
    from trajopt.sweeps.sweeps import OldCodeError, missing, sweep

    place, code = open_store(store), code_of(plan.run, plan.code)
    try:
        left = len(missing(plan.table, place, code, retry_failed=retry_failed, old=old))
    except OldCodeError as error:
        if not sys.stdin.isatty():
            raise
        console.print(str(error))
        answer = ""
        while answer not in ("rerun", "keep", "stop"):
            answer = typer.prompt("rerun, keep or stop")
        if answer == "stop":
            raise typer.Exit(2) from None
        old = cast("Old", answer)
        left = len(missing(plan.table, place, code, retry_failed=retry_failed, old=old))
    console.print(
        f"{plan.title}: {len(plan.table)} cases, {left} to run on {engine.name}; store {store}"
    )
    with leaving(_KEPT), _bar(left) as report:
        sweep(
            plan.table,
            plan.run,
            executor=engine,
            store=place,
            time_limit=plan.time_limit,
            memory_limit=plan.memory_limit,
            code=plan.code,
            retry_failed=retry_failed,
            old=old,
            source=plan.text,
            progress=report,
        )
    console.print(", ".join(f"{count} {name}" for name, count in place.counts().items()))
    _print_errors(place)


def _dry_run(plan: SweepPlan, workers: int) -> None:
    """Count, first cases, and the time that three sampled cases take, in a store that is thrown
    away."""
    import tempfile

    import numpy as np

    from trajopt.sweeps.executors import available_processors
    from trajopt.sweeps.sweeps import sweep

    console.print(f"{plan.title}: {len(plan.table)} cases")
    first = plan.table.take(np.arange(min(_SHOWN, len(plan.table)))).rows()
    from rich.table import Table

    shown = Table("case", *plan.table.columns)
    for case in first:
        shown.add_row(
            case.id[:12],
            *(f"{v:.6g}" if isinstance(v, float) else str(v) for v in case.values.values()),
        )
    console.print(shown)
    with tempfile.TemporaryDirectory() as folder, leaving("interrupted"):
        store = sweep(
            plan.table.sampled(),
            plan.run,
            executor=1,
            store=Path(folder) / "trial",
            time_limit=plan.time_limit,
            memory_limit=plan.memory_limit,
            code=plan.code,
        )
        frame = store.frame(["run_seconds", "error", "error_message"])
    seconds = float(frame["run_seconds"].median())
    count = workers or available_processors()
    console.print(
        f"three sampled cases took {', '.join(f'{s:.3g} s' for s in frame['run_seconds'])}; "
        f"about {_duration(seconds * len(plan.table) / count)} on {count} workers"
    )
    for _, row in frame[frame["status"] != "done"].iterrows():
        console.print(
            words(
                (row["status"], "red"),
                f" {row['case'][:12]}: {row['error']}: {row['error_message']}",
            )
        )


def _print_errors(store: Store) -> None:
    frame = store.frame(["error", "error_message"])
    failed = frame[frame["status"] != "done"]
    if failed.empty:
        return
    from rich.table import Table

    shown = Table(
        "cases", "error", "first message", "first case", title="not done", title_justify="left"
    )
    for error, group in failed.groupby("error"):
        message, case = group["error_message"].iloc[0], group["case"].iloc[0]
        shown.add_row(str(len(group)), str(error), str(message)[:100], case[:12])
    console.print(shown)


def _default_store(sweep_file: Path) -> Path:
    return Path("out") / "sweeps" / sweep_file.stem


def _engine(name: str, workers: int, host: str, tls: Path | None) -> Engine:
    from trajopt.sweeps import dask_engines
    from trajopt.sweeps import executors as engines

    if tls is not None and "dask" not in name and not name.startswith("tls://"):
        raise ArgumentError(
            "--tls", str(tls), "an engine of Dask: dask, dask-slurm or tls://host:port"
        )
    if host not in ("127.0.0.1", "::1", "localhost") and tls is None:
        told = f"--host {host}: whoever reaches it can run code as you, as Dask asks no password; see --tls"
        from trajopt.report.console import PlainConsole

        PlainConsole(stderr=True).print(f"warning: {told}")

    count = workers or engines.available_processors()
    if name == "processes":
        return engines.processes(count)
    if name == "dask":
        return dask_engines.dask_local(count, host=host, tls=tls)
    if name == "dask-slurm":
        return dask_engines.dask_slurm(count, host=host, tls=tls)
    if "://" in name:
        return dask_engines.dask_at(name, tls=tls)
    raise ArgumentError("engine", name, "processes, dask, dask-slurm, tcp:// or tls://host:port")


@contextmanager
def _bar(total: int) -> Iterator[Callable[[Progress], None]]:
    """Progress with rate and remaining time on a terminal; a line a minute where there is none."""
    from rich import progress as bars

    from trajopt.report.console import PlainConsole

    bar = bars.Progress(
        bars.TextColumn("{task.fields[failed]}"),
        bars.BarColumn(),
        bars.MofNCompleteColumn(),
        bars.TextColumn("{task.fields[rate]}"),
        bars.TimeElapsedColumn(),
        console=PlainConsole(stderr=True),
        disable=not sys.stderr.isatty(),
    )
    task: Any = bar.add_task("", total=total, failed="", rate="")
    said = [time.monotonic()]

    def report(now: Progress) -> None:
        failed = now.finished - now.counts.get("done", 0)
        rate = now.finished / max(now.seconds, 1e-9)
        left = now.remaining_seconds
        text = f"{rate:.3g} cases/s, {_duration(left) if left is not None else '?'} left"
        bar.update(
            task, completed=now.finished, failed=f"{failed} failed" if failed else "", rate=text
        )
        if not sys.stderr.isatty() and time.monotonic() - said[0] > 60:
            said[0] = time.monotonic()
            print(
                f"{now.finished} of {now.total}, {failed} failed, {text}",
                file=sys.stderr,
                flush=True,
            )

    with bar:
        yield report


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 5400 else f"{seconds / 3600:.3g} h"
