"""Closed loop for an approach: pose *and* critical wheel angles brought to the goal, through a path
re-solved ahead.

Every 100 ms what remains of the path is bent (``control.bend``). Phase is chased only as far as the
estimate can be trusted. At rest, what is left is shared between pose and phase by small moves on
the spot. Between re-solves a servo holds the wheels on the reference. The pose comes from wheel
encoders and a sparse pose measurement through an extended Kalman filter.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Literal, get_args

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.control.bend import TAIL_STRETCH, Goal, Reference, eased, reference_of, resolved
from trajopt.control.measured import Measured, Targets
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory
from trajopt.world.free_ground import FreeGround

Mode = Literal["pose and phase", "pose", "wheel servo"]

RESOLVE_EVERY = (
    0.1  # s between re-solves, from a prototype of this law; so are the next ones unless marked
)
LAST_RESOLVE = 0.05  # s before the end from which on the reference stays, chosen: after the prototype's 0.3 s the
# robot ended 3-4 mm off
SERVO_GAIN = 10.0  # 1/s, of the wheel position servo
ODOMETRY_NOISE = (
    0.06  # of the travel of a step, standard deviation: twice the 3 % of the simulators' error
)
# rad, chosen: what a bend can do to the phase is proportional to the turn that is left
LEAST_TURN = math.radians(30.0)
START_SD = (
    0.01,
    0.01,
    math.radians(1.0),
)  # m, m, rad: how well the start is known, standard deviations, chosen
TOUCH_UP_AFTER = (
    0.1  # s at rest before the first correction on the spot (servo and filter have settled), chosen
)
TOUCH_UP_TIME = 0.3  # s of one such correction, chosen
SETTLE = 1.2  # s after the reference's end in which corrections on the spot end, chosen
LEAST_DEVIATION = 1e-6  # m or rad, of a measurement that says it is exact; chosen
TOUCH_UPS = 2  # corrections on the spot at most, chosen
LEAST_TOUCH_UP = 0.01  # rad at a wheel (1 mm), chosen: smaller corrections are left


@dataclass(frozen=True, eq=False)
class Estimate:
    """Pose (3,) and its covariance (3, 3)."""

    pose: Array
    covariance: Array


def predict(estimate: Estimate, robot: Robot, step: Array) -> Estimate:
    """Estimate after a motion ``step`` (3,) (m, m, rad, in the body) that the wheels have measured
    (odometry)."""
    yaw = estimate.pose[2] + step[2] / 2
    cos, sin = math.cos(yaw), math.sin(yaw)
    moved = np.array([cos * step[0] - sin * step[1], sin * step[0] + cos * step[1], step[2]])
    slope = np.eye(3)
    slope[0, 2], slope[1, 2] = -moved[1], moved[0]
    travel = math.hypot(moved[0], moved[1]) + robot.turning_length * abs(moved[2])
    noise = ODOMETRY_NOISE * travel * np.array([1.0, 1.0, 1.0 / robot.turning_length])
    return Estimate(
        estimate.pose + moved, slope @ estimate.covariance @ slope.T + np.diag(noise**2)
    )


def correct(estimate: Estimate, pose: Array, deviations: Array) -> Estimate:
    """Estimate after a measured pose (3,) with standard ``deviations`` (3,), m, m, rad."""
    noise = np.diag(np.maximum(deviations, LEAST_DEVIATION) ** 2)
    gain = estimate.covariance @ np.linalg.inv(estimate.covariance + noise)
    error = pose - estimate.pose
    error[2] = fold(error[2])
    return Estimate(estimate.pose + gain @ error, (np.eye(3) - gain) @ estimate.covariance)


def _on_the_spot(goal: Goal, t: float) -> Reference:
    """Standing at the goal from ``t`` (s) on while the progress goes smoothly from 0 to 1."""
    part = np.linspace(0.0, 1.0, 31)
    progress = part**2 * (3 - 2 * part)
    return Reference(
        t + TOUCH_UP_TIME * part,
        progress,
        np.tile(goal.pose, (len(part), 1)),
        np.tile(goal.wheels, (len(part), 1)),
    )


@dataclass
class ApproachController:
    """Wheel speeds from time and measurements; see ``measured.Controller``.

    Raises ArgumentError where the manoeuvre turns too little for its wheel phase to be corrected.
    """

    robot: Robot
    reference: Reference
    goal: Goal
    estimate: Estimate
    mode: Mode
    _last_wheels: Array | None = None
    _next_solve: float = field(default=RESOLVE_EVERY)
    _touch_ups: int = 0

    def __post_init__(self) -> None:
        if self.mode not in get_args(Mode):
            raise ArgumentError("mode", self.mode, "one of " + ", ".join(get_args(Mode)))
        turn = abs(float(self.reference.pose[-1, 2] - self.reference.pose[0, 2]))
        if self.mode == "pose and phase" and turn < LEAST_TURN:
            raise ArgumentError(
                "trajectory",
                f"a turn of {math.degrees(turn):.1f} deg",
                f"at least {math.degrees(LEAST_TURN):.0f} deg of turn: with less, wheel phase cannot "
                "be corrected on the way (switch on feedback of the pose alone)",
            )

    def step(self, t: float, measured: Measured) -> Targets:
        """Wheel speeds (W,) at ``t`` (s)."""
        wheels = measured.wheel_angles
        if self._last_wheels is not None:
            self.estimate = predict(
                self.estimate, self.robot, self.robot.forward @ (wheels - self._last_wheels)
            )
        self._last_wheels = wheels.copy()
        if measured.pose is not None:
            self.estimate = correct(self.estimate, measured.pose, measured.deviations)
        if self.mode != "wheel servo" and t >= self._next_solve - 1e-9:
            self._next_solve += RESOLVE_EVERY
            left = self.reference.times[-1] - t
            if left > LAST_RESOLVE:
                self._resolve(t, wheels)
            elif left <= -TOUCH_UP_AFTER and self._touch_ups < TOUCH_UPS:
                self._touch_up(t, wheels)
        angle, speed = self.reference.wheels_at(t)
        return Targets(np.asarray(speed + SERVO_GAIN * (angle - wheels)))

    def _resolve(self, t: float, wheels: Array) -> None:
        """Bend what remains of the path."""
        place = math.sqrt(
            float(np.trace(self.estimate.covariance[:2, :2])) / 2
        )  # m, standard deviation
        doubt = place * float(np.abs(self.robot.inverse[:, 0]).max())
        self.reference = resolved(
            self.reference,
            t,
            self.estimate.pose,
            wheels,
            self.goal,
            self.robot,
            phase=self.mode == "pose and phase",
            doubt=doubt,
        )

    def _touch_up(self, t: float, wheels: Array) -> None:
        """Move on the spot where that brings pose and phase nearer to the goal by more than a
        millimetre."""
        moved = resolved(
            _on_the_spot(self.goal, t),
            t,
            self.estimate.pose,
            wheels,
            self.goal,
            self.robot,
            phase=self.mode == "pose and phase",
        )
        if np.max(np.abs(moved.wheels[-1] - wheels)) > LEAST_TOUCH_UP:
            self._touch_ups += 1
            self.reference = moved


def approach_controller(
    trajectory: Trajectory,
    robot: Robot,
    wheels: Array,
    critical: tuple[int, ...],
    *,
    cap: float,
    goal_wheels: Array | None = None,
    ground: FreeGround | None = None,
    mode: Mode = "pose and phase",
) -> ApproachController:
    """Controller for a planned trajectory that starts with measured wheel angles ``wheels`` (W,),
    rad.

    ``mode``: "wheel servo" holds the wheels on their planned angles, "pose" brings the pose to the
    goal, "pose and phase" also the wheels ``critical`` (indices, 0 = front-left). ``goal_wheels``
    (W,), rad: wanted at the end; None: what the plan makes of ``wheels``. ``ground``: where bends
    for the phase keep the footprint (feedback of the pose alone does not look at it); None:
    anywhere. ``cap``: wheel speed (rad/s) above which time is stretched; bringing the phase to the
    goal also takes a slower end (``TAIL_STRETCH``). The pose estimate starts at the plan's start
    with the standard deviations START_SD. Raises ArgumentError for too little turn.
    """
    reference = reference_of(trajectory, wheels)
    if mode == "pose and phase":
        reference = eased(reference, TAIL_STRETCH)
    wanted = reference.wheels[-1] if goal_wheels is None else goal_wheels
    goal = Goal(reference.pose[-1], wanted, critical, cap, ground)
    start = Estimate(reference.pose[0], np.diag(START_SD) ** 2)
    return ApproachController(robot, reference, goal, start, mode)
