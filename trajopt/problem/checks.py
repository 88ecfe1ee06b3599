"""Rules that join several sections of a problem; each raises the broken one."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np

from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.problem.extensions import SECTIONS, entry
from trajopt.robots.start import start_angles
from trajopt.robots.steering import steering_of
from trajopt.schema import broken_rule

if TYPE_CHECKING:
    from trajopt.problem.model import Problem


def check(problem: Problem) -> None:
    """Every rule that the problem's sections have to keep together."""
    if not problem.limits:
        raise broken_rule("limits", {}, "at least one limit")
    _wheels(problem)
    _ground(problem)
    if problem.job.name == "search":
        _search(problem)
    if problem.job.name == "path":
        _path(problem)
    if problem.job.name == "route":
        _route(problem)
    if problem.space is not None and problem.space.corners is not None and problem.area is None:
        expected = f"x and y: for the job '{problem.job.name}' it is a rectangle"
        raise broken_rule("space.corners", "given", expected)
    if problem.limits_section.clearance is not None and problem.job.name not in ("route", "path"):
        expected = f"none: the job '{problem.job.name}' keeps no distance"
        raise broken_rule("limits.clearance", problem.limits_section.clearance, expected)
    for section in problem.given & set(SECTIONS):
        if hasattr(entry(section), "check"):
            entry(section).check(problem)


def _wheels(problem: Problem) -> None:
    names = problem.robot.wheel_names
    for section in ("start", "goal"):
        wheels = getattr(getattr(problem, section), "wheels", None)
        if wheels is not None and len(wheels) != len(names):
            expected = f"{len(names)} angles, one a wheel that rolls ({', '.join(names)})"
            raise broken_rule(f"{section}.wheels", list(wheels), expected)
    try:
        start_angles(steering_of(problem.robot), problem.start_steering)
    except ArgumentError as error:
        raise broken_rule("start.steering", problem.start_steering, error.expected) from None
    for name in problem.critical:
        if name not in names:
            raise broken_rule("goal.critical", name, "wheels among " + ", ".join(names))
    # With pose and heading given a path chooses two numbers: the body's displacement along its
    # own axes, summed on the way. Wheels whose rows are dependent turn together.
    rows = problem.robot.inverse[list(problem.critical_indices), :2]
    if np.linalg.matrix_rank(rows, tol=1e-9 * np.abs(problem.robot.inverse).max()) < len(rows):
        expected = (
            "wheels that turn independently of one another: at most two, whose rolling rows "
            "differ (with four Mecanum wheels not two that are diagonally opposite)"
        )
        raise broken_rule("goal.critical", list(problem.critical), expected)


def _ground(problem: Problem) -> None:
    ground, limits = problem.ground, problem.limits_section
    wheels = [wheel.name for wheel in problem.robot.description.wheels]
    if isinstance(ground.friction, tuple) and len(ground.friction) != len(wheels):
        expected = f"one value, or {len(wheels)}: one a wheel ({', '.join(wheels)})"
        raise broken_rule("ground.friction", list(ground.friction), expected)
    if problem.scene.friction_varies:
        key = next((k for k in ("friction_along", "friction_map") if getattr(ground, k)), None)
        key, expected = f"ground.{key or 'friction'}", ""
        if problem.job.name == "climb" or limits.variant is not None:
            expected = "one coefficient: [climb] and limits.variant know no other"
        elif not limits.slip:
            expected = "one coefficient, or limits.slip = true, which uses it"
        if expected:
            raise broken_rule(key, "varies", expected)
    for key, along in (
        ("ground.friction_along", ground.friction_along),
        ("limits.speed_zones", limits.speed_zones),
    ):
        if along and problem.job.name != "path":
            raise broken_rule(key, "given", "none: its places are those of a given [path]")
    if problem.job.name not in ("path", "route") and not problem.scene.ground.level:
        expected = (
            "none: what is searched has a heading of its own, and its wheel angles need level "
            "ground; a given [path] can be driven there"
        )
        raise broken_rule(f"ground.{ground.kind}", "given", expected)


def _search(problem: Problem) -> None:
    if problem.start is not None and problem.start.pose is None:
        raise broken_rule("start.pose", None, "x, y, yaw of the start")
    task = problem.search
    space = task.space
    others = [wheel.name for wheel in problem.robot.rolling if wheel.kind != "swedish"]
    if others or not problem.robot.holonomic:
        expected = (
            "a robot whose rolling wheels are all Swedish and that moves in every direction, "
            f"for a searched spline; '{problem.robot.name}' has {', '.join(others) or 'too few'}; "
            "others can be given their [path]"
        )
        raise broken_rule("robot.name", problem.robot.name, expected)
    for name, pose in (("start", task.start), ("goal", task.goal)):
        if not space.contains(pose[0], pose[1]):
            expected = f"a position inside space x {list(space.x)}, y {list(space.y)}"
            raise broken_rule(f"{name}.pose", list(pose), expected)
    if math.dist(task.start[:2], task.goal[:2]) < 1e-6:
        raise broken_rule("goal.pose", list(task.goal), "a position different from start.pose")
    kind = problem.objective.kind
    if kind == "length":
        expected = "another: the length is a route's, without [spline]"
        raise broken_rule("objective.kind", kind, expected)
    if kind == "terminal" and not problem.critical and problem.actuator is None:
        expected = (
            '"duration": without goal.critical every path ends at the goal, and the terminal '
            "cost is always 0"
        )
        raise broken_rule("objective.kind", kind, expected)
    if kind != "terminal" and problem.actuator is not None:
        expected = (
            f'none with objective.kind = "{kind}": a time-scaled motion keeps wheel speeds '
            "within limits, so no drive saturates"
        )
        raise broken_rule("actuator", "given", expected)
    if "duration" in task.free and problem.actuator is None:
        expected = (
            "no duration without [actuator]: drives that follow end at the same angles "
            "whatever the duration, and time scaling chooses it"
        )
        raise broken_rule("spline.free", list(task.free), expected)


def _route(problem: Problem) -> None:
    start, goal = problem.start, problem.goal
    assert start is not None
    assert goal is not None
    if start.pose is None:
        raise broken_rule("start.pose", None, "x, y, yaw of the start")
    if goal.wheels is not None:
        expected = "none: a route ends at a pose; add [spline] and [space] for a searched spline"
        raise broken_rule("goal.wheels", list(goal.wheels), expected)
    if math.dist(start.pose[:2], goal.pose[:2]) < 1e-6:
        raise broken_rule("goal.pose", list(goal.pose), "a position different from start.pose")
    section = problem.objective
    if "objective" in problem.given:
        if section.kind not in ("duration", "length"):
            expected = '"duration" or "length" for a route'
            raise broken_rule("objective.kind", section.kind, expected)
        for key in section.model_fields_set - {"kind"}:
            expected = "none for a route: it ends at the goal"
            raise broken_rule(f"objective.{key}", getattr(section, key), expected)


def _path(problem: Problem) -> None:
    if problem.start is not None and problem.start.pose is not None:
        expected = "none: the path starts at its first point"
        raise broken_rule("start.pose", list(problem.start.pose), expected)
    assert problem.path_section is not None
    if problem.path_section.stops and problem.profile is not None:
        expected = "none with [profile]: a speed of 0 there is a stop"
        raise broken_rule("path.stops", list(problem.path_section.stops), expected)
    steers = all(wheel.kind != "fixed" for wheel in problem.robot.rolling)
    if problem.path_section.free and not (problem.robot.holonomic or steers):
        expected = f"\"along\": '{problem.robot.name}' cannot move in every direction"
        raise broken_rule("path.heading", "free", expected)
    try:
        length = problem.flat_path.length
    except ArgumentError as error:
        raise broken_rule(f"path.{error.argument}", error.value, error.expected) from None
    places = list(_places(problem))
    if places or problem.path_section.stops:
        with suppress(InfeasibleError):  # which solve reports
            length = problem.path.length
    stops = problem.path_section.stops
    if stops and stops[-1] >= length:
        expected = f"path parameters before the path's end, {length:.6g} m"
        raise broken_rule("path.stops", list(stops), expected)
    for key, value, last in places:
        if last > length * (1 + 1e-6):
            expected = f"path parameters up to the path's length, {length:.6g} m"
            raise broken_rule(key, value, expected)


def _places(problem: Problem) -> Iterator[tuple[str, Any, float]]:
    """Keys that name places along the path, their values, and the last place of each."""
    profile, along = problem.profile, problem.ground.friction_along
    for key, section in (("profile", profile), ("ground.friction_along", along)):
        if section is not None:
            yield f"{key}.places", list(section.places), section.places[-1]
    for i, zone in enumerate(problem.limits_section.speed_zones):
        yield f"limits.speed_zones[{i}].end", zone.end, zone.end
