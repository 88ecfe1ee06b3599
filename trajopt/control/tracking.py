"""Closed-loop tracking of a trajectory by a differential drive (the first future work of
[waheed2006]).

The law is that of [kanayama1990] in the form whose damping does not depend on speed [deluca2001]:
with the error (ex, ey, eyaw) of the reference seen from the robot,

    v = v_ref cos(eyaw) + k ex,   w = w_ref + c v_ref sinc(eyaw) ey + g eyaw,   g = 2 z sqrt(w_ref^2
    + c v_ref^2)

and a floor on g, so that the heading is still corrected at the end, where the reference stands. The
gain k along the path is low and constant: near the friction limit a stiff one locks the wheels when
the robot comes late.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, fold, require_not_negative, require_positive
from trajopt.control.approach import START_SD, Estimate, correct, predict
from trajopt.control.measured import Measured, Targets
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory

PERIOD = 0.01  # s between two commands, that of the engines' records


@dataclass(frozen=True)
class Tracker:
    """``damping`` z (-), ``stiffness`` c (1/m^2), ``along`` (1/s) and ``floor`` of g (1/s), all
    chosen.

    ``wheel_speed`` (m/s) is where commands saturate; both wheels are then scaled, so that the arc
    is kept. ``settle`` (s) is how long the goal is still corrected after the reference has arrived.
    """

    damping: float = 0.8
    stiffness: float = 2.0
    along: float = 1.0
    floor: float = 0.8
    wheel_speed: float = 2.1
    settle: float = 3.0

    def __post_init__(self) -> None:
        for name in ("damping", "stiffness", "along", "wheel_speed"):
            require_positive(f"tracker.{name}", getattr(self, name))
        for name in ("floor", "settle"):
            require_not_negative(f"tracker.{name}", getattr(self, name))

    def wheel_speeds(
        self, reference: Array, speed: tuple[float, float], pose: Array, robot: Robot
    ) -> Array:
        """Wheel speeds (W,), rad/s, of ``robot`` at ``pose`` (3,) for the ``reference`` pose (3,)
        that moves at ``speed`` (m/s, rad/s)."""
        dx, dy = reference[0] - pose[0], reference[1] - pose[1]
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        ex, ey = cos * dx + sin * dy, -sin * dx + cos * dy
        turn = float(fold(reference[2] - pose[2]))
        v_ref, w_ref = speed
        gain = max(
            2 * self.damping * float(np.sqrt(w_ref**2 + self.stiffness * v_ref**2)), self.floor
        )
        v = v_ref * np.cos(turn) + self.along * ex
        w = w_ref + self.stiffness * v_ref * float(np.sinc(turn / np.pi)) * ey + gain * turn
        speeds = robot.inverse @ np.array([v, 0.0, w])
        rims = np.abs(speeds) * [wheel.radius for wheel in robot.wheels]
        return np.asarray(speeds / max(1.0, float(rims.max()) / self.wheel_speed))


class TrackingController:
    """A ``tracker`` along a trajectory; see ``measured.Controller``. Between measurements the pose
    is that of odometry.

    Raises ArgumentError for a robot that cannot turn on the spot by its wheel speeds alone.
    """

    def __init__(self, trajectory: Trajectory, tracker: Tracker, robot: Robot) -> None:
        require_turning(robot)
        count = int(np.ceil(trajectory.duration / PERIOD)) + 1
        self.times = np.minimum(PERIOD * np.arange(count), trajectory.duration)
        self.reference = trajectory.at(self.times)
        self.tracker, self.robot, self.duration = tracker, robot, trajectory.duration
        self._estimate = Estimate(self.reference.pose[0], np.diag(START_SD) ** 2)
        self._wheels: Array | None = None

    def step(self, t: float, measured: Measured) -> Targets:
        """Wheel speeds (W,) to be reached a period after ``t`` (s)."""
        if self._wheels is not None:
            turned = measured.wheel_angles - self._wheels
            self._estimate = predict(self._estimate, self.robot, turned)
        self._wheels = measured.wheel_angles.copy()
        if measured.pose is not None:
            self._estimate = correct(self._estimate, measured.pose, measured.deviations)
        pose = np.array([np.interp(t, self.times, c) for c in self.reference.pose.T])
        after, moving = t + PERIOD, t + PERIOD < self.duration
        v, w = (
            float(np.interp(after, self.times, self.reference.twist[:, k])) * moving for k in (0, 2)
        )
        return Targets(self.tracker.wheel_speeds(pose, (v, w), self._estimate.pose, self.robot))


def require_turning(robot: Robot) -> None:
    """Raises ArgumentError unless the robot drives along its heading and turns, as a differential
    drive does."""
    if robot.admissible.shape[1] != 2 or np.abs(robot.admissible[1]).max() > 1e-9:
        raise ArgumentError(
            "robot", robot.name, "a robot that drives along its heading and turns, without steering"
        )
