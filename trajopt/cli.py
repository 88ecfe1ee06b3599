"""The command line: ``trajopt solve | validate | schema`` and the commands of the other rooms.

Exit codes: 0 for a result that holds, 1 for one that does not, 2 for input that cannot be used.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from trajopt.errors import ArgumentError, TrajoptError

if TYPE_CHECKING:
    from trajopt.optimize.base import Budget
    from trajopt.pipeline import Solution

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False,
                  help="Plan, time and check motions of wheeled ground robots.")
console = Console()

HOLDS, FAULTY, UNUSABLE = 0, 1, 2

ProblemFile = Annotated[Path, typer.Argument(help="problem file (*.toml)", show_default=False)]
Overrides = Annotated[list[str] | None, typer.Option(
    "--set", help="change a key of the problem, e.g. --set goal.wheels=[0,0,0,0]", show_default=False)]
Out = Annotated[Path | None, typer.Option("--out", help="folder for trajectory, summary and pictures")]


@app.command()
def solve(problem: ProblemFile,
          optimizer: Annotated[str, typer.Option(help="auto or the name of an optimizer")] = "auto",
          seed: Annotated[int, typer.Option(help="seed of everything random")] = 0,
          out: Out = None,
          set_: Overrides = None,
          evaluations: Annotated[int | None, typer.Option(help="budget of objective evaluations")] = None,
          seconds: Annotated[float | None, typer.Option(help="budget of wall-clock seconds")] = None,
          target: Annotated[float | None, typer.Option(help="stop when the cost is this low")] = None,
          x0: Annotated[Path | None, typer.Option(help="start from a saved solution (its folder)")] = None,
          pictures: Annotated[bool, typer.Option(help="draw pictures into the folder")] = True) -> None:
    """Search control points, time the path, and write what was found."""
    from trajopt.pipeline import solve as solve_problem
    from trajopt.problem import load_problem
    from trajopt.report.tables import solution_table

    loaded = load_problem(problem, _overrides(set_))
    budget = _budget(evaluations, seconds, target)
    start = None
    if x0 is not None:
        from trajopt.report.run_folder import read_solution

        start = read_solution(x0).search.x
    with _Bar(f"{optimizer}", budget.evaluations) as bar:
        solution = solve_problem(loaded, optimizer=optimizer, seed=seed, budget=budget, x0=start, progress=bar.update)
    console.print(solution_table(solution))
    if out is not None:
        _write(solution, out, seed, pictures)
    if not solution.holds:
        for fault in solution.faults:
            console.print(f"[red]does not hold:[/red] {fault}")
        raise typer.Exit(FAULTY)


@app.command()
def validate(folder: Annotated[Path, typer.Argument(help="folder written by solve --out")],
             engine: Annotated[str, typer.Option(help="pybullet or mujoco")] = "pybullet",
             pictures: Annotated[bool, typer.Option(help="draw pictures into the folder")] = True) -> None:
    """Drive a saved solution in a physics engine with real rollers and measure the deviation."""
    from trajopt.pipeline import validate as validate_trajectory
    from trajopt.report.run_folder import read_solution, write_validation
    from trajopt.report.tables import validation_table

    solution = read_solution(folder)
    if solution.trajectory is None:
        raise ArgumentError("folder", str(folder), "a solution with a trajectory; this one has none: "
                            + solution.status)
    with _Bar(f"{engine}", None):
        report = validate_trajectory(solution.trajectory, solution.problem, engine=engine, picture=pictures)
    console.print(validation_table(report))
    write_validation(report, folder)
    if pictures:
        from trajopt.report.pictures import save_physics_picture

        save_physics_picture(solution, report, folder)
    console.print(f"written to {folder}")


@app.command()
def schema(out: Annotated[Path | None, typer.Option(help="file to write; standard output without it")] = None) -> None:
    """Print the JSON schema of problem files, for editors."""
    from trajopt.problem import problem_schema

    if out is None:
        sys.stdout.write(problem_schema())
    else:
        out.write_text(problem_schema(), encoding="utf-8")


def _write(solution: Solution, out: Path, seed: int, pictures: bool) -> None:
    from trajopt.report.run_folder import write_solution

    write_solution(solution, out, seed=seed, command=" ".join(sys.argv))
    if pictures:
        from trajopt.report.pictures import save_pictures

        save_pictures(solution, out)
    console.print(f"written to {out}")


def _overrides(items: list[str] | None) -> dict[str, Any]:
    """Dotted keys and their values, each value read as TOML, or as a bare string where it is none."""
    found: dict[str, Any] = {}
    for item in items or []:
        key, sign, text = item.partition("=")
        if not sign or not key:
            raise ArgumentError("--set", item, "key=value, e.g. spline.duration=3.5")
        try:
            found[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            found[key.strip()] = text.strip()
    return found


def _budget(evaluations: int | None, seconds: float | None, target: float | None) -> Budget:
    from trajopt.optimize.base import DEFAULT_EVALUATIONS, Budget

    if evaluations is None and seconds is None:
        evaluations = DEFAULT_EVALUATIONS
    return Budget(evaluations, seconds, target)


class _Bar:
    """Progress on a terminal; nothing when the output is piped."""

    def __init__(self, name: str, total: int | None) -> None:
        self._progress = Progress(TextColumn("{task.description}"), BarColumn(), TextColumn("{task.fields[best]}"),
                                  TimeElapsedColumn(), console=Console(stderr=True), transient=True,
                                  disable=not sys.stderr.isatty())
        self._task = self._progress.add_task(name, total=total, best="")

    def __enter__(self) -> _Bar:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def update(self, evaluations: int, best: float) -> None:
        self._progress.update(self._task, completed=evaluations, best=f"best {best:.3g}")


def main() -> None:
    """Entry point: errors of the package become one line on standard error."""
    try:
        app()
    except TrajoptError as error:
        Console(stderr=True, soft_wrap=True).print(f"[red]error:[/red] {error}", markup=True, highlight=False)
        sys.exit(UNUSABLE)
    except KeyboardInterrupt:
        Console(stderr=True).print("interrupted")
        sys.exit(130)


if __name__ == "__main__":
    main()
