"""A plan of [waheed2006] driven in physics, open or closed loop, and its figures of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, fold, rotation
from trajopt.control.tracking import Tracker, TrackingController
from trajopt.errors import SimulationError
from trajopt.simulate.build import build
from trajopt.simulate.engine import Engine, Recording
from trajopt.simulate.plan import open_loop
from trajopt.simulate.stepping import drive
from trajopt.timing.trajectory import Trajectory
from trajopt.world.scene import Scene


@dataclass(frozen=True, eq=False)
class DriveRecord:
    """``recording``, and at its times the ``planned`` poses (N, 3) and ``planned_speed`` (N,) along
    the heading; ``slip`` (N, D) m/s of the driven wheels."""

    recording: Recording
    planned: Array
    planned_speed: Array
    slip: Array

    @property
    def slip_ratio(self) -> float:
        """Root mean square of the driven wheels' slip over that of the speed."""
        return slip_share(self.slip, self.recording.speed)

    @property
    def goal_offset(self) -> float:
        """m between the last pose and the plan's."""
        return float(np.hypot(*(self.recording.pose[-1] - self.planned[-1])[:2]))

    @property
    def final_heading_error(self) -> float:
        """rad."""
        return float(abs(fold(float(self.recording.pose[-1, 2] - self.planned[-1, 2]))))

    @property
    def heading_error(self) -> float:
        """Root mean square, rad."""
        return float(np.sqrt(np.mean(fold(self.recording.pose[:, 2] - self.planned[:, 2]) ** 2)))

    @property
    def speed_error(self) -> float:
        """Root mean square, m/s (eq. 3.10 of [waheed2006])."""
        return float(np.sqrt(np.mean((self.recording.speed - self.planned_speed) ** 2)))


def drive_plan(
    trajectory: Trajectory,
    scene: Scene,
    *,
    tracker: Tracker | None = None,
    start_error: Sequence[float] = (0.0, 0.0, 0.0),
    engine: str | Engine = "pybullet",
) -> DriveRecord:
    """Drive ``trajectory.robot`` in ``scene``: closed loop with a ``tracker``, which knows the true
    pose, open loop without.

    ``start_error`` is in the body frame (m, m, rad). Raises as ``simulate.validate``.
    """
    robot = trajectory.robot
    assert robot is not None  # plans of the thesis have one
    start = shifted(trajectory.at(0.0).pose[0], start_error)
    command, controller = open_loop(trajectory, build(robot), start), None
    if tracker is not None:
        controller = TrackingController(trajectory, tracker, robot)
        end = trajectory.duration + tracker.settle
        still = np.zeros((2, len(robot.wheels)))
        times = np.array([0.0, end])
        command = replace(command, times=times, wheel_speeds=still, angles=None)
    recording = drive(robot, scene, command, engine=engine, controller=controller)
    if recording.exploded:
        raise SimulationError(recording.reason)
    at = trajectory.at(np.minimum(recording.times, trajectory.duration))
    moving = recording.times < trajectory.duration
    return DriveRecord(
        recording, at.pose, at.twist[:, 0] * moving, recording.slip[:, driven_columns(trajectory)]
    )


def driven_columns(trajectory: Trajectory) -> list[int]:
    """Which wheels of the robot's file have a motor."""
    robot = trajectory.robot
    assert robot is not None
    return [i for i, w in enumerate(robot.description.wheels) if w.name in robot.driven]


def faster(trajectory: Trajectory, factor: float) -> Trajectory:
    """The same motion in 1/``factor`` of its time: forces grow with the square."""
    return replace(
        trajectory,
        sd=trajectory.sd * factor,
        sdd=trajectory.sdd * factor**2,
        profile=None if trajectory.profile is None else trajectory.profile.slower(1 / factor),
        bound=None,
    )


def shifted(pose: Array, error: Sequence[float]) -> Array:
    """``pose`` (3,) moved by an ``error`` in its own axes (m, m, rad)."""
    moved = rotation(pose[2]) @ np.array(error[:2])
    return np.asarray(pose + np.array([*moved, error[2]]))


def slip_share(slip: Array, speed: Array) -> float:
    """Root mean square of ``slip`` over that of ``speed``, both m/s."""
    return float(np.sqrt(np.mean(slip**2)) / np.sqrt(np.mean(speed**2)))
