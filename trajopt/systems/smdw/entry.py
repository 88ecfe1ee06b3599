"""What a problem with a step to climb asks for: the section [climb]."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal

from pydantic import Field

from trajopt.schema import NonNegative, Section, broken_rule
from trajopt.world.free_ground import FreeGround
from trajopt.world.obstacles import Step

if TYPE_CHECKING:
    from trajopt.optimize.base import Budget, Optimizer
    from trajopt.problem.model import Problem
    from trajopt.solution import Solution

Rank = Literal["duration", "margin", "climb_rate"]
WHEELS = ("front-left", "front-right", "rear-left", "rear-right")


class ClimbSection(Section):
    """Which step to get over, how it is approached, and what makes one plan better than another."""

    step: str = Field(description="name of the obstacle of kind step")
    gap: NonNegative = Field(
        description="room between footprint and step at the end of the approach, m"
    )
    rank: Rank = Field(
        "duration", description="duration, margin (of the wheel phase), or climb_rate"
    )
    alphas: tuple[float, ...] | None = Field(
        None,
        description="angles from the step's normal in forward motion, either sign is tried, rad; "
        "absent: 35 and 45 deg, or the middle of what the wheels allow",
        min_length=1,
    )


SIZES = {"minor_radius", "depth", "gap"}  # of a double wheel, that the planner needs
SCHEMAS = {"climb": ClimbSection}


def check(problem: Problem) -> None:
    """Raises the broken rule of a climb that cannot be planned for."""
    robot, space = problem.robot, problem.space
    assert space is not None  # the job needs it
    doubles = [wheel.name for wheel in robot.rolling if wheel.double is not None]
    if tuple(doubles) != WHEELS or robot.wheel_names != WHEELS:
        expected = "a robot on four double wheels called " + ", ".join(WHEELS)
        raise broken_rule("robot.name", robot.name, expected)
    sizes = {w.model_dump_json(include={"radius": True, "double": SIZES}) for w in robot.rolling}
    if len(sizes) > 1:
        raise broken_rule("robot.wheels", sorted(sizes), "double wheels of equal sizes")
    step = step_of(problem)
    normal = step.normal
    reach = max(
        abs(-normal[1] * (x - step.place[0]) + normal[0] * (y - step.place[1]))
        for x in space.x
        for y in space.y
    )
    if step.width / 2 < reach:
        expected = f"an edge across the whole space, {2 * reach:.4g} m or more"
        raise broken_rule(f"obstacles.{step.name}.width", step.width, expected)
    pose = start_pose(problem)
    complaint = free_ground(problem).complaint(*pose)
    if complaint:
        expected = f"a start inside the space and before the step; here {complaint}"
        raise broken_rule("start.pose", list(pose), expected)


def start_pose(problem: Problem) -> tuple[float, float, float]:
    """Raises the broken rule where there is none."""
    if problem.start is None or problem.start.pose is None:
        raise broken_rule("start.pose", None, "x, y, yaw of the start")
    return problem.start.pose


def free_ground(problem: Problem) -> FreeGround:
    """Where the footprint may be: inside the space, before the step."""
    assert problem.space is not None
    step = step_of(problem)
    (nx, ny), (x, y) = step.normal, step.place
    distance = nx * x + ny * y
    return FreeGround(problem.space.x, problem.space.y, (nx, ny), distance, problem.robot.footprint)


def step_of(problem: Problem) -> Step:
    """The step that is climbed. Raises the broken rule where there is none of that name."""
    steps = {thing.name: thing for thing in problem.scene.obstacles if isinstance(thing, Step)}
    if problem.climb.step not in steps:
        expected = "the name of an obstacle of kind step: " + (", ".join(steps) or "there is none")
        raise broken_rule("climb.step", problem.climb.step, expected)
    return steps[problem.climb.step]


def solve(
    problem: Problem,
    *,
    optimizer: str | Optimizer,
    seed: int,
    budget: Budget | None,
    progress: Callable[[int, float], None] | None,
) -> Solution:
    """The best plan as a solution of its own search problem, with the others as alternatives;
    without any, a solution that says why. ``details`` is the ``Maneuver``."""
    from dataclasses import replace

    from trajopt.optimize.given import Given
    from trajopt.optimize.search import minimize
    from trajopt.solution import Solution, search_objective
    from trajopt.systems.smdw.planner import plan_climb

    chosen = "lattice" if optimizer == "auto" else optimizer
    found = plan_climb(problem, optimizer=chosen, seed=seed, budget=budget, progress=progress)
    solutions = []
    for plan in found.plans:
        objective, x0 = search_objective(plan.problem), plan.control_points[1:3, :2].ravel()
        search = minimize(objective, objective.bounds, optimizer=Given(), x0=x0)
        solutions.append(
            Solution(plan.problem, plan.path, plan.trajectory, None, search, details=found)
        )
    if not solutions:
        why = tuple(
            f"no plan for {none.configuration.name}: {none.reason}" for none in found.refused
        )
        return Solution(problem, None, None, refused=why, details=found)
    return replace(solutions[0], alternatives=tuple(solutions[1:]))
