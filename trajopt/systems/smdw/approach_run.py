"""Sub-test 1 with feedback: an approach driven by its controller in a physics engine, and how
exactly it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import fold
from trajopt.control.approach import SETTLE, ApproachController
from trajopt.control.bend import Goal
from trajopt.simulate.engine import Command, Recording
from trajopt.simulate.sensors import Sense
from trajopt.systems.smdw.climb import StepScene, run_approach


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


def run_controlled(
    step: StepScene,
    controller: ApproachController,
    sense: Sense,
    start: tuple[float, float, float],
    wheels: tuple[float, float, float, float],
    *,
    engine: str = "mujoco",
) -> Recording:
    """Drive the controller's approach, told what ``sense`` measures, from the true ``start`` (m, m,
    rad) and ``wheels`` (rad), the step standing there, until it has settled."""
    lasts = float(
        controller.reference.times[-1]
    )  # it may take the end of the path slower than the plan
    command = Command(np.array([0.0, lasts]), np.zeros((2, 4)), None, start, np.array(wheels))
    return run_approach(
        step, command, engine=engine, controller=controller, sense=sense, rest=SETTLE
    )


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
