"""Problems, limits and times of [waheed2006] against its tables (tests/data/powerbot)."""

from __future__ import annotations

import csv
import math
from pathlib import Path as FilePath

import numpy as np
import pytest

from benchmarks.theses.powerbot_identify import (
    NEWTON_PER_POUND,
    centre_of_gravity,
    friction_from_pulls,
)
from benchmarks.theses.powerbot_study import linear_factor
from trajopt.control.commands import commands
from trajopt.errors import InfeasibleError, ProblemError
from trajopt.limits.speed import Speed
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.pipeline import solve
from trajopt.problem import Problem, load_problem
from trajopt.robots.robot import robot as shipped
from trajopt.systems.powerbot.constants import FRICTION
from trajopt.systems.powerbot.limits import (
    thesis_slide_speed,
    thesis_slip_acceleration,
    thesis_tip_acceleration,
)
from trajopt.timing.scaling import time_scale
from trajopt.world.ramp import Ramp, lay_over

ROOT = FilePath(__file__).resolve().parents[3]
DATA = ROOT / "tests" / "data" / "powerbot"
TIMED = (1, 2, 4, 5)


def printed() -> dict[int, dict[str, float]]:
    with (DATA / "experiments.csv").open(encoding="utf-8") as file:
        rows = csv.DictReader(line for line in file if not line.startswith("#"))
        return {int(r["experiment"]): {k: float(v) for k, v in r.items() if v} for r in rows}


def problem(number: int) -> Problem:
    return load_problem(ROOT / "problems" / "powerbot" / f"experiment_{number}.toml")


def test_worked_spline_of_appendix_1() -> None:
    path = Path.through(
        [[0, 0], [1, 0], [2, 2]], knots=[0, 1, 2], start_direction=[0, 0], end_direction=[0, 0]
    )
    assert path.position(np.array([1.0]), 1)[0, :2] == pytest.approx([1.5, 1.5])  # U1


@pytest.mark.parametrize("number", TIMED)
def test_linear_scaling_reproduces_the_print(number: int) -> None:
    row = printed()[number]
    factor = linear_factor(
        row["unscaled_v_max"],
        row["unscaled_a_max"],
        -row["unscaled_d_max"],
        speed_limit=row["v_lim"],
        acceleration_limit=row["a_lim"],
        braking_limit=-row["d_lim"],
    )
    assert factor * row["unscaled_time"] == pytest.approx(row["time"], rel=0.005)


@pytest.mark.parametrize("number", TIMED)
def test_thesis_limits_reproduce_the_tables(number: int) -> None:
    row, slope = printed()[number], np.array([math.radians(5.99) if number == 4 else 0.0])
    assert thesis_slip_acceleration(slope, FRICTION)[0] == pytest.approx(row["a_slip"], rel=0.02)
    assert thesis_tip_acceleration(slope)[0] == pytest.approx(row["a_tip"], rel=0.02)


def test_slide_speed_of_a_circle() -> None:
    assert thesis_slide_speed(np.array([0.0, 0.5, -1.0]), 0.332) == pytest.approx(
        math.sqrt(0.332 * 9.81)
    )
    assert thesis_slide_speed(np.zeros(3), 0.332) == math.inf


@pytest.mark.parametrize("number", [1, 2, 3, 4, 5, 6])
def test_problem_files_keep_what_they_claim(number: int) -> None:
    task = problem(number)
    path, print_ = task.flat_path, task.printed
    assert print_ is not None
    row = printed().get(number, printed()[2])
    u = np.linspace(path.start, path.end, 2001)
    v, a = path.position(u, 1)[:, :2], path.position(u, 2)[:, :2]
    speed = np.hypot(v[:, 0], v[:, 1])
    assert path.position(u[[0, -1]])[:, :2] == pytest.approx(
        np.array([[row["start_x"], row["start_y"]], [row["goal_x"], row["goal_y"]]])
    )
    if number == 6:
        assert path.length == pytest.approx(13.0)
        return
    heading = np.degrees(np.arctan2(v[[0, -1], 1], v[[0, -1], 0]))
    assert np.cos(
        np.radians(heading - [row["heading_start"], row["heading_goal"]])
    ) == pytest.approx(1, abs=1e-6)
    along = np.sum(v * a, axis=1) / speed
    found = {
        "length": np.trapezoid(speed, u) / print_.length - 1,
        "unscaled_speed": speed.max() / print_.unscaled_speed - 1,
        "unscaled_acceleration": along.max() / print_.unscaled_acceleration - 1,
        "unscaled_deceleration": -along.min() / print_.unscaled_deceleration - 1,
    }
    for name, value in found.items():
        assert value == pytest.approx(print_.residuals[name], abs=2e-3), name
        assert abs(value) < 0.08  # the aim is 5 %; experiment 4 misses it in two of four


@pytest.mark.parametrize(("number", "ratio"), [(1, 1.3), (2, 1.4), (4, 2.0), (5, 2.2)])
def test_time_optimal_beats_linear(number: int, ratio: float) -> None:
    task = problem(number)
    times = [
        time_scale(
            task.path,
            task.replace({"limits.variant": "thesis"}).limits,
            robot=task.robot,
            ground=task.scene.ground,
            engine=engine,
        )
        for engine in ("linear", "auto")
    ]
    assert times[0].duration / times[1].duration >= ratio
    assert min(times[1].margins().values()) >= -1e-9


def test_thesis_braking_downhill_is_unsafe() -> None:
    """A plan within the thesis's own braking limit breaks the physical slip limit on the way
    down."""
    task = problem(4)
    down = lay_over(
        Path.through([[0, 0], [8, 0]]),
        [Ramp((0.5, 0.0), 0.0, 4.266, -0.45, 0.35), Ramp((4.766, 0.0), 0.0, 4.266, -0.45, 0.35)],
    )
    thesis = time_scale(
        down, task.replace({"limits.variant": "thesis"}).limits, robot=shipped("powerbot")
    )
    physical = task.replace({"limits.variant": None, "limits.slip_rule": "load"}).limits
    slip = next(limit for limit in physical if limit.name == "slip")
    rows = slip.rows(sample_path(down, thesis.s[:-1]), shipped("powerbot"))
    used = rows.a * thesis.sdd[:, None] + rows.b * thesis.sd[:-1, None] ** 2
    assert np.any(used > rows.c * 1.0 + 0.05)


def test_slope_beyond_the_grade_is_refused() -> None:
    task = problem(4).replace({"ground.ramps.0.height": 0.9})
    assert "grade" in solve(task).faults[0]
    with pytest.raises(InfeasibleError, match="grade"):
        time_scale(task.path, task.limits, robot=task.robot, ground=task.scene.ground)


def test_ramp_keeps_the_curve_in_the_plane() -> None:
    task = problem(4)
    u = np.linspace(task.path.start, task.path.end, 500)
    over, flat = task.path.position(u), task.flat_path.position(u)
    assert over[:, :2] == pytest.approx(flat[:, :2], abs=1e-10)
    assert over[-1, 2] == pytest.approx(0.45, abs=1e-6)
    assert over[:, 2] == pytest.approx(task.scene.ground.height(over[:, 0], over[:, 1]), abs=3e-3)
    assert (
        np.degrees(sample_path(task.path, np.linspace(0, task.path.length, 500)).slope).max() < 6.3
    )


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ({"path": {"start_rate": -1.0}}, "start_rate"),
        ({"path": {"points": [[0, 0], [0, 0]]}}, "points"),
        ({"path": {"points": None}}, "points, file, segments or pieces"),
        ({"path": {"headings": [0.0] * 5}}, "heading"),
        ({"path": {"heading": "free", "headings": [0.0] * 5}}, "cannot move in every direction"),
        ({"path": {"closed": True}}, "path.closed"),
        ({"path": {"goal_rate": None}}, "goal_rate"),
        ({"start": {"pose": [0.0, 0.0, 0.0]}}, "start.pose"),
        ({"ground": {"grade": 0.1}}, "ground.grade"),
        ({"limits": {"variant": "magic"}}, "thesis"),
        ({"limits": {"slip_share": 0.5, "slip": False}}, "slip_share"),
        ({"encounters": [{"appears": 1.0, "clears_after": 1.0}]}, "encounters\\[0\\].distance"),
        ({"profile": {"places": [0, 99], "speeds": [1, 1]}}, "profile.places"),
        ({"limits": {"frictoin": 0.3}}, "frictoin"),
        ({"limits": {"deceleration": None}}, "deceleration"),
        ({"profile": {"places": [1, 0], "speeds": [1, 1]}}, "places"),
    ],
)
def test_wrong_files_are_refused_in_one_line(change: dict[str, object], key: str) -> None:
    with pytest.raises(ProblemError, match=key) as caught:
        problem(1).replace(**change)
    assert "\n" not in str(caught.value)


def test_dotted_keys_replace_and_override_as_in_other_problem_files() -> None:
    task = problem(4)
    changed = task.replace({"ground.friction": 0.5, "path.start_rate": np.float64(0.4)})
    assert changed.scene.friction == 0.5
    assert changed.limits_section == task.limits_section
    slower = task.replace(**{"limits.safety_speed": 0.4})
    assert Speed(0.4, name="safety_speed") in slower.limits
    assert Speed(0.3) in task.replace(limits={"speed": 0.3}).limits
    assert {m.name for m in task.limits} - {
        m.name for m in task.replace({"limits.slip": False}).limits
    } == {
        "thesis_slip",
        "thesis_slide",
    }
    file = ROOT / "problems" / "powerbot" / "experiment_4.toml"
    assert load_problem(file, {"ground.friction": 0.5}) == task.replace({"ground.friction": 0.5})
    for wrong in ("ground.frction", "ground.friction.deep"):
        with pytest.raises(ProblemError, match=wrong):
            task.replace({wrong: 1.0})
        with pytest.raises(ProblemError, match=wrong):
            load_problem(file, {wrong: 1.0})


def test_friction_of_appendix_2() -> None:
    pulls = [pounds * NEWTON_PER_POUND for pounds in (62, 58, 60)]
    found = friction_from_pulls(
        pulls, mass=148.0, cog_to_drive=0.132, cog_to_caster=0.218, pull_height=0.129
    )
    assert found.value == pytest.approx(0.332, rel=0.005)
    spread = friction_from_pulls(
        pulls,
        mass=148.0,
        cog_to_drive=0.132,
        cog_to_caster=0.218,
        pull_height=0.129,
        force_uncertainty=5.0,
        length_uncertainty=0.003,
    )
    assert 0 < found.uncertainty < spread.uncertainty < 0.02


def test_centre_of_gravity_of_appendix_3() -> None:
    found = centre_of_gravity(
        mass=148.0,
        wheelbase=0.35,
        drive_load_level=92.0,
        drive_load_raised=103.0,
        rise=0.062,
        axle_height=0.07,
        load_uncertainty=0.5,
    )
    assert found.behind_drive_axle.value == pytest.approx(0.132, abs=0.001)
    assert found.height.value == pytest.approx(0.215, abs=0.001)
    assert found.height.uncertainty == pytest.approx(
        math.sqrt(2) * 0.5 * 0.35 / (148 * math.tan(math.asin(0.062 / 0.35))), rel=1e-4
    )


@pytest.mark.parametrize("speeds", [(0.1, 0.1), (0.1, 0.05)])
def test_a_profile_bounds_the_commands_on_the_whole_path(speeds: tuple[float, float]) -> None:
    """Places end 12 m before the path does: the last speed holds on."""
    solution = solve(problem(6).replace({"profile.places": [0, 1], "profile.speeds": speeds}))
    assert solution.holds, solution.faults
    assert solution.trajectory is not None
    orders = commands(solution.trajectory, 0.5)
    assert orders.speeds.max() <= 0.1 + 1e-6
    assert solution.duration > 13.0 / 0.1


def test_encounters_halt_the_motion_and_let_it_go_on() -> None:
    solution = solve(problem(3))
    assert solution.holds, solution.faults
    assert solution.details is not None
    notes = solution.details.notes
    free = solve(problem(3).replace({"encounters": None}))
    assert free.duration == solution.duration
    assert "with_encounters" not in free.details.notes  # type: ignore[union-attr]
    seen = notes["with_encounters"]
    assert seen["arrived"]
    assert not seen["hit"]
    assert seen["standing_s"] > 0.0
    assert seen["duration_s"] > solution.duration + seen["standing_s"]
    longer = solve(problem(3).replace({"encounters.1.clears_after": 9.0})).details
    assert longer is not None
    assert longer.notes["with_encounters"]["standing_s"] > seen["standing_s"] + 5.0
    assert notes["printed"]["ours"] == {"length": solution.path.length, "time": solution.duration}  # type: ignore[union-attr]
