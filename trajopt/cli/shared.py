"""What several commands need: the console, options read as TOML, the progress bar."""

from __future__ import annotations

import functools
import inspect
import logging
import os
import signal
import sys
import threading
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

from trajopt.errors import ArgumentError

if TYPE_CHECKING:
    from rich.table import Table

    from trajopt.control.approach import Mode


class _Output:
    """Standard output: tables and lines, or with ``--json`` facts alone, or with ``--quiet``
    nothing. rich is loaded when something is printed: it takes as long as a short command."""

    lines, as_json, verbose = True, False, False

    def print(self, *parts: Any, **options: Any) -> None:
        if not self.lines:
            return
        if self._made is None:
            from trajopt.report.console import PlainConsole

            # tables keep their shape when piped
            self._made = PlainConsole(width=None if sys.stdout.isatty() else 120)
        self._made.print(*parts, **options)

    def facts(self, found: Mapping[str, Any]) -> None:
        """One object of JSON, where that is asked for; numbers that are not finite are null."""
        if self.as_json:
            from trajopt.report.files import json_text

            sys.stdout.write(json_text(found))

    _made: Any = None


console = _Output()


_SWITCHES = {
    "quiet": typer.Option("--quiet", "-q", help="print errors only"),
    "verbose": typer.Option("--verbose", "-v", help="tell more, and where errors come from"),
    "as_json": typer.Option("--json", help="print the result as JSON, and nothing else"),
}


def switched(command: Callable[..., None], *, tells: bool = False) -> Callable[..., None]:
    """The command with --quiet and --verbose, and with --json where it tells facts."""
    names = ["quiet", "verbose", *(["as_json"] if tells else [])]

    @functools.wraps(command)
    def run(**given: Any) -> None:
        asked = {name: given.pop(name) for name in names}
        console.as_json = bool(asked.get("as_json"))
        console.lines = not (asked["quiet"] or console.as_json)
        console.verbose = asked["verbose"]
        if console.verbose:
            logging.basicConfig(level=logging.INFO, format="%(message)s")
        elif console.lines and sys.stderr.isatty():
            told = logging.getLogger("trajopt.kernels")  # that it compiles, which takes long
            told.setLevel(logging.INFO)
            if not told.handlers:  # a process may run several commands
                told.addHandler(logging.StreamHandler())
        command(**given)

    hints = get_type_hints(command, include_extras=True)
    own = [
        parameter.replace(annotation=hints[name])
        for name, parameter in inspect.signature(command).parameters.items()
    ]
    kind = inspect.Parameter.KEYWORD_ONLY
    more = [
        inspect.Parameter(name, kind, default=False, annotation=Annotated[bool, _SWITCHES[name]])
        for name in names
    ]
    # typer reads what a command takes from its signature
    run.__signature__ = inspect.Signature([*own, *more])  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in [*own, *more]}
    return run


FAULTY = 1
INTERRUPTED = 130  # as shells say it of Ctrl-C
# What can be switched on in a physics check; None drives the planned wheel speeds.
CONTROLS: dict[str, Mode | None] = {
    "none": None,
    "servo": "wheel servo",
    "pose": "pose",
    "pose-and-phase": "pose and phase",
}

ProblemFile = Annotated[Path, typer.Argument(help="problem file (*.toml)", show_default=False)]
ControlOption = Annotated[
    str,
    typer.Option(
        "--control",
        help="none (planned wheel speeds), servo (planned wheel angles), pose, or pose-and-phase",
    ),
]
FormatOption = Annotated[
    str | None, typer.Option("--format", help="of pictures: png (default), pdf or svg")
]
Force = Annotated[bool, typer.Option("--force", help="write over a file that is there")]
Overrides = Annotated[
    list[str] | None,
    typer.Option(
        "--set",
        help="change a key of the problem, e.g. --set goal.wheels=[0,0,0,0]",
        show_default=False,
    ),
]


def require_free(name: str, file: Path | None, force: bool) -> None:
    """Raises ArgumentError where ``file`` is there and shall not be written over."""
    if file is not None and file.exists() and not force:
        raise ArgumentError(name, str(file), "a file that is not there yet, or --force")


def picture_kind(pictures: bool, kind: str | None) -> str | None:
    """The format of pictures, None where there shall be none. Raises ArgumentError for another format, or one beside
    --no-pictures."""
    from trajopt.report.files import FORMATS

    if kind is not None and (kind not in FORMATS or not pictures):
        raise ArgumentError("--format", kind, f"one of {', '.join(FORMATS)}, without --no-pictures")
    return (kind or "png") if pictures else None


def simple_table(**options: Any) -> Table:
    """A table without borders."""
    from rich import box
    from rich.table import Table

    return Table(box=box.SIMPLE_HEAD, pad_edge=False, **options)


def overrides(items: list[str] | None) -> dict[str, Any]:
    """Dotted keys and their values, each value read as TOML, or as a bare string where it is
    none."""
    found: dict[str, Any] = {}
    for item in items or []:
        key, sign, text = item.partition("=")
        if not sign or not key:
            raise ArgumentError("--set", item, "key=value, e.g. limits.speed=0.5")
        try:
            found[key.strip()] = tomllib.loads(f"value = {text}")["value"]
        except tomllib.TOMLDecodeError:
            found[key.strip()] = text.strip()
    return found


@contextmanager
def leaving(told: str) -> Iterator[None]:
    """Ctrl-C or SIGTERM says ``told`` and raises KeyboardInterrupt; a second one ends this process
    at once, whatever it waits for (processes that work for it notice, and end too)."""
    if threading.current_thread() is not threading.main_thread():
        yield  # only there can signals be caught
        return
    left = False

    def leave(number: int, _: object) -> None:
        nonlocal left
        cursor = b"\x1b[?25h" if sys.stderr.isatty() else b""  # a progress bar has hidden it
        if left:
            os.write(2, cursor)
            os._exit(128 + number)
        left = True
        os.write(2, cursor + f"{told}\n".encode())
        raise KeyboardInterrupt

    numbers = [
        n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is not signal.SIG_IGN
    ]
    before = {number: signal.signal(number, leave) for number in numbers}
    try:
        yield
    finally:
        if not left:
            for number, handler in before.items():
                signal.signal(number, handler)


def control_mode(name: str) -> Mode | None:
    """The controller called ``name`` on the command line. Raises ArgumentError for another name."""
    if name not in CONTROLS:
        raise ArgumentError("--control", name, "one of " + ", ".join(CONTROLS))
    return CONTROLS[name]


class Bar:
    """Progress on a terminal; nothing when the output is piped."""

    def __init__(self, name: str, total: int | None) -> None:
        self._progress: Any = None
        if not sys.stderr.isatty():
            return
        from rich import progress as bars

        from trajopt.report.console import PlainConsole

        self._progress = bars.Progress(
            bars.TextColumn("{task.description}"),
            bars.BarColumn(),
            bars.TextColumn("{task.fields[best]}"),
            bars.TimeElapsedColumn(),
            bars.TimeRemainingColumn(),
            console=PlainConsole(stderr=True),
            transient=True,
        )
        self._task = self._progress.add_task(name, total=total, best="")

    def __enter__(self) -> Bar:
        if self._progress is not None:
            self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def count(self, done: int, total: int | None = None) -> None:
        """Show how much is done, of what (None: as before)."""
        if self._progress is not None:
            self._progress.update(self._task, completed=done, total=total)

    def update(self, evaluations: int, best: float) -> None:
        """Show how many evaluations are used and the best cost so far."""
        if self._progress is not None:
            self._progress.update(self._task, completed=evaluations, best=f"best {best:.3g}")
