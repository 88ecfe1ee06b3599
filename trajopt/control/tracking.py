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
from numpy.random import Generator

from trajopt.arrays import Array, fold, require_not_negative, require_positive
from trajopt.control.commands import half_track
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory


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
        self, reference: Array, speed: tuple[float, float], pose: Array, width: float
    ) -> tuple[float, float]:
        """Left and right wheel speed (m/s) at ``pose`` (3,) for the ``reference`` pose (3,) that
        moves at ``speed`` (m/s, rad/s); ``width`` (m) between the wheels."""
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
        left, right = v - w * width / 2, v + w * width / 2
        most = max(abs(left), abs(right))
        scale = min(1.0, self.wheel_speed / most) if most > 0 else 1.0
        return float(left * scale), float(right * scale)


@dataclass(frozen=True)
class Disturbance:
    """What separates the robot from the plan: ``start`` error (m, m, rad, in the body frame) and
    wheels that turn by ``left`` and ``right`` (relative) more than commanded, with white ``noise``
    (relative, each step)."""

    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    left: float = 0.0
    right: float = 0.0
    noise: float = 0.0


@dataclass(frozen=True, eq=False)
class Tracked:
    """A tracked run: ``times`` (N,), ``pose`` and ``reference`` (N, 3), wheel speeds ``left``,
    ``right`` (N,)."""

    times: Array
    pose: Array
    reference: Array
    left: Array
    right: Array

    @property
    def errors(self) -> Array:
        """(N, 2): distance (m) and heading (rad) between robot and reference."""
        d = self.pose - self.reference
        return np.column_stack([np.hypot(d[:, 0], d[:, 1]), np.abs(fold(d[:, 2]))])


def track(
    trajectory: Trajectory,
    tracker: Tracker | None,
    robot: Robot,
    *,
    sample_time: float,
    disturbance: Disturbance,
    rng: Generator,
) -> Tracked:
    """Drive a kinematic robot along ``trajectory``: closed loop with a tracker, open loop without
    (None).

    The tracker knows the true pose every ``sample_time`` (s) and its wheel speeds are held in
    between. Raises ArgumentError for a sample time that is not positive or a robot that is no
    differential drive.
    """
    require_positive("sample_time", sample_time, "s")
    width = 2 * half_track(robot)
    steps = int(np.ceil((trajectory.duration + (tracker.settle if tracker else 0.0)) / sample_time))
    times = sample_time * np.arange(steps + 1, dtype=np.float64)
    state = trajectory.at(np.minimum(times, trajectory.duration))
    middle = trajectory.at(np.minimum(times + sample_time / 2, trajectory.duration))
    moving = times + sample_time / 2 <= trajectory.duration
    pose = state.pose[0].copy()
    cos, sin = np.cos(pose[2]), np.sin(pose[2])
    dx, dy, turn = disturbance.start
    pose += [cos * dx - sin * dy, sin * dx + cos * dy, turn]
    poses, sent = [pose.copy()], []
    for k in range(steps):
        v, w = (float(middle.twist[k, 0]), float(middle.twist[k, 2])) if moving[k] else (0.0, 0.0)
        orders = (
            (v - w * width / 2, v + w * width / 2)
            if tracker is None
            else tracker.wheel_speeds(state.pose[k], (v, w), pose, width)
        )
        sent.append(orders)
        real = np.array(orders) * (
            1
            + np.array([disturbance.left, disturbance.right])
            + disturbance.noise * rng.standard_normal(2)
        )
        pose = _stepped(pose, real, width, sample_time)
        poses.append(pose.copy())
    given = np.array([*sent, (0.0, 0.0)])
    return Tracked(times, np.array(poses), state.pose, given[:, 0], given[:, 1])


def _stepped(pose: Array, wheels: Array, width: float, time: float) -> Array:
    """Pose after ``time`` (s) at constant wheel speeds (left, right): an arc."""
    v, turn = wheels.mean(), (wheels[1] - wheels[0]) / width * time
    chord = v * time * np.sinc(turn / (2 * np.pi))
    middle = pose[2] + turn / 2
    return np.asarray(pose + np.array([chord * np.cos(middle), chord * np.sin(middle), turn]))
