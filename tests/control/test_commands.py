"""Wheel commands, logs and closed-loop tracking."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path as FilePath

import numpy as np
import pytest

from benchmarks.theses.powerbot_study import sample_time_study
from trajopt.control.approach import Estimate, predict
from trajopt.control.commands import commands, compare_log, driven, export_commands
from trajopt.control.measured import Measured
from trajopt.control.tracking import PERIOD, Tracker, TrackingController
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.robots.robot import robot as shipped
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory


@pytest.fixture(scope="module")
def plan() -> Trajectory:
    path = Path.through(
        [[0, 0], [2, 0.5], [4, -0.3], [6, 0.4]], start_direction=[1, 0], end_direction=[1, 0]
    )
    return time_scale(path, [Speed(0.8), Acceleration(0.5, 1.0)], robot=shipped("powerbot"))


def test_mean_commands_end_at_the_planned_wheel_angles(plan: Trajectory) -> None:
    for sample_time in (0.07, 0.5):
        orders = commands(plan, sample_time)
        turned = orders.speeds.sum(axis=0) * sample_time / shipped("powerbot").wheels[0].radius
        assert turned == pytest.approx(plan.at(plan.duration).wheel_angles[0], rel=1e-9)


def test_drive_of_a_circle_is_exact(plan: Trajectory) -> None:
    """Constant wheel speeds make a circle, whatever the sampling."""
    orders = commands(plan, 0.5)
    speeds = np.tile([0.3, 0.5], (len(orders.times), 1))
    circle = replace(orders, speeds=speeds)
    t = np.linspace(0, circle.duration, 33)
    pose = driven(circle, shipped("powerbot"), (1.0, 2.0, 0.3), t)
    w, v = 0.2 / (2 * 0.268), 0.4
    yaw = 0.3 + w * t
    assert pose[:, 2] == pytest.approx(yaw)
    assert pose[:, 0] == pytest.approx(1.0 + v / w * (np.sin(yaw) - np.sin(0.3)))
    assert pose[:, 1] == pytest.approx(2.0 - v / w * (np.cos(yaw) - np.cos(0.3)))


def test_finer_sampling_is_better(plan: Trajectory) -> None:
    study = sample_time_study(plan, (0.05, 0.2, 0.8))
    assert study[0].speed_error < study[1].speed_error < study[2].speed_error
    mean = sample_time_study(plan, (0.05, 0.2, 0.8), "mean")
    assert mean[0].goal_error < 1e-3
    assert all(m.goal_error < h.goal_error for m, h in zip(mean[1:], study[1:], strict=True))


def test_export_and_compare(plan: Trajectory, tmp_path: FilePath) -> None:
    file = export_commands(commands(plan, 0.1), tmp_path / "plan.csv")
    rows = list(csv.reader(file.open(encoding="utf-8")))
    assert rows[0] == ["t", "v_left", "v_right", "vx", "vy", "wz"]
    assert rows[-1][1:] == ["0"] * 5
    t = np.arange(0, plan.duration, 0.1)
    state = plan.at(t)
    log = tmp_path / "log.csv"
    shift = np.column_stack([t, state.pose + np.array([0.0, 0.1, 0.05]), state.twist[:, 0] + 0.02])
    np.savetxt(log, shift, delimiter=",", header="t,x,y,yaw,v", comments="")
    found = compare_log(plan, log)
    assert found.speed_error == pytest.approx(0.02, rel=1e-6)
    assert found.heading_error == pytest.approx(0.05, rel=1e-6)
    assert found.goal_offset == pytest.approx(0.1, rel=1e-3)
    assert found.time_offset == pytest.approx(t[-1] - plan.duration)


@pytest.mark.parametrize(
    "text",
    [
        "t,x\n0,1\n",
        "t,x,y,yaw,v\n0,0,0,0,0\n",
        "t,x,y,yaw,v\n0,0,0,0,a\n1,0,0,0,0\n",
        "t,x,y,yaw,v\n1,0,0,0,0\n0,0,0,0,0\n",
    ],
)
def test_bad_logs_are_refused(plan: Trajectory, tmp_path: FilePath, text: str) -> None:
    log = tmp_path / "log.csv"
    log.write_text(text, encoding="utf-8")
    with pytest.raises(ArgumentError, match="log"):
        compare_log(plan, log)


def tracked(
    plan: Trajectory, tracker: Tracker, start: Sequence[float], drift: Sequence[float], noise: float
) -> np.ndarray:
    """(N, 3): errors of a robot that rolls without slip, in its own axes off by ``start``, whose
    wheels turn by ``drift`` (relative) more than ordered, with white ``noise``."""
    robot, rng = shipped("powerbot"), np.random.default_rng(3)
    control = TrackingController(plan, tracker, robot)
    pose = plan.at(0.0).pose[0] + start
    wheels, errors = np.zeros(2), []
    for k in range(round((plan.duration + tracker.settle) / PERIOD)):
        t = k * PERIOD
        seen = Measured(wheels, wheels, np.zeros(2), pose, np.zeros(3))
        order = control.step(t, seen)
        turned = order.wheel_speeds * (1 + drift + noise * rng.standard_normal(2)) * PERIOD
        wheels = wheels + turned
        pose = predict(Estimate(pose, np.zeros((3, 3))), robot, robot.forward @ turned).pose
        errors.append(pose - plan.at(min(t + PERIOD, plan.duration)).pose[0])
    return np.array(errors)


def test_tracker_corrects_start_errors_and_drift(plan: Trajectory) -> None:
    errors = tracked(plan, Tracker(), (-0.1, 0.1, 0.1), np.array([0.01, -0.01]), 0.05)
    assert np.hypot(*errors[-1, :2]) < 0.03  # without feedback 0.4
    assert abs(np.degrees(errors[-1, 2])) < 1.0


def test_tracker_without_errors_changes_nothing(plan: Trajectory) -> None:
    errors = tracked(plan, Tracker(), np.zeros(3), np.zeros(2), 0.0)
    assert np.hypot(*errors[:, :2].T).max() < 5e-3
    assert np.hypot(*errors[-1, :2]) < 2e-3
