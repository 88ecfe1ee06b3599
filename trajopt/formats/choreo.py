"""Choreo's ``.traj``, version 3: samples of a swerve or a differential drive.

Velocities, accelerations and forces are in the field's frame; accelerations and forces hold up to
the next sample. The four wheels' forces come in the order front left, rear left, rear right, front
right; they are the smallest that make the motion (least squares), as the file has no others.
``config`` is null: that of the project holds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.formats.rosbag import sample_times
from trajopt.report.files import write_json
from trajopt.robots.robot import Robot
from trajopt.timing.states import State
from trajopt.timing.trajectory import Trajectory

VERSION = 3
_SPINS = 1e-9  # a share of the drive's motions below which it has none of a kind


def write(trajectory: Trajectory, file: Path, sample_time: float) -> int:
    """Samples in steps of ``sample_time``, s, and at the end; returns how many. Raises
    ArgumentError for robots that Choreo does not know, and on ground that is not level."""
    robot = trajectory.robot
    assert robot is not None  # ``export`` has asked
    if not trajectory.ground.level:
        raise ArgumentError("--format choreo", "a hill", "a motion on level ground")
    times = sample_times(trajectory, sample_time)
    state = trajectory.at(times)
    kind, columns = _swerve(robot, times, state) if robot.holonomic or _steers(robot) else (
        _differential(robot, times, state)
    )  # fmt: skip
    columns = {"t": times, **dict(zip(("x", "y", "heading"), state.pose.T, strict=True)), **columns}
    lists = {name: np.asarray(values).tolist() for name, values in columns.items()}
    samples = [dict(zip(lists, row, strict=True)) for row in zip(*lists.values(), strict=True)]
    ends = [state.pose[0], state.pose[-1]]
    content = {
        "name": file.stem,
        "version": VERSION,
        "snapshot": _parameters(ends, len(times) - 1, sample_time, lambda value, _: value),
        "params": _parameters(ends, len(times) - 1, sample_time, _expression),
        "trajectory": {
            "config": None,
            "sampleType": kind,
            "waypoints": [0.0, trajectory.duration],
            "samples": samples,
            "splits": [0],
        },
        "events": [],
    }
    write_json(file, content)
    return len(times)


def _steers(robot: Robot) -> bool:
    return any(wheel.kind == "steered" for wheel in robot.description.wheels)


def _swerve(robot: Robot, times: Array, state: State) -> tuple[str, dict[str, Array]]:
    places = np.array([wheel.contact for wheel in robot.rolling])
    if robot.drivable.shape[1] < 3 or len(places) != 4:
        expected = "four wheels and any motion (swerve), or a differential drive"
        raise ArgumentError("--format choreo", robot.name, expected)
    cos, sin = np.cos(state.pose[:, 2]), np.sin(state.pose[:, 2])
    vx, vy, omega = state.twist.T
    world = np.column_stack([cos * vx - sin * vy, sin * vx + cos * vy, omega])
    rates = _rates(times, world)
    pushed = _wrench(robot, rates, omega, cos, sin)
    x, y = places.T
    # sum of forces, and their moment about the origin: x fy - y fx
    shares = np.linalg.pinv(
        np.block([[np.ones(4), np.zeros(4)], [np.zeros(4), np.ones(4)], [-y, x]])
    )
    fx, fy = np.split(pushed @ shares.T, 2, axis=1)
    around = np.argsort(np.mod(np.arctan2(y - y.mean(), x - x.mean()), 2 * np.pi))
    fx, fy = fx[:, around], fy[:, around]
    turned = (cos[:, None] * fx - sin[:, None] * fy, sin[:, None] * fx + cos[:, None] * fy)
    names = ("vx", "vy", "omega", "ax", "ay", "alpha")
    columns = dict(zip(names, (*world.T, *rates.T), strict=True))
    return "Swerve", {**columns, "fx": turned[0], "fy": turned[1]}


def _differential(robot: Robot, times: Array, state: State) -> tuple[str, dict[str, Array]]:
    rims = robot.inverse * np.array([[wheel.radius] for wheel in robot.wheels])
    half = np.abs(rims[:, 2]).max(initial=0.0)
    if not half > 0 or np.abs(np.abs(rims) - [1.0, 0.0, half]).max() > _SPINS:
        expected = "four wheels and any motion (swerve), or a differential drive"
        raise ArgumentError("--format choreo", robot.name, expected)
    vx, _, omega = state.twist.T
    sides = np.column_stack([vx - half * omega, vx + half * omega])
    rates = _rates(times, np.column_stack([sides, omega]))
    ahead = rates[:, :2].mean(axis=1)
    body = np.column_stack([ahead, vx * omega, rates[:, 2]])  # of the body's origin, its own frame
    push, _, moment = _wrench(robot, body, omega, np.ones_like(vx), np.zeros_like(vx)).T
    names = ("vl", "vr", "omega", "al", "ar", "alpha", "fl", "fr")
    forces = ((push - moment / half) / 2, (push + moment / half) / 2)
    return "Differential", dict(zip(names, (*sides.T, omega, *rates.T, *forces), strict=True))


def _rates(times: Array, values: Array) -> Array:
    """(N, K): rate up to the next sample, 0 at the end."""
    return np.vstack([np.diff(values, axis=0) / np.diff(times)[:, None], np.zeros(values.shape[1])])


def _wrench(robot: Robot, rates: Array, omega: Array, cos: Array, sin: Array) -> Array:
    """(N, 3): force (N, body frame) and moment about the body's origin (N m) of the wheels, from
    the origin's acceleration in a frame that the body is turned in by (cos, sin)."""
    (x, y, _), alpha = robot.body.cog, rates[:, 2]
    ax = cos * rates[:, 0] + sin * rates[:, 1] - alpha * y - omega**2 * x
    ay = cos * rates[:, 1] - sin * rates[:, 0] + alpha * x - omega**2 * y
    fx, fy = robot.body.mass * ax, robot.body.mass * ay
    return np.column_stack([fx, fy, robot.yaw_inertia * alpha + x * fy - y * fx])


def _expression(value: float, unit: str) -> dict[str, Any]:
    return {"exp": f"{value!r} {unit}", "val": value}


def _parameters(ends: list[Array], intervals: int, step: float, number: Any) -> dict[str, Any]:
    """Start and goal as waypoints, at which the robot stops."""
    waypoints = []
    for x, y, heading in (end.tolist() for end in ends):
        place = {"x": number(x, "m"), "y": number(y, "m"), "heading": number(heading, "rad")}
        fixed = {"fixTranslation": True, "fixHeading": True, "overrideIntervals": True}
        waypoints.append({**place, "intervals": intervals, "split": False, **fixed})
    stop = {"type": "StopPoint", "props": {}}
    stops = [{"from": end, "to": None, "data": stop, "enabled": True} for end in ("first", "last")]
    return {"waypoints": waypoints, "constraints": stops, "targetDt": number(step, "s")}
