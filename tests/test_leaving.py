"""Ctrl-C once and twice, on processes and on Dask; compile caches and stores that cannot be
written; names that would escape from a folder or a terminal."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.sweeps.crashes import ROOT, cases, descendants
from tests.sweeps.run_functions import Case, cheap
from trajopt.cli import app
from trajopt.errors import ProblemError, TrajoptError, printable
from trajopt.report.console import PlainConsole
from trajopt.report.words import words
from trajopt.sweeps.store import StoreError, open_store
from trajopt.sweeps.sweeps import sweep

RUN = "from trajopt.cli import main; main()"


def started(*arguments: str, ready: Path) -> subprocess.Popen[str]:
    """A command in a process group of its own, when the first cases are stored in ``ready``."""
    process = subprocess.Popen(
        [
            sys.executable,
            "-c",
            "import signal; signal.signal(2, signal.default_int_handler)\n" + RUN,
            *arguments,
        ],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    for _ in range(1200):
        if list(ready.glob("parts/*.parquet")) or process.poll() is not None:
            break
        time.sleep(0.05)
    return process


@pytest.mark.parametrize("engine", ["processes", pytest.param("dask", marks=pytest.mark.slow)])
@pytest.mark.parametrize("times", [1, 2])
def test_ctrl_c(tmp_path: Path, engine: str, times: int) -> None:
    file, place = tmp_path / "s.toml", tmp_path / "store"
    file.write_text('run = "tests.sweeps.run_functions:waiting"\n[axes.x]\nrange = [0, 199, 200]\n')
    process = started(
        *("sweep", "run", str(file), "--store", str(place), "--engine", engine, "--workers", "2"),
        ready=place,
    )
    below = descendants(process.pid)
    clock = time.monotonic()
    os.killpg(process.pid, signal.SIGINT)
    if times == 2:
        time.sleep(0.2)
        os.killpg(process.pid, signal.SIGINT)
    process.wait(timeout=60)
    assert time.monotonic() - clock < (2.0 if times == 2 else 25.0)
    assert process.returncode == 130
    _, told = process.communicate(timeout=60)
    lines = told.splitlines()[: 1 if times == 2 else None]  # then a warning of multiprocessing's
    assert lines == [
        "interrupted: finished cases are kept, the same command goes on; once more: at once"
    ]
    clock = time.monotonic()
    while time.monotonic() - clock < 20 and any(Path(f"/proc/{p}").exists() for p in below):
        time.sleep(0.1)
    assert not [p for p in below if Path(f"/proc/{p}").exists()]
    assert set(open_store(place).counts()) == {"done"}
    if times == 1:
        assert open_store(place).runs()[-1]["state"] == "interrupted"


def test_compile_caches_that_cannot_be_written() -> None:
    """Root may write anywhere: numba is told that it found no place."""
    pytest.importorskip("numba", reason="numba is not installed")
    program = (
        "import numba.core.caching as c\n"
        "for k in vars(c).values():\n"
        "    if hasattr(k, '_locator_classes'): k._locator_classes = []\n"
        "from trajopt.timing.compiled import load_kernel; load_kernel(); print('compiled')"
    )
    done = subprocess.run(
        [sys.executable, "-c", program],
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.stdout, done.stderr) == ("compiled\n", "")


def test_a_store_that_cannot_be_written_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = sweep(cases(4), cheap, executor=1, store=tmp_path / "store")
    plain = open

    def read_only(file: object, mode: str = "r", **options: object) -> object:
        if "w" in mode:
            raise OSError(errno.EROFS, "Read-only file system", str(file))
        return plain(file, mode, **options)  # type: ignore[call-overload]

    monkeypatch.setattr("builtins.open", read_only)
    assert open_store(store.path, create=False).counts() == {"done": 4}
    assert CliRunner().invoke(app, ["sweep", "status", str(store.path)]).exit_code == 0
    with pytest.raises(StoreError, match="Read-only file system"):
        sweep(cases(5), cheap, executor=1, store=store)


# -- names and messages appear as they are

NASTY = (
    "[/bold]",
    "[bad]",
    "[red]x",
    ":smile:",
    "\x1b[31mred",
    "a\nb",
    "\a\b",
    "bad [/a/x]",
    "$x$",
)


@pytest.mark.parametrize("text", NASTY)
def test_texts_are_printed_literally(text: str) -> None:
    out = StringIO()
    console = PlainConsole(file=out, width=200)
    console.print(text)
    console.print(words(text, (text, "red")))
    shown = printable(text, "\n\t")
    assert out.getvalue() == f"{shown}\n{shown}{shown}\n"
    assert "\x1b" not in out.getvalue()


@pytest.mark.parametrize("text", NASTY)
def test_errors_are_one_line(text: str) -> None:
    told = str(ProblemError(f"dir/{text}.toml", f"axes.{text}", text, text))
    assert told.isprintable()


def wicked(case: Case) -> dict[str, object]:
    """An error with markup and escapes, or arrays whose names leave a folder."""
    if case["x"] == 0:
        raise ValueError(f"bad [/a/x] {NASTY}\x1b[2J")
    return {"../../escaped": np.ones(3), "/absolute": np.ones((2, 2)), "y[/b]": 1.0}


def test_nothing_breaks_the_terminal_or_leaves_the_folder(tmp_path: Path) -> None:
    file, store, out = tmp_path / "s.toml", tmp_path / "in" / "store", tmp_path / "in" / "a" / "out"
    file.write_text(
        'title = "[/bold]\\u001b[2J"\nrun = "tests.test_leaving:wicked"\n[axes.x]\nvalues = [0, 1]'
    )

    def run(*arguments: str) -> str:
        done = CliRunner().invoke(app, list(arguments), catch_exceptions=False)
        assert done.exit_code == 0
        assert "\x1b" not in done.output
        return done.output

    assert "[/bold]\\x1b[2J" in run(
        "sweep", "run", str(file), "--store", str(store), "--workers", "1"
    )
    rows = open_store(store).frame().set_index("x")["case"]
    assert "bad [/a/x]" in run("sweep", "show", str(store), rows[0])
    assert "../../escaped" in run("sweep", "show", str(store), rows[1])
    run("sweep", "status", str(store))
    before = {p for p in tmp_path.rglob("*") if out not in p.parents}
    run("report", str(store), rows[1], "--out", str(out))
    assert {p for p in tmp_path.rglob("*") if out not in p.parents} == before | {out, out.parent}
    assert not Path("/absolute.csv").exists()
    assert len(list(out.glob("*.csv"))) == 2
    assert not list(out.glob("*.part*"))


def test_errors_of_commands_are_one_line(tmp_path: Path) -> None:
    for name in ("[/x].toml", "a\nb.toml", "\x1b[2J.toml", "nul\0.toml"[:3]):
        with pytest.raises(TrajoptError) as told:
            CliRunner().invoke(app, ["sweep", "run", str(tmp_path / name)], catch_exceptions=False)
        assert str(told.value).isprintable()
