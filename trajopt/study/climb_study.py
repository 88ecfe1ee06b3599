"""One climb trial as a case of a sweep: sub-test 2 of SMDW thesis 000, from a state with chosen and random errors.

The physics starts where an approach ends, a few centimetres before the step, with the wheel angles that the
planner aims at. A worker builds each robot once: that takes as long as half a trial.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, cast

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.maneuver import approach_target, configurations
from trajopt.maneuver_problem import ManeuverProblem
from trajopt.problem import WHEELS
from trajopt.simulate.climb import Climb, Outcome, StepScene, climb_command, judge
from trajopt.simulate.engine import SimRobot, make_engine
from trajopt.simulate.smdw_wheel import HubSizes, loc8_smdw
from trajopt.study.cases import Case

POSITION_SD = 0.003  # m, of the state a climb starts from; chosen
WHEEL_SD = 0.05  # rad; chosen
NEAREST = 0.004  # m, least gap a trial starts with; chosen


def trial(case: Case, problem: ManeuverProblem) -> dict[str, Any]:
    """Climb the problem's step with ``case["configuration"]`` (its name, e.g. "lateral left"), ``friction``,
    ``torque`` (N m a wheel), ``heading_error`` (rad) and ``engine``; a ``repeat`` draws other errors.

    ``climbed`` is 1 when both leading wheels came up, else 0, and missing where the run left physics. Raises
    ArgumentError for a configuration that this step does not have.
    """
    found = {c.name: c for c in configurations(problem.robot.wheel, problem.obstacle)}
    if case["configuration"] not in found:
        raise ArgumentError("configuration", case["configuration"], "one of " + ", ".join(found))
    chosen, rng, robot = found[case["configuration"]], case.rng(), problem.robot
    target = approach_target(problem, chosen)
    x, y, yaw = target.pose
    yaw += float(case["heading_error"])
    x += float(rng.normal(0.0, POSITION_SD))
    y += float(rng.normal(0.0, POSITION_SD))
    corners = np.array(problem.platform.footprint) @ np.array([math.cos(yaw), -math.sin(yaw)])
    x = min(x, problem.obstacle.place[0] - NEAREST - float(corners.max()))  # steps along +x
    a, b, c, d = (float(w) for w in np.array(target.wheels) + rng.normal(0.0, WHEEL_SD, 4))
    step = StepScene(problem.obstacle.height, problem.obstacle.place, problem.obstacle.direction,
                     float(case["friction"]), float(case["torque"]), robot.minor_radius, robot.hub_depth, robot.hub_gap)
    critical = (WHEELS.index(chosen.critical[0]), WHEELS.index(chosen.critical[1]))
    outcome = _outcome(Climb(step, (x, y, yaw), (a, b, c, d), chosen.direction, critical, target.travel),
                       str(case["engine"]))
    if outcome.exploded:
        return {"exploded": True, "reason": outcome.reason}
    return {"exploded": False, "climbed": float(outcome.critical_up), "first_attempt": float(outcome.first_attempt),
            "all_up": float(outcome.all_up), "yaw_change": outcome.yaw_change}


def _outcome(climb: Climb, engine: str) -> Outcome:
    """The same as ``run_climb``, to the last bit, with a robot that is built once."""
    step = climb.step
    robot = replace(_robot(HubSizes(minor_radius=step.minor_radius, depth=step.hub_depth, gap=step.hub_gap)),
                    torque_limit=step.torque)
    recording = make_engine(engine).run(robot, step.scene(), climb_command(climb, robot))
    # judge() asks a step for its height and its robot only, and would build the robot again for each wheel.
    return judge(replace(climb, step=cast(StepScene, _Built(step.height, robot))), recording)


@dataclass(frozen=True)
class _Built:
    """A step with the robot that was built for it."""

    height: float
    built: SimRobot

    def robot(self) -> SimRobot:
        return self.built


@lru_cache(maxsize=4)
def _robot(sizes: HubSizes) -> SimRobot:
    return loc8_smdw(sizes)
