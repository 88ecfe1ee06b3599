"""What a trajectory expects of every wheel, as physics commands and measures it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.loads import contact_loads
from trajopt.simulate.engine import Command
from trajopt.simulate.model import Model
from trajopt.simulate.scene import Area
from trajopt.timing.trajectory import Trajectory

SAMPLE_TIME = 0.002  # s between wheel speed commands: the engines' own step
COAST = 0.5  # s after the last command in which the robot comes to rest; chosen
ROOM = 1.0  # m of ground beside a path and a robot's outline, chosen


@dataclass(frozen=True, eq=False)
class WheelPlan:
    """At N times, of all A wheels of the robot's file: ``spin`` and ``steering`` angles (N, A), rad,
    and ``loads`` (N, A), N, those of ``limits.forces.contact_loads``."""

    spin: Array
    steering: Array
    loads: Array


def wheel_plan(trajectory: Trajectory, times: Array) -> WheelPlan:
    """What the trajectory has at ``times`` (N,), s; after its end it rests."""
    robot = trajectory.robot
    assert robot is not None
    t = np.minimum(times, trajectory.duration)
    state, (s, speed, sdd) = trajectory.at(t), trajectory.along(t)
    rests = times >= trajectory.duration
    samples = trajectory.track.samples(s, trajectory.path.locate(s))
    loads = contact_loads(samples, robot).at(
        np.where(rests, 0.0, sdd), np.where(rests, 0.0, speed**2)
    )
    return WheelPlan(state.spin_angles, state.steering_angles, robot.body.mass * loads)


def open_loop(trajectory: Trajectory, model: Model, pose: Array) -> Command:
    """The planned wheel speeds and steering angles from ``pose`` (3,) on, castors as planned, then
    rest. A trajectory that ends in motion is stopped: the engine gets zero speed after the last
    sample."""
    samples = max(2, round(trajectory.duration / SAMPLE_TIME) + 1)
    times = np.linspace(0.0, trajectory.duration, samples)
    state = trajectory.at(times)
    speeds, (angles, swivels) = state.wheel_speeds, model.joints_at(state.steering_angles)
    rest = np.zeros((1, speeds.shape[1]))
    moving = not np.allclose(speeds[-1], 0)
    rows = np.vstack([speeds[:-1], rest, rest] if moving else [speeds, rest])
    return Command(
        np.append(times, times[-1] + COAST), rows, np.vstack([angles, angles[-1:]]), triple(pose),
        trajectory.start_wheels, swivels[0],
    )  # fmt: skip


def area_of(trajectory: Trajectory, pose: Array) -> Area:
    """What a robot that starts at ``pose`` (3,) needs of the ground to drive the trajectory."""
    assert trajectory.robot is not None
    places = np.vstack([trajectory.at(trajectory.times).pose[:, :2], pose[:2]])
    room = ROOM + float(np.hypot(*np.array(trajectory.robot.footprint).T).max())
    low, high = (places.min(axis=0) - room).tolist(), (places.max(axis=0) + room).tolist()
    return (low[0], low[1]), (high[0], high[1])


def triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
