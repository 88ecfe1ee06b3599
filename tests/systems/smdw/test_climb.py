"""Climb trials: judgement and bookkeeping; one climb and one that cannot be, in
MuJoCo."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.recordings import made_up
from trajopt.errors import ArgumentError
from trajopt.problem import load_problem
from trajopt.robots import robot
from trajopt.simulate.double import double_rollers
from trajopt.simulate.engine import Recording
from trajopt.systems.smdw.climb import (
    Climb,
    Outcome,
    StepScene,
    climb_all,
    judge,
    rate,
    run_climb,
)
from trajopt.systems.smdw.configurations import configurations_of
from trajopt.systems.smdw.entry import WHEELS
from trajopt.systems.smdw.planner import Plan, plan_configuration
from trajopt.systems.smdw.trials import step_scene
from trajopt.world.obstacles import Step

FILE = Path(__file__).parents[3] / "problems" / "smdw" / "step_5cm.toml"
EDGE = Step("step", 0.05, (2.856, 0.76), 0.0, width=8.0, depth=4.0)
STEP = StepScene(EDGE, 0.8, robot("loc8-smdw"))
CLIMB = Climb(STEP, (2.46, 0.76, -math.pi / 2), (0.0,) * 4, (0.0, 1.0), (0, 2), (0.02, 0.02))


def recording(rise: np.ndarray, turned: float, exploded: bool = False) -> Recording:
    """Two seconds in which the wheels rise by ``rise`` (4,) from half time on, turning evenly by
    ``turned``."""
    times = np.linspace(0, 2, 201)
    heights = 0.098 + np.where(times[:, None] > 1.0, rise, 0.0)
    return made_up(
        times,
        wheel_angles=np.outer(times / 2, np.full(4, turned)),
        wheel_heights=heights,
        exploded=exploded,
        reason="why" if exploded else "",
    )


def test_a_wheel_is_up_at_seven_tenths_of_the_step() -> None:
    outcome = judge(CLIMB, recording(np.array([0.036, 0.05, 0.034, 0.0]), 4.0))
    assert outcome.up == (True, True, False, False)
    assert not outcome.critical_up
    both = judge(CLIMB, recording(np.array([0.036, 0.0, 0.036, 0.0]), 4.0))
    assert both.critical_up
    assert both.first_attempt
    assert not both.all_up
    late = judge(CLIMB, recording(np.array([0.036, 0.0, 0.036, 0.0]), 17.0))
    assert late.critical_up
    assert not late.first_attempt


def first_at(climb: Climb, share: float, *, late: int | None = None, sign: float = 1.0) -> bool:
    """Whether it counts as the first attempt when the wheels come up ``share`` of a turn after they
    have rolled their travel to the step; the wheel ``late`` alone 0.2 turns later."""
    rise = np.array([0.036, 0.0, 0.036, 0.0])
    found = recording(rise, 1.0)
    up = int(np.argmax(found.wheel_heights[:, 0] > 0.1))
    needed = np.zeros(4)
    for i, travel in zip(climb.critical, climb.travel, strict=True):
        needed[i] = travel / 0.098 + 2 * math.pi * (share + (0.2 if i == late else 0.0))
    angles = np.outer(np.arange(201) / up, sign * needed) + np.array([3.0, -4.0, 5.0, 1.0])
    return judge(climb, replace(found, wheel_angles=angles)).first_attempt


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("travel", [(0.02, 0.02), (0.3, 0.0)])
def test_the_first_attempt_is_over_half_a_turn_after_meeting_the_step(
    travel: tuple[float, float], sign: float
) -> None:
    """The other hub arrives then. What a wheel rolls before it meets the step does not count, nor
    does the angle it starts with; sideways both leading wheels have to be that early, forward the
    first one."""
    sideways = replace(CLIMB, travel=travel)
    forward = replace(sideways, motion=(1.0, 0.0))
    for climb in (sideways, forward):
        assert first_at(climb, 0.0, sign=sign)
        assert first_at(climb, 0.48, sign=sign)
        assert not first_at(climb, 0.52, sign=sign)
        assert not first_at(climb, 0.9, sign=sign)
    assert first_at(forward, 0.4, late=2, sign=sign)
    assert not first_at(sideways, 0.4, late=2, sign=sign)
    assert not first_at(forward, 0.4, late=0, sign=sign)


def test_a_wheel_that_never_comes_up_had_no_first_attempt() -> None:
    assert not judge(CLIMB, recording(np.array([0.036, 0.0, 0.0, 0.0]), 1.0)).first_attempt
    assert not judge(CLIMB, recording(np.zeros(4), 0.0)).first_attempt


def test_exploded_runs_are_counted_and_left_out() -> None:
    good, bad = (
        Outcome((True,) * 4, True, True, False, "", 0.0),
        judge(CLIMB, recording(np.ones(4), 1.0, True)),
    )
    found = rate([good, bad, good])
    assert (found.successes, found.trials, found.exploded) == (2, 2, 1)
    assert found.share == 1.0
    with pytest.raises(ArgumentError, match="what"):
        rate([good], what="luck")


def test_planner_and_simulator_agree_on_the_robot() -> None:
    """The robot that physics climbs with is the problem's, before the problem's step, and its
    rollers stand out of the hubs' faces by little."""
    problem = load_problem(FILE).replace({"robot.wheels.all.double.minor_radius": 0.05})
    there = step_scene(problem, 0.8, torque=5.0)
    assert there.scene().obstacles == problem.scene.obstacles
    assert there.robot.motor_array("torque") == pytest.approx([5.0] * 4)
    assert there.robot == problem.robot.replace({"motors.all.torque": 5.0})
    section = there.robot.description.wheels[0]
    assert section.double is not None
    assert section.double.minor_radius == 0.05
    reach = max(
        abs(roller.centre[1]) + roller.length / 2 * abs(roller.axis[1]) + roller.radius
        for roller in double_rollers(section, section.rollers, section.double)
    )
    assert 0 <= reach - section.width / 2 < 0.012


def test_planned_lateral_climb_gets_up_and_a_wall_does_not() -> None:
    pytest.importorskip("mujoco")
    problem = load_problem(FILE)
    plan = plan_configuration(problem, configurations_of(problem)[0])
    assert isinstance(plan, Plan)
    a, b, c, d = plan.target.wheels
    i, j = (WHEELS.index(w) for w in plan.configuration.critical)
    climb = Climb(
        STEP,
        plan.target.pose,
        (a, b, c, d),
        plan.configuration.direction,
        (i, j),
        plan.target.travel,
    )
    first = run_climb(climb)
    assert first.critical_up
    assert not first.exploded
    assert climb_all([climb]) == [first]  # the same bits again
    weak = STEP.robot.replace({"motors.all.torque": 1.0})
    wall = run_climb(replace(climb, step=replace(STEP, step=replace(EDGE, height=0.09))))
    assert not any(wall.up)
    assert not run_climb(replace(climb, step=replace(STEP, robot=weak))).critical_up
