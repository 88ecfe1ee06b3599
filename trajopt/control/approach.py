"""Closed loop for an approach: pose *and* critical wheel angles brought to the goal, through a path re-solved ahead.

Wheel angles at the end depend on the shape of the path, so a deviation of pose or of wheel phase is corrected by
bending what remains: p_new(sigma) = p_ref + e (1 - sigma) + g sigma + b(sigma) q + sigma f, with e the deviation
now, g what the reference misses at its end, and q, f chosen by two Gauss-Newton steps so that the critical wheels
end at their angles. b = 6.75 sigma^2 (1 - sigma) leaves the present speed as it is: a parabola's jump of speed made
the wheels slip, and the estimate with them. Phase is chased only as far as the estimate can be trusted. At rest,
what is left is shared between pose and phase by small moves on the spot. Between re-solves a servo holds the wheels
on the reference. The pose comes from wheel encoders and a sparse pose measurement through an extended Kalman filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from trajopt.errors import ArgumentError
from trajopt.robots.platform import Platform
from trajopt.timing.trajectory import Trajectory

Array = NDArray[np.float64]
Mode = Literal["pose and phase", "pose", "open loop"]

RESOLVE_EVERY = 0.1  # s between re-solves, from a prototype of this law; so are the next ones unless marked
LAST_RESOLVE = 0.05  # s before the end from which on the reference stays, chosen: after the prototype's 0.3 s the
# robot ended 3-4 mm off
SERVO_GAIN = 10.0  # 1/s, of the wheel position servo
WHEEL_WEIGHT = 0.015  # rad, residual of a critical wheel that counts 1
BEND_WEIGHT = 0.1  # of the remaining length (m), and of the smaller of 1 rad and L/0.5 m: bend that counts 1
# Pose given up at the end that counts 1 (m, m, rad), chosen: with the prototype's four times as much the last part of
# the path, which can no longer turn the wheels, gives up 4 mm for phase that is within its tolerance anyway.
END_WEIGHT = (0.001, 0.001, math.radians(0.1))
ODOMETRY_NOISE = 0.06  # of the travel of a step, standard deviation: twice the 3 % of the simulators' error
LEAST_TURN = math.radians(30.0)  # rad; with less turn the phase can hardly be corrected
TOUCH_UP_AFTER = 0.1  # s at rest before the first correction on the spot (servo and filter have settled), chosen
TOUCH_UP_TIME = 0.3  # s of one such correction, chosen
TOUCH_UPS = 2  # at most, chosen
LEAST_TOUCH_UP = 0.01  # rad at a wheel (1 mm), chosen: smaller corrections are left
BUMP = 6.75  # makes the largest value of sigma^2 (1 - sigma) 1
SAMPLES = 241  # of a trajectory, chosen: 15 ms on 3.5 s
_STEP = 1e-5  # m or rad, for difference quotients


@dataclass(frozen=True)
class Sensors:
    """Pose measurement every ``period`` (s) with standard deviations ``position`` (m) and ``yaw`` (rad)."""

    period: float = 0.05
    position: float = 0.005
    yaw: float = math.radians(0.5)

    def __post_init__(self) -> None:
        if not (self.period > 0 and self.position >= 0 and self.yaw >= 0):
            raise ArgumentError("sensors", (self.period, self.position, self.yaw), "a period > 0 and deviations >= 0")


@dataclass(frozen=True, eq=False)
class Reference:
    """Motion to be followed: ``times`` (N,) s, ``progress`` (N,) along the path, ``pose`` (N, 3), ``wheels`` (N, W)."""

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


@dataclass(frozen=True, eq=False)
class Estimate:
    """Pose (3,) and its covariance (3, 3)."""

    pose: Array
    covariance: Array


def reference_of(trajectory: Trajectory, wheels: Array) -> Reference:
    """Reference of a planned trajectory; ``wheels`` (W,) are the wheel angles (rad) it starts with."""
    times = np.linspace(0.0, trajectory.duration, SAMPLES)
    state = trajectory.at(times)
    s, _, _ = trajectory.along(times)
    return Reference(times, s / trajectory.path.length, state.pose, wheels + state.wheel_angles)


def predict(estimate: Estimate, robot: Platform, turned: Array) -> Estimate:
    """Estimate after the wheels turned by ``turned`` (W,) rad (odometry)."""
    step = robot.forward @ turned
    yaw = estimate.pose[2] + step[2] / 2
    cos, sin = math.cos(yaw), math.sin(yaw)
    moved = np.array([cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2]])
    slope = np.eye(3)
    slope[0, 2], slope[1, 2] = -moved[1], moved[0]
    travel = math.hypot(moved[0], moved[1]) + robot.turning_length * abs(moved[2])
    noise = ODOMETRY_NOISE * travel * np.array([1.0, 1.0, 1.0 / robot.turning_length])
    return Estimate(estimate.pose + moved, slope @ estimate.covariance @ slope.T + np.diag(noise**2))


def correct(estimate: Estimate, measured: Array, sensors: Sensors) -> Estimate:
    """Estimate after a pose measurement (3,)."""
    noise = np.diag(np.maximum([sensors.position, sensors.position, sensors.yaw], 1e-6) ** 2)
    gain = estimate.covariance @ np.linalg.inv(estimate.covariance + noise)
    error = measured - estimate.pose
    error[2] = (error[2] + math.pi) % (2 * math.pi) - math.pi
    return Estimate(estimate.pose + gain @ error, (np.eye(3) - gain) @ estimate.covariance)


def wheel_path(robot: Platform, pose: Array) -> Array:
    """(..., N, W): wheel angles gained along poses (..., N, 3), heading taken in the middle of each piece."""
    step, yaw = np.diff(pose, axis=-2), (pose[..., 1:, 2] + pose[..., :-1, 2]) / 2
    cos, sin = np.cos(yaw), np.sin(yaw)
    dx, dy = step[..., 0], step[..., 1]
    body = np.stack([cos * dx + sin * dy, cos * dy - sin * dx, step[..., 2]], axis=-1)
    gained = np.cumsum(body @ robot.inverse.T, axis=-2)
    return np.concatenate([np.zeros_like(gained[..., :1, :]), gained], axis=-2)


@dataclass(frozen=True, eq=False)
class Goal:
    """``pose`` (3,) and ``wheels`` (W,) wanted at the end, of which ``critical`` (indices) count; ``cap`` rad/s."""

    pose: Array
    wheels: Array
    critical: tuple[int, ...]
    cap: float


def resolved(reference: Reference, t: float, estimate: Array, wheels: Array, goal: Goal, robot: Platform,
             *, phase: bool = True, doubt: float = 0.0) -> Reference:
    """The reference from ``t`` (s) on, bent so that it starts at the estimate (3,) and ends at the goal.

    ``wheels`` (W,) are the measured angles. Without ``phase`` only the pose is brought to the goal. ``doubt`` (rad):
    standard deviation of the wheel angles that the estimate's uncertainty amounts to; nothing below it is chased.
    """
    now, here = reference.at(t)
    ahead = reference.times > t + 1e-9
    times = np.concatenate([[t], reference.times[ahead]])
    progress = np.concatenate([[now], reference.progress[ahead]])
    base = np.vstack([here, reference.pose[ahead]])
    sigma = ((progress - now) / (progress[-1] - now))[:, None]
    base = base + (estimate - here) * (1 - sigma) + (goal.pose - reference.pose[-1]) * sigma
    pose = _bent(base, sigma, _solve_bend(base, sigma, wheels, goal, robot, doubt)) if phase else base
    angles = wheels + wheel_path(robot, pose)
    if phase and _fastest(angles, times) > goal.cap:  # what is left is too short for the phase: it would slip
        pose, angles = base, wheels + wheel_path(robot, base)
    fastest = _fastest(angles, times)
    return Reference(t + (times - t) * max(1.0, fastest / goal.cap), progress, pose, angles)


def _fastest(angles: Array, times: Array) -> float:
    """Largest wheel speed, rad/s."""
    return float(np.max(np.abs(np.diff(angles, axis=0)) / np.diff(times)[:, None]))


def _on_the_spot(goal: Goal, t: float) -> Reference:
    """Standing at the goal from ``t`` (s) on while the progress goes smoothly from 0 to 1."""
    part = np.linspace(0.0, 1.0, 31)
    progress = part**2 * (3 - 2 * part)
    return Reference(t + TOUCH_UP_TIME * part, progress, np.tile(goal.pose, (len(part), 1)),
                     np.tile(goal.wheels, (len(part), 1)))


def _bent(base: Array, sigma: Array, z: Array) -> Array:
    """(..., N, 3): poses for bends z (..., 6) = (q, f)."""
    z = z[..., None, :]
    return np.asarray(base + BUMP * sigma**2 * (1 - sigma) * z[..., :3] + sigma * z[..., 3:])


def _solve_bend(base: Array, sigma: Array, wheels: Array, goal: Goal, robot: Platform, doubt: float) -> Array:
    """(6,): two Gauss-Newton steps on weighted wheel errors and bends."""
    length = max(float(np.sum(np.hypot(*np.diff(base[:, :2], axis=0).T))), 1e-3)
    swing = BEND_WEIGHT * min(1.0, length / 0.5)
    weights = 1.0 / np.array([BEND_WEIGHT * length, BEND_WEIGHT * length, swing, *END_WEIGHT])
    critical, scale = list(goal.critical), math.hypot(WHEEL_WEIGHT, doubt)

    def residuals(z: Array) -> Array:
        end = wheels + wheel_path(robot, _bent(base, sigma, z))[..., -1, :]
        return np.concatenate([(end - goal.wheels)[..., critical] / scale, z * weights], axis=-1)

    z = np.zeros(6)
    for _ in range(2):
        r = residuals(z)
        slope = (residuals(z + _STEP * np.eye(6)) - r).T / _STEP
        z = z - np.linalg.lstsq(slope, r, rcond=None)[0]
    return z


@dataclass
class ApproachController:
    """Wheel speeds from time and measurements; ``step`` is called at every control period. Lives for one run.

    Raises ArgumentError where the manoeuvre turns too little for its wheel phase to be corrected.
    """

    robot: Platform
    reference: Reference
    goal: Goal
    estimate: Estimate
    sensors: Sensors
    mode: Mode
    rng: Generator
    _last_wheels: Array | None = None
    _next_measurement: float = 0.0
    _next_solve: float = field(default=RESOLVE_EVERY)
    _touch_ups: int = 0

    def __post_init__(self) -> None:
        turn = abs(float(self.reference.pose[-1, 2] - self.reference.pose[0, 2]))
        if self.mode == "pose and phase" and turn < LEAST_TURN:
            raise ArgumentError("trajectory", f"a turn of {math.degrees(turn):.1f} deg", "at least 30 deg of turn: "
                                "with less, wheel phase cannot be corrected on the way (use mode 'pose')")

    def step(self, t: float, pose: Array, wheels: Array) -> Array:
        """Wheel speeds (W,) at ``t`` (s). ``pose`` (3,): the true one, which the sensor blurs; ``wheels`` (W,), rad."""
        if self._last_wheels is not None:
            self.estimate = predict(self.estimate, self.robot, wheels - self._last_wheels)
        self._last_wheels = wheels.copy()
        if t >= self._next_measurement - 1e-9:
            s = self.sensors
            blur = self.rng.normal(0.0, 1.0, 3) * [s.position, s.position, s.yaw]
            self.estimate = correct(self.estimate, pose + blur, s)
            self._next_measurement += s.period
        left = self.reference.times[-1] - t
        if self.mode != "open loop" and t >= self._next_solve - 1e-9 and left > LAST_RESOLVE:
            place = math.sqrt(float(np.trace(self.estimate.covariance[:2, :2])) / 2)  # m, standard deviation
            doubt = place * float(np.abs(self.robot.inverse[:, 0]).max())
            self.reference = resolved(self.reference, t, self.estimate.pose, wheels, self.goal, self.robot,
                                      phase=self.mode == "pose and phase", doubt=doubt)
            self._next_solve += RESOLVE_EVERY
        if self.mode != "open loop" and left <= -TOUCH_UP_AFTER and self._touch_ups < TOUCH_UPS:
            self._touch_up(t, wheels)
        angle, speed = self.reference.wheels_at(t)
        return np.asarray(speed + SERVO_GAIN * (angle - wheels))

    def _touch_up(self, t: float, wheels: Array) -> None:
        """Move on the spot where that brings pose and phase nearer to the goal by more than a millimetre."""
        self._touch_ups += 1
        moved = resolved(_on_the_spot(self.goal, t), t, self.estimate.pose, wheels, self.goal, self.robot,
                         phase=self.mode == "pose and phase")
        if np.max(np.abs(moved.wheels[-1] - wheels)) > LEAST_TOUCH_UP:
            self.reference = moved


def approach_controller(trajectory: Trajectory, robot: Platform, wheels: Array, critical: tuple[int, ...], *,
                        cap: float, sensors: Sensors | None = None, mode: Mode = "pose and phase",
                        rng: Generator) -> ApproachController:
    """Controller for a planned trajectory that starts with wheel angles ``wheels`` (W,), rad.

    ``cap``: wheel speed (rad/s) above which time is stretched. The pose estimate starts at the plan's start with
    a standard deviation of 1 cm and 1 deg. Raises ArgumentError for too little turn.
    """
    reference = reference_of(trajectory, wheels)
    goal = Goal(reference.pose[-1], reference.wheels[-1], critical, cap)
    start = Estimate(reference.pose[0], np.diag([0.01, 0.01, math.radians(1.0)]) ** 2)
    return ApproachController(robot, reference, goal, start, Sensors() if sensors is None else sensors, mode, rng)


