"""One climb trial as a case of a sweep: sub-test 2 of [guzman2015], from a state with chosen and
random errors.

The physics starts where an approach ends, a few centimetres before the step, with the wheel angles
that the planner aims at.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.problem import Problem
from trajopt.sweeps.cases import Case
from trajopt.systems.smdw.climb import Climb, run_climb
from trajopt.systems.smdw.configurations import approach_target, configurations_of, travel_to_step
from trajopt.systems.smdw.trials import before_step, critical_wheels, four, step_scene

POSITION_SD = 0.003  # m, of the state a climb starts from; chosen
WHEEL_SD = 0.05  # rad; chosen


def trial(case: Case, problem: Problem) -> dict[str, Any]:
    """Climb the problem's step with ``case["configuration"]`` (its name, e.g. "lateral left"),
    ``friction``, ``torque`` (N m a wheel), ``heading_error`` (rad) and ``engine``; a ``repeat``
    draws other errors.

    ``climbed`` is 1 when both leading wheels came up, else 0, and missing where the run left
    physics. Raises ArgumentError for a configuration that this step does not have.
    """
    found = {c.name: c for c in configurations_of(problem)}
    if case["configuration"] not in found:
        raise ArgumentError("configuration", case["configuration"], "one of " + ", ".join(found))
    chosen, rng = found[case["configuration"]], case.rng()
    target = approach_target(problem, chosen)
    x, y, yaw = target.pose
    yaw += float(case["heading_error"])
    x += float(rng.normal(0.0, POSITION_SD))
    y += float(rng.normal(0.0, POSITION_SD))
    pose = before_step(problem, np.array([x, y, yaw]))
    wheels = four(np.array(target.wheels) + rng.normal(0.0, WHEEL_SD, 4))
    step = step_scene(problem, float(case["friction"]), float(case["torque"]))
    outcome = run_climb(
        Climb(
            step,
            pose,
            wheels,
            chosen.direction,
            critical_wheels(chosen),
            travel_to_step(problem, chosen, pose),
        ),
        str(case["engine"]),
    )
    if outcome.exploded:
        return {"exploded": True, "reason": outcome.reason}
    return {
        "exploded": False,
        "climbed": float(outcome.critical_up),
        "first_attempt": float(outcome.first_attempt),
        "all_up": float(outcome.all_up),
        "yaw_change": outcome.yaw_change,
    }
