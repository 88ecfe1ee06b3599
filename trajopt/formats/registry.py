"""Which formats there are, and the calls that find the module of one."""

from __future__ import annotations

import importlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from trajopt.arrays import require_positive
from trajopt.errors import ArgumentError
from trajopt.formats.described import described
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory


@dataclass(frozen=True)
class Format:
    """A module of this room with ``write``; names that end in ``suffix`` choose it ("" for none).

    ``of``: "commands" (write(orders, file)), "motion" (write(trajectory, file, sample_time)) or
    "robot" (write(robot, file), and read(file) -> parts). ``sample_time``: s, between commands or
    samples where none is asked for.
    """

    module: str
    of: Literal["commands", "motion", "robot"]
    suffix: str
    sample_time: float
    about: str


FORMATS: Mapping[str, Format] = {
    "csv": Format("csv_commands", "commands", ".csv", 0.5, "commands of wheels and body"),
    "json": Format("json_commands", "commands", ".json", 0.5, "the same, with the robot's wheels"),
    "mcap": Format("mcap", "motion", ".mcap", 0.02, "Path, Odometry, JointState, Twist of ROS 2"),
    "rosbag": Format("rosbag", "motion", "", 0.02, "the same in a folder for ros2 bag"),
    "choreo": Format("choreo", "motion", ".traj", 0.05, "Choreo, version 3"),
    "tum": Format("tum", "motion", "", 0.1, "race line of the TUM's planner, CSV"),
    "urdf": Format("urdf", "robot", ".urdf", 0.0, "the robot: links, joints, inertias"),
    "mjcf": Format("mjcf", "robot", ".xml", 0.0, "the robot for MuJoCo, with actuators"),
}


def format_of(file: Path) -> str:
    """The format that a file's name says. Raises ArgumentError where it says none."""
    for name, kind in FORMATS.items():
        if kind.suffix and file.suffix == kind.suffix:
            return name
    endings = ", ".join(kind.suffix for kind in FORMATS.values() if kind.suffix)
    expected = f"a name that ends in one of {endings}, or --format, one of {', '.join(FORMATS)}"
    raise ArgumentError("--out", str(file), expected)


def export(
    trajectory: Trajectory,
    file: str | Path,
    format: str | None = None,
    *,
    sample_time: float | None = None,
    rule: str | None = None,
) -> str:
    """Write a motion (or its robot) as ``file`` in a ``format`` of ``FORMATS``; by default the one
    that the name says. ``sample_time``: s between commands or samples; ``rule`` as in
    ``control.commands``. Returns what was written, in words.

    Raises ArgumentError for another format, for ``sample_time`` and ``rule`` where the format has
    no use for them, and for motions that the format cannot hold (it says why).
    """
    place = Path(file)
    name = format_of(place) if format is None else format
    if name not in FORMATS:
        raise ArgumentError("--format", name, f"one of {', '.join(FORMATS)}")
    kind = FORMATS[name]
    if rule not in (None, "mean", "held") or (rule is not None and kind.of != "commands"):
        raise ArgumentError("--rule", rule, "mean or held, with --format csv or json only")
    if trajectory.robot is None:
        raise ArgumentError("trajectory", "no robot", "one with a robot: time_scale(..., robot=)")
    if kind.of == "robot":
        if sample_time is not None:
            raise ArgumentError("--sample-time", sample_time, f"none: {name} holds no motion")
        return write_robot(trajectory.robot, place, name)
    step = kind.sample_time if sample_time is None else sample_time
    require_positive("sample_time", step, "s")
    if kind.of == "commands":
        from trajopt.control.commands import commands

        orders = commands(trajectory, step, rule="held" if rule == "held" else "mean")
        _module(name).write(orders, trajectory.robot, place)
        return f"{len(orders.times)} commands"
    return f"{_module(name).write(trajectory, place, step)} samples"


def write_robot(robot: Robot, file: str | Path, format: str | None = None) -> str:
    """Write a robot as ``file``, URDF or MJCF. Returns what was written, in words. Raises
    ArgumentError for another format, and for shapes that the format does not know."""
    place = Path(file)
    name = format_of(place) if format is None else format
    _require_robot(name)
    return f"{_module(name).write(robot, place)} links"


def read_robot(
    file: str | Path, wheels: Sequence[str], changes: Mapping[str, Any] | None = None
) -> Robot:
    """Robot of a URDF or MJCF file whose ``wheels`` turn about the joints of these names (a ball:
    the joint that fixes it). ``changes``: dotted keys as in ``Robot.load``, which say what the file
    does not.

    Raises ProblemError with the keys that are missing, ArgumentError for joints that are not there
    or make no wheel.
    """
    place = Path(file)
    name = format_of(place)
    _require_robot(name)
    return described(_module(name).read(place), wheels, changes or {}, place)


def _require_robot(name: str) -> None:
    if name not in FORMATS or FORMATS[name].of != "robot":
        raise ArgumentError("format", name, "urdf or mjcf: the others hold no robot")


def _module(name: str) -> Any:
    return importlib.import_module(f"trajopt.formats.{FORMATS[name].module}")
