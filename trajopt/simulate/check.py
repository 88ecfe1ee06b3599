"""Driving a planned trajectory in a physics engine, and comparing plan and motion."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from trajopt.arrays import Array
from trajopt.control.approach import Mode, approach_controller
from trajopt.errors import ArgumentError, SimulationError
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.problem import Problem
from trajopt.simulate.engine import Camera, Command, Controller, Recording, make_engine
from trajopt.simulate.scene import Scene
from trajopt.systems.smdw.approach_run import SETTLE, steered
from trajopt.systems.smdw.loc8_model import roller_robot
from trajopt.timing.trajectory import Trajectory

SAMPLE_TIME = 0.002  # s between wheel speed commands: the engines' own step
COAST = 0.5  # s after the last command in which the robot comes to rest; chosen


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """How far the simulated motion is from the plan. Angles rad, lengths m.

    ``along`` and ``across``: final position error along and across the planned final direction of
    travel; ``yaw``: final heading error; ``wheel_deviation`` (4,): final wheel angle minus planned;
    ``path_rms`` and ``path_max``: distance from the planned position at the same time, until the
    plan ends (what a controller bends on purpose counts too). ``planned`` (N, 3) are the planned
    poses at the recording's times. ``control`` and ``seed`` say what was switched on; None: the
    planned wheel speeds.
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
    control: Mode | None = None
    seed: int = 0

    @property
    def final_distance(self) -> float:
        """Distance of the final position from the planned one, m."""
        return float(np.hypot(self.along, self.across))


def drive_trajectory(
    trajectory: Trajectory,
    problem: Problem,
    *,
    engine: str = "pybullet",
    picture: bool = False,
    control: Mode | None = None,
    seed: int = 0,
) -> ValidationReport:
    """On flat ground, LOC8 with Mecanum rollers: at the planned wheel speeds, or under an approach
    controller.

    With ``control`` the pose is measured as ``Sensors`` says, blurred by random numbers of
    ``seed``, and the plan that the motion is compared with is timed as the controller wants it.
    Raises SimulationError when the run leaves physics, ArgumentError for a seed below 0 or where
    the controller refuses the trajectory.
    """
    if seed < 0:
        raise ArgumentError("seed", seed, "a whole number >= 0")
    if control is not None:
        return _controlled(trajectory, problem, engine, picture, control, seed)
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
        _four(trajectory.start_wheels),
    )
    recording = _run(engine, problem, command, picture, None)
    plan = trajectory.at(np.minimum(recording.times, trajectory.duration))
    return _compared(plan.pose, plan.wheel_angles[-1], recording, trajectory.duration)


def _controlled(
    trajectory: Trajectory, problem: Problem, engine: str, picture: bool, control: Mode, seed: int
) -> ValidationReport:
    cap = next((limit.largest for limit in problem.limits if isinstance(limit, WheelSpeed)), np.inf)
    controller = approach_controller(
        trajectory,
        problem.robot,
        trajectory.start_wheels,
        problem.critical_indices,
        cap=float(np.min(cap)),
        mode=control,
        rng=np.random.default_rng(seed),
    )
    reference = controller.reference
    command = Command(
        np.array([0.0, reference.times[-1] + SETTLE]),
        np.zeros((2, 4)),
        _triple(reference.pose[0]),
        _four(trajectory.start_wheels),
    )
    recording = _run(engine, problem, command, picture, steered(controller))
    planned = np.column_stack(
        [np.interp(recording.times, reference.times, column) for column in reference.pose.T]
    )
    report = _compared(planned, reference.wheels[-1], recording, float(reference.times[-1]))
    return replace(report, control=control, seed=seed)


def _run(
    engine: str, problem: Problem, command: Command, picture: bool, controller: Controller | None
) -> Recording:
    recording = make_engine(engine).run(
        roller_robot(problem.robot),
        Scene(problem.ground.friction),
        command,
        controller=controller,
        picture=Camera() if picture else None,
    )
    if recording.exploded:
        raise SimulationError(f"{engine}: the simulation left physics: {recording.reason}")
    return recording


def _compared(planned: Array, wheels: Array, recording: Recording, end: float) -> ValidationReport:
    """Against the planned poses (N, 3) at the recording's times and the planned final wheel angles
    (4,); the plan ends at ``end`` (s)."""
    error = recording.pose - planned
    distance = np.hypot(error[:, 0], error[:, 1])[recording.times <= end]
    heading = _final_direction(planned)
    dx, dy = error[-1, :2]
    return ValidationReport(
        recording.engine,
        float(np.cos(heading) * dx + np.sin(heading) * dy),
        float(-np.sin(heading) * dx + np.cos(heading) * dy),
        float(error[-1, 2]),
        recording.wheel_angles[-1] - wheels,
        float(np.sqrt(np.mean(distance**2))),
        float(distance.max()),
        float(np.sum(np.hypot(*np.diff(planned[:, :2], axis=0).T))),
        recording.real_time_factor,
        planned,
        recording,
    )


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _four(values: Array) -> tuple[float, float, float, float]:
    a, b, c, d = values.tolist()
    return a, b, c, d


def _final_direction(poses: Array) -> float:
    """Direction of travel over the last 2 cm (rad), or over the whole motion where it is shorter
    than that."""
    before = np.flatnonzero(np.hypot(*(poses[:, :2] - poses[-1, :2]).T) > 0.02)
    x, y = poses[-1, :2] - poses[before[-1] if before.size else 0, :2]
    return float(np.arctan2(y, x))
