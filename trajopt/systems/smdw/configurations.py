"""Which ways there are to meet a step, and where the robot and its wheels must stand for each.

For every configuration that can climb the step ([guzman2015], section 4.1.6): the pose in which the
leading wheel will meet the step at the wanted place, and the wheel angles that, after rolling over
the remaining gap, are in the middle of the window of angles that climb.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, fold, rotation
from trajopt.errors import ArgumentError
from trajopt.problem import Problem
from trajopt.robots.robot import Robot
from trajopt.systems.smdw.climbing import (
    LARGEST_FORWARD_ALPHA,
    Motion,
    Window,
    climb_window,
    collision_reach,
    forward_alphas,
    refusal,
)
from trajopt.systems.smdw.entry import WHEELS, start_pose, step_of
from trajopt.systems.smdw.geometry import DoubleWheel
from trajopt.world.obstacles import Step

THESIS_ALPHAS = (
    math.radians(35.0),
    math.radians(45.0),
)  # rad, [guzman2015] section 4.1.6, either sign


LARGEST_TURN = math.pi / 2  # rad, [guzman2015] section 4.1.6: "does not exceed a quarter turn"


@dataclass(frozen=True)
class Configuration:
    """A way to meet a step: ``alpha`` (rad) from the step's normal to the direction of motion,
    counter-clockwise.

    ``window`` holds the wheel angles that climb, along the commanded rotation, when the wheel meets
    the step. ``yaw`` (rad) is the robot's in the world, ``critical`` the wheels that meet the step
    first.
    """

    motion: Motion
    alpha: float
    window: Window
    yaw: float
    critical: tuple[str, str]

    @property
    def name(self) -> str:
        return (
            self.motion.value
            if self.motion.lateral
            else f"forward {math.degrees(self.alpha):+.0f} deg"
        )

    @property
    def direction(self) -> tuple[float, float]:
        """Unit vector of the motion in the body frame."""
        return {Motion.FORWARD: (1.0, 0.0), Motion.LEFT: (0.0, 1.0), Motion.RIGHT: (0.0, -1.0)}[
            self.motion
        ]

    @property
    def faces_left(self) -> bool:
        """Whether the robot's left side is nearer to the step."""
        return self.motion is Motion.LEFT or (self.motion is Motion.FORWARD and self.alpha < 0)


@dataclass(frozen=True)
class Target:
    """Where an approach ends: ``pose``, ``wheels`` (4,) and, for each critical wheel, the
    ``travel`` (m) left to the step along the motion."""

    pose: tuple[float, float, float]
    wheels: tuple[float, float, float, float]
    travel: tuple[float, float]


def configurations(
    wheel: DoubleWheel,
    obstacle: Step,
    start_yaw: float = 0.0,
    alphas: Sequence[float] | None = None,
) -> tuple[Configuration, ...]:
    """All configurations that can climb the obstacle after at most a quarter turn from
    ``start_yaw`` (rad).

    Lateral with alpha 0, left or right side first; forward with ``alphas`` (rad), None for the
    thesis's 35 and 45 deg, either sign, where the geometry allows them, and otherwise the middle of
    what it allows. Raises ArgumentError for a step that the wheel cannot climb at all, and for
    alphas of which it allows none.
    """
    reason = refusal(wheel, Motion.LEFT, 0.0, obstacle.height)
    if reason:
        raise ArgumentError(
            f"obstacles.{obstacle.name}.height", obstacle.height, f"a lower step: {reason}"
        )
    span = forward_alphas(wheel, obstacle.height)
    inside: list[float] = []
    if span is not None:
        largest = min(span[1] + 1e-3, LARGEST_FORWARD_ALPHA)
        tried = THESIS_ALPHAS if alphas is None else [abs(a) for a in alphas]
        inside = [a for a in tried if span[0] <= a <= largest]
        if not inside and alphas is None:
            inside = [sum(span) / 2]
    if alphas is not None and not inside:
        allowed = "none" if span is None else f"some between {span[0]:.4g} and {largest:.4g} rad"
        raise ArgumentError("climb.alphas", list(alphas), f"{allowed} for this step")
    wanted = [
        (Motion.LEFT, 0.0),
        (Motion.RIGHT, 0.0),
        *((Motion.FORWARD, s * a) for a in inside for s in (-1, 1)),
    ]
    found = (_configuration(wheel, obstacle, motion, alpha, start_yaw) for motion, alpha in wanted)
    return tuple(
        c for c in found if c is not None and abs(c.yaw - start_yaw) <= LARGEST_TURN + 1e-9
    )


def configurations_of(problem: Problem) -> tuple[Configuration, ...]:
    """Those of a problem's step and robot. Raises ArgumentError as ``configurations``."""
    yaw = start_pose(problem)[2]
    return configurations(wheel_of(problem), step_of(problem), yaw, problem.climb.alphas)


def wheel_of(problem: Problem) -> DoubleWheel:
    """The sizes of the robot's double wheels."""
    return DoubleWheel.of(problem.robot.rolling[0])


def _configuration(
    wheel: DoubleWheel, obstacle: Step, motion: Motion, alpha: float, start_yaw: float
) -> Configuration | None:
    window = climb_window(wheel, motion, alpha, obstacle.height)
    if window is None:
        return None
    sideways = {Motion.FORWARD: 0.0, Motion.LEFT: -math.pi / 2, Motion.RIGHT: math.pi / 2}[motion]
    yaw = obstacle.direction + alpha + sideways
    yaw = start_yaw + float(fold(yaw - start_yaw))
    critical = ("front-left", "front-right")
    if motion is Motion.FORWARD and alpha > 0:
        critical = ("front-right", "front-left")
    elif motion.lateral:
        critical = (
            ("front-left", "rear-left") if motion is Motion.LEFT else ("front-right", "rear-right")
        )
    return Configuration(motion, alpha, window, yaw, critical)


def approach_target(
    problem: Problem, configuration: Configuration, *, phase: float | None = None
) -> Target:
    """Pose and wheel angles at the end of the approach.

    The foremost corner of the footprint is ``climb.gap`` before the step. Going on along the
    motion, each critical wheel turns by travel/R until it meets the step with ``phase`` (rad, along
    the rotation; default: the middle of the window); the leading one meets it at the wanted place
    (lateral: the middle between both).
    """
    c, robot, step = configuration, problem.robot, step_of(problem)
    phase = c.window.middle if phase is None else phase
    turn, normal = rotation(c.yaw), np.array(step.normal)
    motion = turn @ c.direction
    corners = np.array(robot.footprint) @ turn.T @ normal
    room = problem.climb.gap + float(corners.max())  # of the robot's centre, along the normal
    places = _wheel_places(robot)
    travel = _travel(problem, c, room, c.yaw, phase)
    lead = (
        turn @ (places[c.critical[0]] + places[c.critical[1]]) / 2
        if c.motion.lateral
        else turn @ places[c.critical[0]]
    )
    along = np.array([-normal[1], normal[0]])
    aside = float(along @ (np.array(step.place) - lead - travel[0] * motion))
    edge = float(normal @ np.array(step.place))
    position = (edge - room) * normal + aside * along
    spin = np.sign(robot.inverse @ np.array([*c.direction, 0.0]))
    wheels = [0.0] * 4
    for name, distance in zip(c.critical, travel, strict=True):
        i = WHEELS.index(name)
        half_turn = (
            0.0 if name.endswith("left") == c.faces_left else math.pi
        )  # the hub that faces the step counts
        wheels[i] = float(spin[i] * (phase - distance / wheel_of(problem).radius)) + half_turn
    return Target(
        (float(position[0]), float(position[1]), c.yaw),
        (wheels[0], wheels[1], wheels[2], wheels[3]),
        travel,
    )


def travel_to_step(
    problem: Problem, configuration: Configuration, pose: tuple[float, float, float]
) -> tuple[float, float]:
    """What each critical wheel has left (m) from a pose along the motion until it meets the step in
    the middle of its window."""
    step = step_of(problem)
    normal, place = np.array(step.normal), np.array(step.place)
    return _travel(
        problem,
        configuration,
        float(normal @ (place - pose[:2])),
        pose[2],
        configuration.window.middle,
    )


def _travel(
    problem: Problem, configuration: Configuration, room: float, yaw: float, phase: float
) -> tuple[float, float]:
    """The same with the robot's centre ``room`` (m) before the step, for a ``phase`` (rad) of
    contact."""
    step = step_of(problem)
    c, normal, turn = configuration, np.array(step.normal), rotation(yaw)
    reach = collision_reach(wheel_of(problem), phase, c.motion, c.alpha, step.height)
    places, ahead = _wheel_places(problem.robot), normal @ (turn @ c.direction)
    first, second = (float((room - normal @ turn @ places[w] - reach) / ahead) for w in c.critical)
    return first, second


def _wheel_places(robot: Robot) -> dict[str, Array]:
    """Where each wheel stands in the body (2,), m."""
    return {
        w: np.array(
            [
                robot.wheels[i].l * math.cos(robot.wheels[i].alpha),
                robot.wheels[i].l * math.sin(robot.wheels[i].alpha),
            ]
        )
        for i, w in enumerate(WHEELS)
    }
