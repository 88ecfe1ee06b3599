"""The path ahead, bent so that an approach ends at its goal in pose *and* in critical wheel angles.

Wheel angles at the end depend on the shape of the path, so a deviation of pose or of wheel phase is
corrected by bending what remains: p_new(sigma) = p_ref + e (1 - sigma) + g sigma + b(sigma) q +
sigma f, with e the deviation now, g what the reference misses at its end, and q, f chosen by
Gauss-Newton steps so that the critical wheels end at their angles and the footprint stays on free
ground. b = 6.75 sigma^2 (1 - sigma) leaves the present speed as it is: a parabola's jump of speed
made the wheels slip, and the estimate with them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory
from trajopt.world.free_ground import FreeGround

WHEEL_WEIGHT = (
    0.015  # rad, residual of a critical wheel that counts 1, from a prototype of this law
)
BEND_WEIGHT = (
    0.1  # of the remaining length (m), and of the smaller of 1 rad and L/0.5 m: bend that counts 1
)
# Pose given up at the end that counts 1 (m, m, rad), chosen: with the prototype's four times as
# much the last part of the path, which can no longer turn the wheels, gives up 4 mm for phase that
# is within its tolerance anyway.
END_WEIGHT = (0.001, 0.001, math.radians(0.1))
BUMP = 6.75  # makes the largest value of sigma^2 (1 - sigma) 1
# The second half of the path is taken ever slower, at its end by this factor, chosen: hard braking
# creeps in one direction, at the end of the path, where nothing is left that could turn the wheels.
TAIL_STRETCH = 1.8
SAMPLES = 241  # of a trajectory, chosen: 15 ms on 3.5 s
_STEP = 1e-5  # m or rad, for difference quotients
ROOM = 0.01  # m between footprint and any border that a bent path keeps, chosen: rollers reach 5 mm further out
ROOM_WEIGHT = 0.001  # m, room missing that counts 1, chosen
ROOM_EVERY = 8  # of the samples of a path at which its room is asked for, chosen: 3 cm at most
GAUSS_NEWTON_STEPS = 2  # of the prototype; while a bent path lacks room, up to MOST_STEPS
MOST_STEPS = 8  # chosen
HALVINGS = 5  # of a bend that still lacks room, chosen


@dataclass(frozen=True, eq=False)
class Reference:
    """Motion to be followed: ``times`` (N,) s, ``progress`` (N,) along the path, ``pose`` (N, 3),
    ``wheels`` (N, W)."""

    times: Array
    progress: Array
    pose: Array
    wheels: Array

    def wheels_at(self, t: float) -> tuple[Array, Array]:
        """Wheel angles (rad) and speeds (rad/s) at a time; at rest after the end."""
        if t >= self.times[-1]:
            return self.wheels[-1], np.zeros(self.wheels.shape[1])
        i = max(int(np.searchsorted(self.times, t, side="right")) - 1, 0)
        speed = (self.wheels[i + 1] - self.wheels[i]) / (self.times[i + 1] - self.times[i])
        return self.wheels[i] + speed * (t - self.times[i]), speed

    def at(self, t: float) -> tuple[float, Array]:
        """Progress and pose (3,) at a time."""
        pose = [np.interp(t, self.times, column) for column in self.pose.T]
        return float(np.interp(t, self.times, self.progress)), np.array(pose)


def reference_of(trajectory: Trajectory, wheels: Array) -> Reference:
    """Reference of a planned trajectory; ``wheels`` (W,) are the wheel angles (rad) it starts
    with."""
    times = np.linspace(0.0, trajectory.duration, SAMPLES)
    state = trajectory.at(times)
    s, _, _ = trajectory.along(times)
    turned = state.wheel_angles - trajectory.start_wheels
    return Reference(times, s / trajectory.path.length, state.pose, wheels + turned)


def eased(reference: Reference, stretch: float) -> Reference:
    """The reference with pieces of its second half lasting 1 to ``stretch`` times as long, more the
    later they are."""
    middle = (reference.progress[1:] + reference.progress[:-1]) / 2
    slower = 1 + (stretch - 1) * np.clip(2 * middle - 1, 0.0, 1.0)
    times = reference.times[0] + np.concatenate(
        [[0.0], np.cumsum(np.diff(reference.times) * slower)]
    )
    return replace(reference, times=times)


def wheel_path(robot: Robot, pose: Array) -> Array:
    """(..., N, W): wheel angles gained along poses (..., N, 3), heading taken in the middle of each
    piece."""
    step, yaw = np.diff(pose, axis=-2), (pose[..., 1:, 2] + pose[..., :-1, 2]) / 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx, dy = step[..., 0], step[..., 1]
    body = np.stack([cos * dx + sin * dy, cos * dy - sin * dx, step[..., 2]], axis=-1)
    gained = np.cumsum(body @ robot.inverse.T, axis=-2)
    return np.concatenate([np.zeros_like(gained[..., :1, :]), gained], axis=-2)


@dataclass(frozen=True, eq=False)
class Goal:
    """``pose`` (3,) and ``wheels`` (W,) wanted at the end, of which ``critical`` (indices) count;
    ``cap`` rad/s.

    ``ground``: where the footprint may be on the way; None: anywhere.
    """

    pose: Array
    wheels: Array
    critical: tuple[int, ...]
    cap: float
    ground: FreeGround | None = None


def resolved(
    reference: Reference,
    t: float,
    estimate: Array,
    wheels: Array,
    goal: Goal,
    robot: Robot,
    *,
    phase: bool = True,
    doubt: float = 0.0,
) -> Reference:
    """The reference from ``t`` (s) on, bent so that it starts at the estimate (3,) and ends at the
    goal.

    ``wheels`` (W,) are the measured angles. Without ``phase`` only the pose is brought to the goal.
    ``doubt`` (rad): standard deviation of the wheel angles that the estimate's uncertainty amounts
    to; nothing below it is chased. Where the bend needs wheels faster than the goal's cap, or finds
    no room on its ground, this path gives the phase up; the next one, 100 ms later, tries again.
    """
    now, here = reference.at(t)
    ahead = reference.times > t + 1e-9
    times = np.concatenate([[t], reference.times[ahead]])
    progress = np.concatenate([[now], reference.progress[ahead]])
    base = np.vstack([here, reference.pose[ahead]])
    sigma = ((progress - now) / (progress[-1] - now))[:, None]
    base = base + (estimate - here) * (1 - sigma) + (goal.pose - reference.pose[-1]) * sigma
    pose = (
        _bent(base, sigma, _solve_bend(base, sigma, wheels, goal, robot, doubt)) if phase else base
    )
    angles = wheels + wheel_path(robot, pose)
    if (
        phase and _fastest(angles, times) > goal.cap
    ):  # what is left is too short for the phase: it would slip
        pose, angles = base, wheels + wheel_path(robot, base)
    fastest = _fastest(angles, times)
    return Reference(t + (times - t) * max(1.0, fastest / goal.cap), progress, pose, angles)


def _fastest(angles: Array, times: Array) -> float:
    """Largest wheel speed, rad/s."""
    return float(np.max(np.abs(np.diff(angles, axis=0)) / np.diff(times)[:, None]))


def _bent(base: Array, sigma: Array, z: Array) -> Array:
    """(..., N, 3): poses for bends z (..., 6) = (q, f)."""
    z = z[..., None, :]
    return np.asarray(base + BUMP * sigma**2 * (1 - sigma) * z[..., :3] + sigma * z[..., 3:])


def _solve_bend(
    base: Array, sigma: Array, wheels: Array, goal: Goal, robot: Robot, doubt: float
) -> Array:
    """(6,): Gauss-Newton steps on weighted wheel errors, bends and missing room."""
    length = max(float(np.sum(np.hypot(*np.diff(base[:, :2], axis=0).T))), 1e-3)
    swing = BEND_WEIGHT * min(1.0, length / 0.5)
    weights = 1.0 / np.array([BEND_WEIGHT * length, BEND_WEIGHT * length, swing, *END_WEIGHT])
    critical, scale = list(goal.critical), math.hypot(WHEEL_WEIGHT, doubt)
    # No bend can give more room than the path has where it starts and ends.
    needed = min(ROOM, float(_rooms(base[[0, -1]], goal).min()))

    def residuals(z: Array) -> Array:
        poses = _bent(base, sigma, z)
        end = wheels + wheel_path(robot, poses)[..., -1, :]
        lacking = np.maximum(needed - _rooms(poses[..., ::ROOM_EVERY, :], goal), 0.0) / ROOM_WEIGHT
        return np.concatenate(
            [(end - goal.wheels)[..., critical] / scale, z * weights, lacking], axis=-1
        )

    def has_room(z: Array) -> bool:
        return float(_rooms(_bent(base, sigma, z), goal).min()) >= needed - ROOM_WEIGHT

    z = np.zeros(6)
    for k in range(MOST_STEPS):
        if k >= GAUSS_NEWTON_STEPS and has_room(z):
            break
        r = residuals(z)
        slope = (residuals(z + _STEP * np.eye(6)) - r).T / _STEP
        z = z - np.linalg.lstsq(slope, r, rcond=None)[0]
    for _ in range(HALVINGS):
        if has_room(z):
            return z
        z = z / 2
    return z if has_room(z) else np.zeros(6)


def _rooms(poses: Array, goal: Goal) -> Array:
    """(..., N): least distance (m) of the footprint from a border at poses (..., N, 3); inf on
    endless ground."""
    if goal.ground is None:
        return np.full(poses.shape[:-1], math.inf)
    return goal.ground.margin(poses[..., 0], poses[..., 1], poses[..., 2])
