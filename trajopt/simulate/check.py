"""Driving a planned trajectory in a physics engine, and comparing plan and motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from trajopt.errors import SimulationError
from trajopt.problem import Problem
from trajopt.simulate.engine import Camera, Command, Recording, make_engine
from trajopt.simulate.loc8_model import loc8_mecanum
from trajopt.simulate.scene import Scene
from trajopt.timing.trajectory import Trajectory

Array = NDArray[np.float64]

SAMPLE_TIME = 0.002  # s between wheel speed commands: the engines' own step
COAST = 0.5  # s after the last command in which the robot comes to rest; chosen


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """How far the simulated motion is from the plan. Angles rad, lengths m.

    ``along`` and ``across``: final position error along and across the planned final direction of travel;
    ``yaw``: final heading error; ``wheel_deviation`` (4,): final wheel angle minus planned;
    ``path_rms`` and ``path_max``: distance from the planned position at the same time.
    ``planned`` (N, 3) are the planned poses at the recording's times.
    """

    engine: str
    along: float
    across: float
    yaw: float
    wheel_deviation: Array
    path_rms: float
    path_max: float
    length: float
    real_time_factor: float
    planned: Array = field(repr=False)
    recording: Recording = field(repr=False)

    @property
    def final_distance(self) -> float:
        """Distance of the final position from the planned one, m."""
        return float(np.hypot(self.along, self.across))


def drive_trajectory(
    trajectory: Trajectory, problem: Problem, *, engine: str = "pybullet", picture: bool = False
) -> ValidationReport:
    """Open loop at the planned wheel speeds on flat ground, LOC8 with Mecanum rollers.

    Raises SimulationError when the run leaves physics.
    """
    samples = max(2, round(trajectory.duration / SAMPLE_TIME) + 1)
    times = np.linspace(0.0, trajectory.duration, samples)
    state = trajectory.at(times)
    # A trajectory that ends in motion is stopped: the engine gets zero speed after the last sample.
    command = Command(
        np.append(times, times[-1] + COAST),
        np.vstack([state.wheel_speeds, np.zeros(4)])
        if np.allclose(state.wheel_speeds[-1], 0)
        else np.vstack([state.wheel_speeds[:-1], np.zeros((2, 4))]),
        _triple(state.pose[0]),
        _four(problem.start.wheels),
    )
    recording = make_engine(engine).run(
        loc8_mecanum(), Scene(problem.scene.friction), command, picture=Camera() if picture else None
    )
    if recording.exploded:
        raise SimulationError(f"{engine}: the simulation left physics: {recording.reason}")
    return _compared(trajectory, problem, recording)


def _compared(trajectory: Trajectory, problem: Problem, recording: Recording) -> ValidationReport:
    plan = trajectory.at(np.minimum(recording.times, trajectory.duration))
    error = recording.pose - plan.pose
    distance = np.hypot(error[:, 0], error[:, 1])
    heading = _final_direction(plan.pose)
    dx, dy = error[-1, :2]
    wheels = recording.wheel_angles[-1] - (np.asarray(problem.start.wheels) + plan.wheel_angles[-1])
    return ValidationReport(
        recording.engine,
        float(np.cos(heading) * dx + np.sin(heading) * dy),
        float(-np.sin(heading) * dx + np.cos(heading) * dy),
        float(error[-1, 2]),
        wheels,
        float(np.sqrt(np.mean(distance**2))),
        float(distance.max()),
        float(np.sum(np.hypot(*np.diff(plan.pose[:, :2], axis=0).T))),
        recording.real_time_factor,
        plan.pose,
        recording,
    )


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _four(values: tuple[float, ...]) -> tuple[float, float, float, float]:
    return values[0], values[1], values[2], values[3]


def _final_direction(poses: Array) -> float:
    """Direction of travel over the last 2 cm (rad), or over the whole motion where it is shorter than that."""
    before = np.flatnonzero(np.hypot(*(poses[:, :2] - poses[-1, :2]).T) > 0.02)
    x, y = poses[-1, :2] - poses[before[-1] if before.size else 0, :2]
    return float(np.arctan2(y, x))
