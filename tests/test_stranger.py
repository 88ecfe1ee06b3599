"""A stranger's robots, from files in a folder of their own, through every command and both engines:
not a line of Python, and nothing of the repository but the installed package."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from trajopt.robots import builders
from trajopt.robots.description import RobotDescription

LENGTH = 5.0  # m, straight on
ROBOTS = {
    "castor": builders.differential(
        name="castor", mass=14.0, cog=(-0.05, 0.0, 0.12), chassis=(0.40, 0.28, 0.12),
        chassis_place=(-0.10, 0.0), clearance=0.06, track=0.36, radius=0.09, width=0.03,
        wheel_mass=0.7, torque=4.0, castor=(-0.24, 0.0), castor_radius=0.04, castor_trail=0.03,
        castor_mass=0.2,
    ),
    "three-omni": builders.omni(
        name="three-omni", mass=16.0, cog=(0.0, 0.0, 0.10), chassis=(0.26, 0.26, 0.12),
        clearance=0.05, count=3, distance=0.21, radius=0.07, width=0.05, wheel_mass=0.6,
        torque=4.0, rollers=14, roller_radius=0.010,
    ),
    "mecanum": builders.mecanum(
        name="mecanum", mass=26.0, cog=(0.0, 0.0, 0.12), chassis=(0.46, 0.26, 0.12),
        clearance=0.05, wheelbase=0.42, track=0.38, radius=0.08, width=0.06, wheel_mass=1.0,
        torque=6.0, rollers=16, roller_radius=0.0095,
    ),
    "swerve": builders.swerve(
        name="swerve", mass=32.0, cog=(0.0, 0.0, 0.15), chassis=(0.50, 0.40, 0.15),
        clearance=0.06, wheelbase=0.44, track=0.36, radius=0.06, width=0.04, wheel_mass=1.2,
        torque=6.0,
    ),
    "car": builders.car(
        name="car", mass=3.6, cog=(0.16, 0.0, 0.07), chassis=(0.48, 0.14, 0.08), clearance=0.03,
        wheelbase=0.32, track=0.24, radius=0.052, width=0.04, wheel_mass=0.15, torque=1.0,
        steering_range=0.42,
    ),
}  # fmt: skip
PROBLEM = """
title = "Straight on"
[robot]
file = "robot.toml"
[path]
points = [[0.0, 0.0], [2.5, 0.0], [5.0, 0.0]]
[ground]
friction = 0.8
[limits]
speed = 0.5
acceleration = 0.5
deceleration = 0.5
slip = true
tip = true
"""
SWEEP = """
title = "Mass and friction"
problem = "straight.toml"
[axes."robot.body.mass"]
values = [{mass}, {heavier}]
[axes."ground.friction"]
values = [0.05, 0.8]
"""


def toml(value: object) -> str:
    """A value as TOML (JSON's arrays and strings are TOML's)."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {toml(v)}" for key, v in value.items()) + " }"
    return json.dumps(value)


def robot_file(tables: builders.Tables) -> str:
    lines = [f"name = {toml(tables['name'])}", "[body]"]
    lines += [f"{key} = {toml(value)}" for key, value in tables["body"].items()]
    for array in ("wheels", "motors", "steering"):
        for element in tables.get(array, []):
            lines += [f"[[{array}]]", *(f"{key} = {toml(value)}" for key, value in element.items())]
    return "\n".join(lines) + "\n"


def trajopt(folder: Path, *arguments: str) -> str:
    run = subprocess.run(
        [sys.executable, "-c", "from trajopt.cli import main; main()", *arguments],
        cwd=folder, capture_output=True, text=True, timeout=280, check=False,
        env={**os.environ, "COLUMNS": "200"},
    )  # fmt: skip
    assert run.returncode == 0, f"{arguments}: {run.stdout}{run.stderr}"
    return run.stdout


@pytest.fixture(scope="module", params=list(ROBOTS))
def folder(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with robot, problem and sweep, the problem solved."""
    place = tmp_path_factory.mktemp(request.param)
    tables = ROBOTS[request.param]
    assert RobotDescription.model_validate({**tables}).name == request.param
    (place / "robot.toml").write_text(robot_file(tables), encoding="utf-8")
    (place / "straight.toml").write_text(PROBLEM, encoding="utf-8")
    mass = tables["body"]["mass"]
    sweep = SWEEP.format(mass=mass, heavier=1.5 * mass)
    (place / "sweep.toml").write_text(sweep, encoding="utf-8")
    trajopt(place, "solve", "straight.toml", "--out", "run")
    return place


def test_the_robot_is_told(folder: Path) -> None:
    assert "mobility" in trajopt(folder, "robot", "robot.toml", "--out", "view.png")


def test_it_is_driven_with_its_own_sizes(folder: Path) -> None:
    driven = pd.read_csv(folder / "run" / "trajectory.csv")
    assert abs(driven["x_m"].iloc[-1] - LENGTH) < 1e-6
    commands = folder / "commands.csv"
    trajopt(folder, "export", "run", "--out", str(commands))
    columns = pd.read_csv(commands)
    assert len(columns.columns) >= 3  # time, and a column a wheel
    assert columns.iloc[:, 1:].abs().to_numpy().max() <= 0.5 * 1.001  # m/s at the rim


@pytest.mark.parametrize("engine", ["pybullet", "mujoco"])
def test_physics_follows(folder: Path, engine: str) -> None:
    """5 m at half a metre a second: 2 % of the way in both engines."""
    trajopt(folder, "validate", "run", "--engine", engine)
    report = json.loads((folder / "run" / "validation.json").read_text(encoding="utf-8"))
    assert abs(report["along_m"]) <= 0.02 * LENGTH, report
    assert abs(report["across_m"]) <= 0.02 * LENGTH, report
    assert report["contacts"] == []


def test_a_sweep_over_robot_and_scene(folder: Path) -> None:
    trajopt(folder, "sweep", "run", "sweep.toml", "--store", "store")
    trajopt(folder, "sweep", "export", "store", "table.csv")
    table = pd.read_csv(folder / "table.csv")
    assert len(table) == 4
    slow = table.loc[table["ground.friction"] == 0.05, "duration"]
    assert slow.min() > table.loc[table["ground.friction"] == 0.8, "duration"].max()
