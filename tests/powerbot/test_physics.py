"""PowerBot in pybullet: plans within limits hold in contact physics, plans beyond do not."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("pybullet")

from trajopt.control.tracking import Tracker
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.paths.path import Path
from trajopt.robots.powerbot import powerbot
from trajopt.simulate.differential import Floor, Wall, drive_in_pybullet
from trajopt.simulate.powerbot_model import powerbot_drive
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ramp import Ramp, lay_over

ROBOT = powerbot(caster_half_track=0.0)  # balancing casters: one point of support behind
MOTORS = (Speed(2.1), Acceleration(0.55, 7.8))


@pytest.fixture(scope="module")
def turn() -> Trajectory:
    """A path on which slip binds most of the way."""
    angle = np.linspace(0, 1.2 * math.pi, 8)
    points = np.vstack([[-3, 0], [-1.5, 0], np.column_stack([1.5 * np.sin(angle), 1.5 - 1.5 * np.cos(angle)])])
    return time_scale(Path.through(points), [*MOTORS, Slip(0.332, per_wheel=True)], robot=ROBOT)


def test_weight_and_straight_motion() -> None:
    plan = time_scale(Path.through([[0, 0], [2, 0]]), [Speed(0.5), Acceleration(0.5, 0.5)], robot=ROBOT)
    seen = drive_in_pybullet(plan, powerbot_drive(ROBOT), Floor(0.332))
    assert seen.load[-1].sum() == pytest.approx(148 * 9.81, rel=0.01)
    assert seen.load[-1, :2].sum() / seen.load[-1].sum() == pytest.approx(0.218 / 0.35, rel=0.02)
    assert seen.goal_offset < 2e-3
    assert seen.slip_ratio < 0.005


def test_slip_within_and_beyond_the_limit(turn: Trajectory) -> None:
    share = sum(part.end - part.start for part in turn.active if part.limit == "slip") / turn.path.length
    assert share >= 0.3
    within = drive_in_pybullet(turn, powerbot_drive(ROBOT), Floor(0.332))
    beyond = drive_in_pybullet(turn, powerbot_drive(ROBOT), Floor(0.332), faster=math.sqrt(1.2))
    assert within.slip_ratio < 0.02
    assert beyond.slip_ratio > 2 * within.slip_ratio


def test_tip_binds_with_grip_and_height() -> None:
    """Friction 1.2 and a high centre of gravity: braking 3 cm inside the tip limit keeps the casters down (what
    is left is the pitch of the compliant contacts), 30 % beyond the limit lifts them."""
    tall = powerbot(cog_height=0.6, caster_half_track=0.0)
    limits = [Speed(2.0), Acceleration(0.55, 7.8), Slip(1.2, per_wheel=True), Tip(reserve=0.03)]
    plan = time_scale(Path.through([[0, 0], [6, 0]]), limits, robot=tall)
    assert any(part.limit == "tip" for part in plan.active)
    within = drive_in_pybullet(plan, powerbot_drive(tall), Floor(1.2))
    beyond = drive_in_pybullet(plan, powerbot_drive(tall), Floor(1.2),
                               faster=math.sqrt(1.3 * 0.132 / (0.132 - 0.03)))
    assert np.abs(within.pitch).max() < math.radians(1.0)
    assert np.abs(beyond.pitch).max() > math.radians(5.0)


def test_closed_loop_up_a_ramp() -> None:
    ramp = Ramp((2.0, 0.0), 0.0, 4.266, 0.45, 0.35)
    path = lay_over(Path.through([[0, 0], [4, 0.2], [8, 0]], start_direction=[1, 0], end_direction=[1, 0]), [ramp])
    plan = time_scale(path, [Speed(1.0), Acceleration(0.55, 7.8), Slip(0.7 * 0.332, per_wheel=True)], robot=ROBOT)
    seen = drive_in_pybullet(plan, powerbot_drive(ROBOT), Floor(0.332, (ramp,)), tracker=Tracker())
    assert np.degrees(-seen.pitch).max() == pytest.approx(6.0, abs=0.5)
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.final_heading_error) < 1.0
    assert seen.slip_ratio < 0.02


def test_closed_loop_through_a_door() -> None:
    """A door 0.9 m wide; the robot is 0.68 m wide and starts 5 cm and 2 deg off."""
    path = Path.through([[0, 0], [5, 0]])
    plan = time_scale(path, [Speed(0.5), Acceleration(0.55, 1.5)], robot=ROBOT)
    walls = (Wall((2.5, 0.45), (2.5, 2.0)), Wall((2.5, -0.45), (2.5, -2.0)))
    off = (0.0, 0.05, math.radians(2.0))
    seen = drive_in_pybullet(plan, powerbot_drive(ROBOT), Floor(0.332, (), walls), tracker=Tracker(), start_error=off)
    assert not seen.touched
    assert seen.goal_offset < 0.02
    assert math.degrees(seen.final_heading_error) < 1.0
    crash = drive_in_pybullet(plan, powerbot_drive(ROBOT), Floor(0.332, (), walls),
                              start_error=(0.0, 0.3, 0.0))
    assert crash.touched
