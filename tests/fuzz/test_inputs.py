"""Inputs that once hung, crashed or were believed: each is told in one line, at once."""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from tests.fuzz.kinds import ROOT
from trajopt.cli import app
from trajopt.control.commands import LOG_COLUMNS, compare_log
from trajopt.errors import TrajoptError
from trajopt.files import LARGEST_TABLE, read_table
from trajopt.pipeline import solve
from trajopt.problem import load_problem
from trajopt.robots.robot import Robot
from trajopt.sweeps.sweepfile import load_sweep
from trajopt.timing.grid import split
from trajopt.world.mesh import load_mesh

PROBLEMS = ROOT / "problems"
READERS: tuple[Callable[[Any], Any], ...] = (load_problem, load_sweep, Robot.load)


def told(call: Callable[..., Any], *arguments: Any) -> str:
    """What the error says, in one line and soon."""
    started = time.process_time()
    with pytest.raises(TrajoptError) as error:
        call(*arguments)
    assert time.process_time() - started < 2.0
    text = str(error.value)
    assert text.isprintable()
    assert len(text) < 1000
    return text


@pytest.mark.parametrize(
    "text",
    [
        "title = " + "[" * 6_000 + "]" * 6_000,
        "title = " + "{a = " * 3_000 + "1" + "}" * 3_000,
        ".".join(["a"] * 20_000) + " = 1",
        "[" + ".".join(["a"] * 20_000) + "]",
        "[" + " . ".join(['"a b"'] * 20_000) + "]",
        "title = " + "9" * 5_000,
        "ground.friction = " + "9" * 4_000,
        "#" * 1_000_001,
        "title = '\0'",
        "a = 1\n" * 2,
        "\ufeff[[[",
    ],
    ids=range(11),
)
def test_texts_that_no_file_holds(tmp_path: Path, text: str) -> None:
    file = tmp_path / "x.toml"
    file.write_text(text)
    for read in READERS:
        assert str(file) in told(read, file)


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    (tmp_path / "loop").symlink_to(tmp_path / "loop")
    (tmp_path / "latin").write_bytes(b"title = '\xe4'")
    os.mkfifo(tmp_path / "pipe")
    names = ("", "loop", "latin", "pipe", "missing", "nul\0", "x" * 300, "/dev/zero", "/dev/null")
    for name in names:
        for read in READERS:
            told(read, tmp_path / name)
        told(read_table, tmp_path / name, ("t",))
    for value in (3, None, b"x", [1], True, object()):
        for read in READERS:
            told(read, value)


def test_large_files_are_not_read(tmp_path: Path) -> None:
    file = tmp_path / "large"
    with file.open("wb") as stream:
        stream.truncate(2 * LARGEST_TABLE)  # sparse
    for read in READERS:
        assert "larger than 1,000,000 bytes" in told(read, file)
    assert "larger than 100,000,000 bytes" in told(read_table, file, ("t",))


@pytest.mark.parametrize(
    ("file", "key", "value"),
    [
        ("smdw/scenario_1_forward35", "space.x", [-1e300, 3]),
        ("smdw/scenario_1_forward35", "space.x", [-(10**400), 3]),
        ("smdw/table_5_3", "robot.wheels.all.radius", 1e-300),
        ("smdw/table_5_3", "robot.body.cog", [1e300, 0, 0]),
        ("smdw/step_5cm", "robot.wheels.all.double.minor_radius", 5e-324),
        ("smdw/table_5_3_1s", "actuator.duration", 5e-324),
        ("smdw/table_5_3", "ground.friction", "0.5"),
        ("smdw/table_5_3", "ground.friction", True),
        ("smdw/table_5_3", "a." * 20_000 + "b", 1),
        ("smdw/table_5_3", "title", object()),
        ("smdw/table_5_3", "goal.pose", [[[[]]]]),
    ],
)
def test_values_that_no_problem_has(file: str, key: str, value: Any) -> None:
    told(load_problem, PROBLEMS / f"{file}.toml", {key: value})


@pytest.mark.parametrize("overrides", [3, "a", [1], {3: 1}, object()])
def test_changes_that_are_none(overrides: Any) -> None:
    told(load_problem, PROBLEMS / "smdw/table_5_3.toml", overrides)
    told(Robot.load, PROBLEMS / "smdw/table_5_3.toml", overrides)


@pytest.mark.parametrize(
    ("rows", "told_row"),
    [
        (["t,x,y,yaw,v", "0,0,0,0,0", "1,1,0,0,nan"], "row 3"),
        (["t,x,y,yaw,v", "0,0,0,0,0", "1,1,0"], "row 3"),
        (["t,x,y,yaw,v", "0,0,0,0,0", "1,1,0,0,"], "row 3"),
        (["# a robot", "t,x,y,yaw,v", "0,0,0,0,1_0"], "row 3"),
        (["t,x,y,yaw,v", "0,0,0,0,0", "0,1,0,0,1"], "t = 0.0"),
        (["t,x,y,yaw,v", "-1,0,0,0,0", "0,1,0,0,1"], "t = -1.0"),
        (["t,x,y,yaw,v"], "0 rows"),
        (["t,x,y,yaw", "0,0,0,0"], "its columns are t, x, y, yaw"),
        (["t,x,y,yaw,v,v", "0,0,0,0,0,1"], "its columns are"),
        ([], "its columns are none"),
        (['t,x,y,yaw,v,"', "0,0,0,0,0"], "row"),
    ],
)
def test_logs_are_told_by_file_and_row(tmp_path: Path, rows: list[str], told_row: str) -> None:
    trajectory = solve(load_problem(PROBLEMS / "car" / "lane_change.toml")).trajectory
    file = tmp_path / "log.csv"
    file.write_text("\n".join(rows))
    text = told(compare_log, trajectory, file)
    assert str(file) in text
    assert told_row in text


def test_a_title_is_printed_as_it_is(tmp_path: Path) -> None:
    text = (PROBLEMS / "car" / "lane_change.toml").read_text()
    title = next(line for line in text.splitlines() if line.startswith("title"))
    file = tmp_path / "[bold].toml"
    file.write_text(text.replace(title, 'title = "[/bold]\\u001b[2J :smile:"'))
    done = CliRunner().invoke(app, ["solve", str(file), "--no-pictures"], catch_exceptions=False)
    assert done.exit_code == 0
    assert "[/bold]\\x1b[2J :smile:" in done.output
    assert "\x1b" not in done.output


def test_numbers_and_names_that_damaged_files_hold(tmp_path: Path) -> None:
    log = tmp_path / "log.csv"
    log.write_text("t,x,y,yaw,v\n0,0,0,0,0\n1,1e200,0,0,0\n")
    text = told(read_table, log, LOG_COLUMNS)
    assert "row 3" in text
    assert "beyond 1e+09" in text
    mesh = tmp_path / "a.obj"
    for corner in ("9" * 400, "[" * 3000):
        mesh.write_text(f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {corner}\n")
        assert "triangles" in told(load_mesh, mesh, 0.1)
    sweep = tmp_path / "sweep.toml"
    sweep.write_text(
        'run = "tests.sweeps.run_functions:cheap"\n[axes.x]\nvalues = [1]\n[solve]\ny = inf\n'
    )
    assert "solve" in told(load_sweep, sweep)


def test_a_robot_without_a_rolling_wheel_has_no_turning_length() -> None:
    balls = [
        {
            "name": f"ball-{i}",
            "kind": "spherical",
            "position": at,
            "radius": 0.05,
            "width": 0.05,
            "mass": 0.1,
        }
        for i, at in enumerate([[0.2, 0.1], [0.2, -0.1], [-0.2, 0.0]])
    ]
    body = {"mass": 5.0, "cog": [0.0, 0.0, 0.1], "chassis": [0.4, 0.3, 0.1], "clearance": 0.05}
    machine = Robot.of({"name": "balls", "body": body, "wheels": balls})
    with pytest.raises(TrajoptError, match="at least one wheel"):
        _ = machine.turning_length


def test_refinement_ends_before_memory_does() -> None:
    u = np.linspace(0.0, 1.0, 60_001)
    assert len(split(u, np.arange(60_000) < 10, 3, 100_000)) == 60_021
    with pytest.raises(TrajoptError, match="at most 100000 gridpoints"):
        split(u, np.ones(60_000, dtype=bool), 3, 100_000)
