"""Closed-loop tracking of a trajectory by any robot (for a differential drive the first future work
of [waheed2006]).

A robot that moves in every direction goes after its reference in all of them, at a rate ``along``.
For others the law is that of [kanayama1990] in the form whose damping does not depend on speed [deluca2001]:
with the error (ex, ey, eyaw) of the reference seen from the robot,

    v = v_ref cos(eyaw) + k ex,   w = w_ref + c v_ref sinc(eyaw) ey + g eyaw,   g = 2 z sqrt(w_ref^2
    + c v_ref^2)

and a floor on g, so that the heading is still corrected at the end, where the reference stands. The
gain k along the path is low and constant: near the friction limit a stiff one locks the wheels when
the robot comes late. A robot that has to drive to turn (steering with a range) has no floor: at rest it stays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trajopt.arrays import Array, fold, require_not_negative, require_positive, rotation
from trajopt.control.approach import START_SD, Estimate, correct, predict
from trajopt.control.measured import Measured, Targets
from trajopt.control.wheels import WheelCommands
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
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

    def twist(self, reference: Array, speed: Array, pose: Array, robot: Robot) -> Array:
        """Body twist (3,) of ``robot`` at ``pose`` (3,) for the ``reference`` pose (3,) whose own is
        ``speed`` (m/s, m/s, rad/s)."""
        dx, dy = reference[0] - pose[0], reference[1] - pose[1]
        cos, sin = np.cos(pose[2]), np.sin(pose[2])
        ex, ey = cos * dx + sin * dy, -sin * dx + cos * dy
        turn = float(fold(reference[2] - pose[2]))
        if robot.drivable.shape[1] == 3:
            (vx, vy), gain = rotation(turn) @ speed[:2], self.along
            return np.array([vx + gain * ex, vy + gain * ey, speed[2] + gain * turn])
        v_ref, _, w_ref = speed
        floor = 0.0 if np.isfinite(steering_of(robot).ranges).any() else self.floor
        gain = max(2 * self.damping * float(np.sqrt(w_ref**2 + self.stiffness * v_ref**2)), floor)
        v = v_ref * np.cos(turn) + self.along * ex
        w = w_ref + self.stiffness * v_ref * float(np.sinc(turn / np.pi)) * ey + gain * turn
        return np.array([v, 0.0, w])

    def wheel_speeds(
        self, reference: Array, speed: tuple[float, float], pose: Array, robot: Robot
    ) -> Array:
        """Wheel speeds (W,), rad/s, of a differential drive at ``pose`` (3,) for the ``reference``
        pose (3,) that moves at ``speed`` (m/s, rad/s)."""
        twist = self.twist(reference, np.array([speed[0], 0.0, speed[1]]), pose, robot)
        return self.saturated(robot.inverse @ twist, robot)

    def saturated(self, speeds: Array, robot: Robot) -> Array:
        """Wheel speeds (W,), all scaled until no rim is faster than ``wheel_speed``."""
        rims = np.abs(speeds) * [wheel.radius for wheel in robot.wheels]
        return np.asarray(speeds / max(1.0, float(rims.max()) / self.wheel_speed))


class TrackingController:
    """A ``tracker`` along a trajectory, by wheel speeds and steering; see ``measured.Controller``.
    Between measurements the pose is that of odometry. Both are told in the ground plan: the posture
    is that of the plan."""

    def __init__(self, trajectory: Trajectory, tracker: Tracker, robot: Robot) -> None:
        count = int(np.ceil(trajectory.duration / PERIOD)) + 1
        self.times = np.minimum(PERIOD * np.arange(count), trajectory.duration)
        self.reference = trajectory.at(self.times)
        self.tracker, self.robot, self.duration = tracker, robot, trajectory.duration
        self._wheels = WheelCommands(robot)
        self._estimate = Estimate(self.reference.pose[0], np.diag(START_SD) ** 2)
        self._turned: Array | None = None
        self._steering = self.reference.steering_angles[0]
        turn = self.reference.rotation
        ahead = turn[:, :2, 0] / np.linalg.norm(turn[:, :2, 0], axis=1)[:, None]
        level = np.stack([ahead, np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)], axis=1)
        # of a body's twist what one sees from above, (N, 3, 3)
        self._seen = np.zeros((count, 3, 3))
        self._seen[:, :2, :2] = level @ turn[:, :2, :2]
        self._seen[:, 2, 2] = turn[:, 2, 2] / np.sum(turn[:, :2, 0] ** 2, axis=1)

    def step(self, t: float, measured: Measured) -> Targets:
        """Wheel speeds (W,) and steering angles to be reached a period after ``t`` (s)."""
        now = int(np.searchsorted(self.times, t - 1e-9).clip(0, len(self.times) - 1))
        steering = self._wheels.measured(self._steering, measured.swivels)
        if self._turned is not None:
            moved = self._wheels.twist(measured.wheel_angles - self._turned, steering)
            self._estimate = predict(self._estimate, self.robot, self._seen[now] @ moved)
        self._turned = measured.wheel_angles.copy()
        if measured.pose is not None:
            self._estimate = correct(self._estimate, measured.pose, measured.deviations)
        pose = np.array([np.interp(t, self.times, c) for c in self.reference.pose.T])
        after, moving = t + PERIOD, t + PERIOD < self.duration
        speed = np.array([np.interp(after, self.times, c) for c in self.reference.twist.T]) * moving
        seen = self._seen[now]
        wanted = self.tracker.twist(pose, seen @ speed, self._estimate.pose, self.robot)
        if moving:  # steered wheels turn from where the plan has them
            near = np.array([np.interp(after, self.times, c) for c in self._steered])
            steering[self._wheels.steering.steered] = near
        speeds, self._steering = self._wheels.at(np.linalg.solve(seen, wanted), steering)
        speeds = self.tracker.saturated(speeds, self.robot)
        return Targets(speeds, self._wheels.angles_of(self._steering))

    @cached_property
    def _steered(self) -> Array:
        """(S, N): planned angles of steered wheels."""
        return self.reference.steering_angles[:, self._wheels.steering.steered].T


def require_turning(robot: Robot) -> None:
    """Raises ArgumentError unless the robot drives along its heading and turns, as a differential
    drive does."""
    if robot.admissible.shape[1] != 2 or np.abs(robot.admissible[1]).max() > 1e-9:
        raise ArgumentError(
            "robot", robot.name, "a robot that drives along its heading and turns, without steering"
        )
