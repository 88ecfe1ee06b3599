"""The command line. Exit codes: 0 for a result that holds, 1 for one that does not, 2 for unusable
input, 130 where Ctrl-C or SIGTERM ended it."""

from __future__ import annotations

import importlib
import sys
import traceback
from typing import Annotated

import typer

import trajopt
from trajopt.cli import bench, examples, paths, robot, search, sweep, view
from trajopt.cli.shared import INTERRUPTED, console, leaving, switched
from trajopt.errors import TrajoptError

app = typer.Typer(
    rich_markup_mode=None,  # rich takes twice as long to load as all the rest
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
# modules of systems that bring commands of their own (``COMMANDS``): one line a system
SYSTEMS = ("trajopt.systems.smdw.commands",)
TELLING = {search.solve, search.validate, paths.explain}  # with --json
for command in (
    search.solve,
    search.validate,
    *(command for name in SYSTEMS for command in importlib.import_module(name).COMMANDS),
    paths.explain,
    paths.export,
    paths.compare,
    search.schema,
    robot.robot,
    examples.examples,
    sweep.report,
    view.view,
):
    app.command()(switched(command, tells=command in TELLING))
app.add_typer(bench.app, name="bench")
app.add_typer(sweep.app, name="sweep")

UNUSABLE = 2


def _version(asked: bool) -> None:
    if asked:
        typer.echo(f"trajopt {trajopt.__version__}")
        raise typer.Exit


@app.callback()
def _first(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="say it, and end")
    ] = False,
) -> None:
    """Plan, time and check motions of wheeled ground robots."""


def main() -> None:
    """Entry point: errors of the package become one line on standard error."""
    try:
        with leaving("interrupted"):
            app(prog_name="trajopt")
    # OSError: a folder that cannot be made, a full disk: the message names the file
    except (TrajoptError, OSError) as error:
        from trajopt.report.console import PlainConsole

        if console.verbose:
            traceback.print_exc()
        PlainConsole(stderr=True, soft_wrap=True).print(f"error: {error}")
        sys.exit(UNUSABLE)
    except KeyboardInterrupt:
        sys.exit(INTERRUPTED)
