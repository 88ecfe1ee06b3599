"""Wheel speed commands of a robot, and what it did with them.

Commands are speeds of the wheels' rims (m/s) held over one sample time, as [waheed2006] hands them
over (section 3.5).
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path as FilePath
from typing import Literal, NamedTuple

import numpy as np

from trajopt.arrays import Array, fold, require_positive
from trajopt.errors import ArgumentError
from trajopt.files import read_table, whole_file
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.timing.trajectory import Trajectory

_SMALL_TURN = 1e-9  # rad in one step below which a step is straight
LOG_COLUMNS = ("t", "x", "y", "yaw", "v")
_MOST_COMMANDS = 1_000_000  # of one motion, chosen: a microsecond is no sample time of a drive


@dataclass(frozen=True, eq=False)
class Commands:
    """Speeds (N, W), m/s, of the rims of the ``wheels``, each held from ``times`` (N,), s, for
    ``sample_time``; ``steering`` (N + 1, S), rad: angles of the ``steered`` wheels at the times and
    at the end, from the angle that the robot's file gives; ``body`` (N, 3): its twist (vx, vy, wz),
    m/s, m/s, rad/s, held as the speeds are."""

    times: Array
    speeds: Array
    wheels: tuple[str, ...]
    sample_time: float
    steering: Array
    steered: tuple[str, ...]
    body: Array

    @property
    def duration(self) -> float:
        return float(self.times[-1] + self.sample_time)


class Comparison(NamedTuple):
    """What a log says of a plan, as Tables 3 to 18 of [waheed2006]. Norms are root mean squares
    (eq. 3.10)."""

    speed_error: float  # m/s
    heading_error: float  # rad
    goal_offset: float  # m
    time_offset: float  # s
    distance: float  # m


def half_track(robot: Robot) -> float:
    """Half the distance between the wheels, m. Raises ArgumentError unless the robot has two driven
    wheels."""
    if robot.holonomic or len(robot.wheels) != 2:
        raise ArgumentError(
            "robot", robot.name, "a differential drive: two fixed wheels, left and right"
        )
    return float(abs(robot.wheels[0].position[1]))


def commands(
    trajectory: Trajectory, sample_time: float, *, rule: Literal["held", "mean"] = "mean"
) -> Commands:
    """Wheel speeds every ``sample_time`` seconds.

    "held": the speed at the start of each interval (eqs. 3.7 to 3.9, as the thesis digitises).
    "mean": the wheel's turn over the interval divided by its length, so that the wheels end at the
    planned angles. The last interval is stretched to whole samples and holds what is left. Raises
    ArgumentError for a sample time that is not positive, or a trajectory without a robot.
    """
    require_positive("sample_time", sample_time, "s")
    if trajectory.duration / sample_time > _MOST_COMMANDS:
        raise ArgumentError(
            "sample_time",
            sample_time,
            f"at most {_MOST_COMMANDS:,} commands: "
            f"{trajectory.duration / _MOST_COMMANDS:.2g} s or more",
        )
    robot = trajectory.robot
    if robot is None:
        raise ArgumentError(
            "trajectory", "no robot", "a trajectory with a robot (time_scale(..., robot=...))"
        )
    count = max(int(np.ceil(trajectory.duration / sample_time - 1e-9)), 1)
    edges = sample_time * np.arange(count + 1, dtype=np.float64)
    state = trajectory.at(np.minimum(edges, trajectory.duration))
    radius = np.array([wheel.radius for wheel in robot.wheels])
    if rule == "held":
        speeds, body = state.wheel_speeds[:-1] * radius, state.twist[:-1]
    elif rule == "mean":
        speeds = np.diff(state.wheel_angles, axis=0) * radius / sample_time
        body = _travelled(trajectory, edges) / sample_time
    else:
        raise ArgumentError("rule", rule, "held or mean")
    wheels = steering_of(robot)
    names = tuple(wheels.names[i] for i in wheels.steered)
    steering = state.steering_angles[:, wheels.steered]
    return Commands(edges[:-1], speeds, robot.wheel_names, sample_time, steering, names, body)


def _travelled(trajectory: Trajectory, edges: Array) -> Array:
    """(N - 1, 3): integral of the body's twist between ``edges`` (N,), s, by Simpson's rule in the
    cells of the speed profile."""
    inner = np.concatenate([trajectory.times, trajectory.times - trajectory.waits, edges])
    grid = np.unique(np.clip(inner, 0.0, trajectory.duration))
    middle = (grid[1:] + grid[:-1]) / 2
    ends, mid = trajectory.at(grid).twist, trajectory.at(middle).twist
    parts = (ends[:-1] + 4 * mid + ends[1:]) * np.diff(grid)[:, None] / 6
    total = np.vstack([np.zeros(3), np.cumsum(parts, axis=0)])
    at = np.searchsorted(grid, np.minimum(edges, trajectory.duration))
    return np.diff(total[at], axis=0)


def driven(orders: Commands, robot: Robot, start: Sequence[float], times: Array) -> Array:
    """(N, 3): poses (m, m, rad) at ``times`` (N,) s of a differential drive that executes the
    commands without slip. Raises ArgumentError for another robot.

    Exact: wheel speeds are constant in an interval, so the robot moves on an arc.
    """
    width = 2 * half_track(robot)
    pose = np.empty((len(orders.times) + 1, 3))
    pose[0] = start
    left, right = orders.speeds.T
    v, w = (left + right) / 2, (right - left) / width
    pose[1:, 2] = start[2] + np.cumsum(w * orders.sample_time)
    moved = _arc(pose[:-1, 2], v, w, np.full(len(v), orders.sample_time))
    pose[1:, :2] = np.asarray(start[:2]) + np.cumsum(moved, axis=0)
    i = np.clip(np.searchsorted(orders.times, times, side="right") - 1, 0, len(v) - 1)
    after = np.clip(times - orders.times[i], 0.0, orders.sample_time)
    here = np.column_stack(
        [pose[i, :2] + _arc(pose[i, 2], v[i], w[i], after), pose[i, 2] + w[i] * after]
    )
    return np.asarray(here)


def export_commands(orders: Commands, file: str | FilePath) -> FilePath:
    """Write t (s), a column v_<wheel> (m/s) a wheel, a column steering_<wheel> (rad) a steered
    wheel, and vx, vy (m/s), wz (rad/s) of the body as CSV; ends with a row of speeds 0."""
    path = FilePath(file)
    with whole_file(path) as part, part.open("w", newline="", encoding="utf-8") as stream:
        writer = csv.writer(stream)
        names = [f"v_{name}" for name in orders.wheels]
        steered = (f"steering_{name}" for name in orders.steered)
        writer.writerow(["t", *names, *steered, "vx", "vy", "wz"])
        times = np.append(orders.times, orders.duration)
        speeds = np.vstack([orders.speeds, np.zeros((1, len(orders.wheels)))])
        body = np.vstack([orders.body, np.zeros((1, 3))])
        for t, row in zip(times, np.hstack([speeds, orders.steering, body]), strict=True):
            writer.writerow([f"{t:.6g}", *(f"{value:.9g}" for value in row)])
    return path


def compare_log(trajectory: Trajectory, file: str | FilePath) -> Comparison:
    """Compare a plan with the log of what the robot did: CSV with columns t, x, y, yaw, v (s, m, m,
    rad, m/s; v forward, or in whatever direction a holonomic robot moves).

    Speeds are compared at the log's times, headings at equal travelled distance share, the goal by
    place. Raises ArgumentError for a missing column, fewer than two rows, or numbers that are not
    finite and rising in time.
    """
    log = _read_log(FilePath(file))
    t = log[:, 0]
    inside = t <= trajectory.duration
    planned = trajectory.at(np.minimum(t, trajectory.duration))
    forward = planned.twist[:, 0]
    if trajectory.robot is not None and trajectory.robot.holonomic:
        forward = np.hypot(*planned.twist[:, :2].T)
    speed = np.where(inside, forward, 0.0)
    heading = fold(log[:, 3] - planned.pose[:, 2])
    steps = np.hypot(np.diff(log[:, 1]), np.diff(log[:, 2]))
    return Comparison(
        float(np.sqrt(np.mean((log[:, 4] - speed) ** 2))),
        float(np.sqrt(np.mean(heading**2))),
        float(np.hypot(*(log[-1, 1:3] - planned.pose[-1, :2]))),
        float(t[-1] - trajectory.duration),
        float(steps.sum()),
    )


def _read_log(path: FilePath) -> Array:
    log = np.column_stack(list(read_table(path, LOG_COLUMNS).values()))
    early = np.flatnonzero(np.diff(log[:, 0], prepend=-np.finfo(float).tiny) <= 0)
    if len(log) < 2 or len(early):
        found = f"{len(log)} rows" if len(log) < 2 else f"t = {log[early[0], 0]}"
        raise ArgumentError(str(path), found, "two or more rows, times rising from t >= 0")
    return log


def _arc(yaw: Array, v: Array, w: Array, t: Array) -> Array:
    """(N, 2): displacement on arcs of constant speed and yaw rate."""
    turn = w * t
    straight = np.abs(turn) < _SMALL_TURN
    half = turn / 2
    chord = v * t * np.where(straight, 1.0, np.sin(half) / np.where(straight, 1.0, half))
    return np.column_stack([chord * np.cos(yaw + half), chord * np.sin(yaw + half)])
