"""From an obstacle to ranked plans: configurations, target poses and wheel angles, exact paths,
timing.

For every configuration that can climb the step ([guzman2015], section 4.1.6) the planner takes the
pose in which the leading wheel will meet the step at the wanted place, and the wheel angles that,
after rolling over the remaining gap, are in the middle of the window of angles that climb. Among
the control points that end exactly there, it takes those whose footprint stays on free ground and
times the most promising ones.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path as FilePath
from typing import Any

import numpy as np

from trajopt.arrays import Array, fold, rotation
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.objectives.base import AffinePart
from trajopt.objectives.clearance import ClearObjective
from trajopt.objectives.terminal import TerminalObjective
from trajopt.optimize.base import Budget, Optimizer, Progress
from trajopt.optimize.lattice import lattice_points
from trajopt.optimize.search import minimize
from trajopt.paths.path import Path
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
from trajopt.systems.smdw.entry import WHEELS, free_ground, start_pose, step_of
from trajopt.systems.smdw.geometry import DoubleWheel
from trajopt.timing.compiled import load_kernel
from trajopt.timing.scaling import rough_duration, time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.free_ground import path_margin
from trajopt.world.obstacles import Step

THESIS_ALPHAS = (
    math.radians(35.0),
    math.radians(45.0),
)  # rad, [guzman2015] section 4.1.6, either sign
LARGEST_TURN = math.pi / 2  # rad, [guzman2015] section 4.1.6: "does not exceed a quarter turn"
TIMED_CANDIDATES = 2  # paths that are time-scaled for each configuration, chosen
RANKING_GRID = (
    40  # gridpoints of the time scaling that ranks candidates, chosen; plans get the default grid
)
WHEEL_TOLERANCE = 1e-6  # rad, of the critical wheels before physics
# Sideways shifts (shares of the distance to the goal) of P1 and P2 around which exact paths are
# looked for: first a few, then many; chosen.
_FEW_BULGES = (
    (0.0, 0.0),
    (0.2, 0.0),
    (-0.2, 0.0),
    (0.0, 0.2),
    (0.0, -0.2),
    (0.2, 0.2),
    (-0.2, -0.2),
)
_MANY_BULGES = tuple((a / 5, b / 5) for a in range(-3, 4) for b in range(-3, 4))
# Share of trials with both leading wheels up: MuJoCo, friction 0.6-1, 8 N m, wheel angles at the
# window's middle with errors of 3 mm, 0.5 deg, 0.05 rad: 20 of 20 for each (lateral), 40 of 40
# (forward 35 and 45 deg); benchmarks/climb.py. Written as (successes + 1)/(trials + 2), so that no
# rate is certain.
CLIMB_RATES = {
    (False, 0.035): 41 / 42,
    (False, 0.05): 41 / 42,
    (True, 0.035): 21 / 22,
    (True, 0.05): 21 / 22,
}


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


@dataclass(frozen=True, eq=False)
class Plan:
    """One configuration with its exact, timed path; everything recomputed from the path.

    ``wheel_error``: largest error (rad) of a critical wheel at the end. ``room``: least distance
    (m) of the footprint from the borders and the step along the whole path. ``margin`` (rad): half
    width of the window of angles that climb. ``climb_rate``: measured share of trials that climb.
    """

    configuration: Configuration
    target: Target
    problem: Problem
    control_points: Array
    path: Path
    trajectory: Trajectory
    wheel_error: float
    room: float
    margin: float
    climb_rate: float

    @property
    def duration(self) -> float:
        """Of the approach, s."""
        return self.trajectory.duration


@dataclass(frozen=True)
class Refused:
    """A configuration without a plan, and why."""

    configuration: Configuration
    reason: str


@dataclass(frozen=True, eq=False)
class Maneuver:
    """Plans, best first, and the configurations that were refused; ``wall_time`` (s) for all of it
    but the loading of compiled kernels, once a process."""

    problem: Problem
    plans: tuple[Plan, ...]
    refused: tuple[Refused, ...]
    wall_time: float

    @property
    def faults(self) -> tuple[str, ...]:
        """None: a manoeuvre without a plan has no path either, and that is said already."""
        return ()

    @property
    def notes(self) -> dict[str, Any]:
        """Plans and refused configurations, for a summary."""
        plans = {
            plan.configuration.name: {
                "duration_s": plan.duration,
                "room_m": plan.room,
                "phase_margin_rad": plan.margin,
                "climb_rate": plan.climb_rate,
            }
            for plan in self.plans
        }
        return {"plans": plans, "refused": {r.configuration.name: r.reason for r in self.refused}}

    def save(self, folder: FilePath, *, pictures: bool) -> None:
        """Pictures of all plans and of the wheel's geometry."""
        if pictures:
            from trajopt.systems.smdw.pictures import save_maneuver_pictures

            save_maneuver_pictures(self, folder)

    @property
    def status(self) -> str:
        """One sentence."""
        if self.plans:
            best = self.plans[0]
            return (
                f"{len(self.plans)} of {len(self.plans) + len(self.refused)} configurations have a plan; best by "
                f"{self.problem.climb.rank}: {best.configuration.name}, {best.duration:.2f} s"
            )
        first, others = self.refused[0], len(self.refused) - 1
        more = f" ({others} other configurations have none either)" if others else ""
        return f"no configuration has a plan; {first.configuration.name}: {first.reason}{more}"


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


def search_problem(problem: Problem, configuration: Configuration, target: Target) -> Problem:
    """The terminal problem of one configuration: goal and critical wheels filled in. Raises
    ProblemError."""
    goal = {"pose": target.pose, "wheels": target.wheels, "critical": configuration.critical}
    return problem.replace(
        {
            "title": f"{problem.title}: {configuration.name}",
            "climb": None,
            "goal": goal,
            "spline": {"free": ["p1", "p2"]},
        }
    )


def plan_climb(
    problem: Problem,
    *,
    optimizer: str | Optimizer = "lattice",
    seed: int = 0,
    budget: Budget | None = None,
    progress: Progress | None = None,
) -> Maneuver:
    """Plans for every configuration that can climb the obstacle, ranked by
    ``problem.climb.rank``.

    ``optimizer``: "lattice" looks through all exact solutions; any other searches P1 and P2 with
    footprint and wheel angles judged together (its wheel errors are what it finds). Raises
    ArgumentError for a step too high.
    """
    load_kernel()  # libraries load once a process; that is no part of planning
    started = time.perf_counter()
    plans: list[Plan] = []
    refused: list[Refused] = []
    for configuration in configurations_of(problem):
        outcome = plan_configuration(
            problem,
            configuration,
            optimizer=optimizer,
            seed=seed,
            budget=budget,
            progress=progress,
        )
        if isinstance(outcome, Plan):
            plans.append(outcome)
        else:
            refused.append(outcome)
    keys = {
        "duration": lambda p: p.duration,
        "margin": lambda p: (-p.margin, p.duration),
        "climb_rate": lambda p: (-p.climb_rate, p.duration),
    }
    plans.sort(key=keys[problem.climb.rank])
    return Maneuver(problem, tuple(plans), tuple(refused), time.perf_counter() - started)


def plan_configuration(
    problem: Problem,
    configuration: Configuration,
    *,
    optimizer: str | Optimizer = "lattice",
    seed: int = 0,
    budget: Budget | None = None,
    progress: Progress | None = None,
    target: Target | None = None,
) -> Plan | Refused:
    """Plan of one configuration (to ``target`` instead of its own where given), or why there is
    none."""
    target = approach_target(problem, configuration) if target is None else target
    ground = free_ground(problem)
    complaint = ground.complaint(*target.pose)
    if complaint:
        return Refused(configuration, f"the space is too small: at the target {complaint}")
    if abs(target.pose[2] - start_pose(problem)[2]) < 1e-3:
        return Refused(
            configuration,
            "no turn between start and target, so wheel angles cannot be chosen: turn first",
        )
    made = search_problem(problem, configuration, target)
    objective = ClearObjective(TerminalObjective(made, made.robot), ground)
    if optimizer == "lattice":
        objective, candidates = _lattice(objective, configuration)
    else:
        candidates = minimize(
            objective,
            objective.bounds,
            optimizer=optimizer,
            seed=seed,
            budget=budget,
            progress=progress,
        ).x[None]
    if len(candidates) == 0:
        return Refused(
            configuration,
            "the space is too small: no path with exact wheel angles keeps the footprint "
            "inside it and before the step",
        )
    return _fastest(problem, configuration, target, objective, candidates)


def _lattice(
    objective: ClearObjective, configuration: Configuration
) -> tuple[ClearObjective, Array]:
    """Exact candidates, looked for more widely where there are none: around more control points,
    then (forward only, where physics shows that the phase counts modulo half a turn) with either
    hub facing the step."""
    for bulges in (_FEW_BULGES, _MANY_BULGES):
        candidates = _exact_candidates(objective, bulges)
        if len(candidates) or (bulges is _MANY_BULGES and configuration.motion.lateral):
            return objective, candidates
    halved = objective.terminal.problem.replace({"objective.wheel_period": "pi"})
    relaxed = replace(objective, terminal=replace(objective.terminal, problem=halved))
    return relaxed, _exact_candidates(relaxed, _MANY_BULGES)


def _exact_candidates(objective: ClearObjective, bulges: Sequence[tuple[float, float]]) -> Array:
    """(n, 4): exact control points whose footprint stays on free ground, least effort first."""
    part = objective.affine_part()
    box = objective.bounds[part.variables]
    found = []
    for base in _bases(objective, part, bulges):
        points, _ = lattice_points(replace(part, base=base), box)
        found.append(points)
    points = np.concatenate(found)
    points = points[objective.evaluate(points).violation == 0.0] if len(points) else points
    if len(points) == 0:
        return points
    points = np.unique(np.round(points, 12), axis=0)
    return np.asarray(points[np.argsort(objective.effort(points), kind="stable")])


def _bases(
    objective: ClearObjective, part: AffinePart, bulges: Sequence[tuple[float, float]]
) -> list[Array]:
    """Control points around which exact ones are looked for: the default, bent to either side."""
    task = objective.terminal.problem.search
    start, goal = task.start, task.goal
    chord = np.array([goal[0] - start[0], goal[1] - start[1]])
    aside = np.array([-chord[1], chord[0]])
    low, high = objective.bounds[:, 0], objective.bounds[:, 1]
    return [
        np.clip(part.base + np.concatenate([a * aside, b * aside]), low, high) for a, b in bulges
    ]


def _fastest(
    problem: Problem,
    configuration: Configuration,
    target: Target,
    objective: ClearObjective,
    candidates: Array,
) -> Plan | Refused:
    """The fastest of the most promising candidates, after checks on the fine grid."""
    reason = "every exact path leaves the free ground between the points of the search grid"
    timed: list[tuple[float, Path]] = []
    limits, robot = problem.limits, problem.robot
    for candidate in candidates[:TIMED_CANDIDATES]:
        path = objective.path(candidate)
        if path_margin(path, objective.ground) < 0:
            continue
        try:
            timed.append((rough_duration(path, limits, robot=robot, gridpoints=RANKING_GRID), path))
        except InfeasibleError as error:
            reason = str(error)
    for _, path in sorted(timed, key=lambda t: t[0]):
        try:
            trajectory = time_scale(path, limits, robot=robot, start_wheels=problem.start_wheels)
            return _plan(problem, configuration, target, objective, trajectory)
        except InfeasibleError as error:
            reason = str(error)
    return Refused(configuration, reason)


def _plan(
    problem: Problem,
    configuration: Configuration,
    target: Target,
    objective: ClearObjective,
    trajectory: Trajectory,
) -> Plan:
    made, path = objective.terminal.problem, trajectory.path
    end = trajectory.at(trajectory.duration).wheel_angles[0]
    errors = fold(end - np.array(target.wheels), made.objective.period)[list(made.critical_indices)]
    assert path.heading is not None  # the objective's paths choose their heading
    return Plan(
        configuration,
        target,
        made,
        np.column_stack([path.points, path.heading]),
        path,
        trajectory,
        float(np.max(np.abs(errors))),
        path_margin(path, objective.ground),
        configuration.window.half_width,
        predicted_climb_rate(configuration, step_of(problem).height),
    )


def predicted_climb_rate(configuration: Configuration, height: float) -> float:
    """Share of trials that climb, interpolated over step height between the measured ones."""
    heights = sorted(h for lateral, h in CLIMB_RATES if lateral == configuration.motion.lateral)
    rates = [CLIMB_RATES[configuration.motion.lateral, h] for h in heights]
    return float(np.interp(height, heights, rates))
