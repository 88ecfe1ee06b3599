"""The commands ``trajopt bench ...``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from trajopt.cli.shared import Bar, console, switched
from trajopt.cli.sweep import KeepOld, Rerun, old_rows

RUN = "run"
BEST_KNOWN = Path("trajopt") / "bench" / "best_known.json"  # in a checkout


class _FileFirst(typer.core.TyperGroup):
    """``trajopt bench FILE`` is ``trajopt bench run FILE`` (typer knows default commands only this
    way)."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in self.commands and not args[0].startswith("-"):
            args = [RUN, *args]
        return super().parse_args(ctx, args)


app = typer.Typer(
    cls=_FileFirst,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    help="Compare optimizers on many problems, resumable, with profiles and a page of answers.",
)

BenchFile = Annotated[
    Path, typer.Argument(help="bench file or problem file (*.toml)", show_default=False)
]
StoreOption = Annotated[
    Path | None, typer.Option("--store", help="rows; default: out/bench/<name of the file>")
]
Plugins = Annotated[
    list[Path] | None, typer.Option("--plugin", help="Python file with own OPTIMIZERS or PROBLEMS")
]


@app.command(RUN)
@switched
def run(
    bench_file: BenchFile,
    store: StoreOption = None,
    plugin: Plugins = None,
    optimizer: Annotated[
        list[str] | None, typer.Option(help="another set of optimizers; repeat it for several")
    ] = None,
    seeds: Annotated[int | None, typer.Option(help="of each optimizer that draws numbers")] = None,
    evaluations: Annotated[int | None, typer.Option(help="budget of each search")] = None,
    seconds: Annotated[float | None, typer.Option(help="budget, processor time")] = None,
    jobs: Annotated[int, typer.Option(help="searches at a time")] = 1,
    retry_failed: Annotated[
        bool, typer.Option(help="also run again what hung, raised or died")
    ] = False,
    rerun: Rerun = False,
    keep_old: KeepOld = False,
) -> None:
    """Run every search that has no row yet; started again after any interruption, it goes on.

    A problem file is searched by all optimizers that suit it."""
    from trajopt.bench.comparison import load_bench, run_bench

    changes = {"optimizers": optimizer, "seeds": seeds, "evaluations": evaluations}
    plan = load_bench(bench_file, plugin or (), **changes, seconds=seconds)
    place = store or default_store(bench_file)
    total = len(plan.cases())
    console.print(
        f"{plan.title}: {len(plan.problems)} problems, {len(plan.optimizers)} optimizers, {total} searches; "
        f"rows in {place}"
    )
    with Bar("searches", total) as bar:
        found = run_bench(
            plan,
            place,
            old=old_rows(rerun, keep_old),
            jobs=jobs,
            retry_failed=retry_failed,
            progress=lambda now: bar.count(now.finished, now.total),
        )
    console.print(", ".join(f"{count} {name}" for name, count in found.counts().items()))


@app.command("report")
@switched
def report(
    store: Annotated[
        Path, typer.Argument(help="rows of a benchmark (its directory)", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option("--out", help="folder; default: <store>/report")
    ] = None,
) -> None:
    """Write the page: tables (Markdown, CSV), profiles (PNG, SVG) and the answers in words."""
    from trajopt.bench.page import write_report
    from trajopt.sweeps.store import open_store

    page = write_report(open_store(store, create=False), out or store / "report")
    console.print(f"written to {page}", soft_wrap=True)


@app.command("best")
@switched
def best(
    store: Annotated[
        Path, typer.Argument(help="rows of a benchmark (its directory)", show_default=False)
    ],
    file: Annotated[Path, typer.Option("--file", help="JSON file to merge into")] = BEST_KNOWN,
) -> None:
    """Keep the best costs of a benchmark, with who found them, in the file of best known values."""
    from trajopt.bench.problems import write_best_known
    from trajopt.sweeps.store import open_store

    known = write_best_known(open_store(store, create=False), file)
    console.print(f"{len(known)} problems in {file}")


def default_store(bench_file: Path) -> Path:
    """Where the rows of a bench file go unless told otherwise."""
    return Path("out") / "bench" / bench_file.stem
