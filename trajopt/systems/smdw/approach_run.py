"""Sub-test 1 with feedback: an approach driven by its controller in a physics engine, and how
exactly it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.control.approach import ApproachController
from trajopt.control.bend import Goal
from trajopt.simulate.engine import Command, Controller, Observation, Recording
from trajopt.systems.smdw.climb import StepScene, run_approach

SETTLE = 1.2  # s after the reference's end until errors are taken, chosen: corrections on the spot end within it


@dataclass(frozen=True)
class Ending:
    """Errors at the end of an approach: ``position`` m, ``yaw`` rad, ``phase`` rad (worst critical
    wheel, modulo a turn). ``exploded``: the run left physics, and the errors mean nothing."""

    position: float
    yaw: float
    phase: float
    exploded: bool

    def within(self, position: float, yaw: float, phase: float) -> bool:
        """Whether the run stayed physical and each error (m, rad, rad) is at most its bound."""
        return (
            not self.exploded
            and self.position <= position
            and self.yaw <= yaw
            and self.phase <= phase
        )


def steered(controller: ApproachController) -> Controller:
    """The controller as engines ask it: it sees pose and wheel angles, and blurs the pose
    itself."""

    def drive(t: float, seen: Observation) -> Array:
        yaw = math.atan2(seen.rotation[1, 0], seen.rotation[0, 0])
        return controller.step(
            t, np.array([seen.position[0], seen.position[1], yaw]), seen.wheel_angles
        )

    return drive


def run_controlled(
    step: StepScene,
    controller: ApproachController,
    start: tuple[float, float, float],
    wheels: tuple[float, float, float, float],
    *,
    engine: str = "mujoco",
) -> Recording:
    """Drive the controller's approach from the true ``start`` (m, m, rad) and ``wheels`` (rad), the
    step standing there, until it has settled."""
    lasts = float(
        controller.reference.times[-1]
    )  # it may take the end of the path slower than the plan
    command = Command(np.array([0.0, lasts]), np.zeros((2, 4)), start, wheels)
    return run_approach(step, command, engine=engine, controller=steered(controller), rest=SETTLE)


def ending_of(recording: Recording, goal: Goal) -> Ending:
    """Errors of the last state against a goal."""
    pose = recording.pose[-1] - goal.pose
    phase = fold((recording.wheel_angles[-1] - goal.wheels)[list(goal.critical)])
    return Ending(
        math.hypot(pose[0], pose[1]),
        abs(float(fold(pose[2]))),
        float(np.abs(phase).max()),
        recording.exploded,
    )
