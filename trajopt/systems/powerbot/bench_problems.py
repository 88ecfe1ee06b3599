"""Routes of PowerBot as problems of the optimizer benchmark.

Names: ``corridor/<seed>/length`` or ``/duration`` (a random corridor with static obstacles),
``powerbot/<file>`` (a path of [waheed2006]).
"""

from __future__ import annotations

from pathlib import Path as FilePath
from typing import Literal

import numpy as np

from trajopt.arrays import Array
from trajopt.bench.problems import Family
from trajopt.errors import ArgumentError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.objectives.base import Objective
from trajopt.objectives.route import Corridor, RouteObjective
from trajopt.paths.spline import uniform_basis
from trajopt.problem import load_problem
from trajopt.robots.robot import robot
from trajopt.systems.powerbot.constants import FRICTION, LARGEST_ACCELERATION, LARGEST_SPEED

POWERBOT = robot("powerbot")
RADIUS = float(
    np.hypot(*np.transpose(POWERBOT.footprint)).max()
)  # m: a disc about the origin that covers it
LENGTH = 12.0  # m, of a corridor, chosen
WALLS = (-2.5, 2.5)  # m, chosen: three robots side by side
KNOTS = 4  # free ones between start and goal, chosen
SHIFT = (
    1.2  # m along the corridor by which a free knot may leave its even spacing: half of it, chosen
)
OBSTACLES = 4  # chosen
OBSTACLE_RADII = (0.3, 0.7)  # m, chosen
OBSTACLE_SIDE = 0.9  # m off the middle at most, chosen: one side of each stays wide enough
MOVED_CELLS = 120  # intervals in a search: these paths start slowly in their parameter. Chosen: 0.1 % of the time
TILE = 0.5  # m by which a knot of [waheed2006]'s paths may be moved, chosen


def random_corridor(seed: int, kind: Literal["length", "duration"]) -> RouteObjective:
    """Start, goal and obstacles drawn from ``seed``; the robot starts and ends at rest, heading as
    the route does.

    The obstacles stand one after the other, each leaving at least one side open by construction:
    walls at +-2.5 m less an obstacle's reach of at most 0.9 + 0.7 m always leave 2.7 m on the other
    side.
    """
    rng = np.random.default_rng(seed)
    start, goal = rng.uniform(-1.0, 1.0, 2)
    x = LENGTH * (np.arange(OBSTACLES) + rng.uniform(0.85, 1.15, OBSTACLES)) / (OBSTACLES + 1)
    y, radii = (
        rng.uniform(-OBSTACLE_SIDE, OBSTACLE_SIDE, OBSTACLES),
        rng.uniform(*OBSTACLE_RADII, OBSTACLES),
    )
    places = np.linspace(0.0, LENGTH, KNOTS + 2)
    values = np.column_stack([places, np.linspace(start, goal, KNOTS + 2)])
    bounds = [
        row
        for place in places[1:-1]
        for row in ((place - SHIFT, place + SHIFT), (WALLS[0] + RADIUS, WALLS[1] - RADIUS))
    ]
    discs = tuple((float(a), float(b), float(r)) for a, b, r in zip(x, y, radii, strict=True))
    return RouteObjective(
        kind,
        uniform_basis(KNOTS + 2),
        values,
        tuple(range(1, KNOTS + 1)),
        np.array(bounds),
        POWERBOT,
        (
            Slip(FRICTION, rule="load"),
            Speed(LARGEST_SPEED),
            Acceleration(LARGEST_ACCELERATION, LARGEST_ACCELERATION),
        ),
        Corridor(WALLS, discs),
        RADIUS,
    )


def moved_knots(file: FilePath) -> RouteObjective:
    """Least duration of a path of [waheed2006] under its own limits, inner knots free within a tile
    of 0.5 m.

    The limits are the physical ones and leave out the safety speed, which alone would set the
    duration.
    """
    problem = load_problem(file, {"limits.variant": None, "limits.slip_rule": "load"})
    if problem.ground.ramps:
        raise ArgumentError("problem", str(file), "a path on level ground")
    path = problem.flat_path
    free = tuple(range(1, len(path.basis.knots) - 1))
    bounds = np.array([(c - TILE, c + TILE) for knot in free for c in path.coordinates[knot]])
    limits = tuple(m for m in problem.limits if m.name != "safety_speed")
    return RouteObjective(
        "duration",
        path.basis,
        path.coordinates,
        free,
        bounds,
        problem.robot,
        limits,
        cells=MOVED_CELLS,
    )


def corridor(text: str, _root: FilePath) -> tuple[Objective, Array]:
    """The problem ``corridor/<text>``."""
    seed, _, kind = text.partition("/")
    if not seed.isdigit() or kind not in ("length", "duration"):
        raise ArgumentError(
            "problem", f"corridor/{text}", "corridor/<seed>/length or corridor/<seed>/duration"
        )
    objective = random_corridor(int(seed), kind)  # type: ignore[arg-type]
    return objective, objective.bounds


def path_of_file(text: str, root: FilePath) -> tuple[Objective, Array]:
    """The problem ``powerbot/<text>``; ``root`` is the folder with problem files."""
    objective = moved_knots(root / "powerbot" / f"{text}.toml")
    return objective, objective.bounds


FAMILIES = {
    "corridor": Family(
        corridor,
        {
            "corridor, least length": r"corridor/\d+/length",
            "corridor, least time under slip": r"corridor/\d+/duration",
        },
    ),
    "powerbot": Family(path_of_file, {"PowerBot path, least time": r"powerbot/.*"}),
}
