"""Routes from pose to pose: different ways around, each as a smooth path, the best one kept.

Two stages for every way: the least length plus BEND times the integral of squared curvature, then
``time_scale``. For least time the control points and speeds are then moved together
(``program``), from there. All are timed by ``time_scale`` and checked by ``path_clearance``: what is
said of a route is recomputed, and the better of both stages' and the program's is returned.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.routes.bspline import as_path, fitted
from trajopt.routes.cells import CELLS, kind_of
from trajopt.routes.cover import Cover, cover
from trajopt.routes.envelope import Envelope, envelope_of
from trajopt.routes.field import Field, field_of
from trajopt.routes.program import Solved, Weights, program_of
from trajopt.routes.proof import why_none
from trajopt.routes.ways import Way, ways
from trajopt.timing.scaling import time_scale
from trajopt.timing.trajectory import Trajectory
from trajopt.world.clearance import Clearance, outline_distances, path_clearance
from trajopt.world.crossing import outlines_at
from trajopt.world.scene import Scene

Aim = Literal["duration", "length"]
Method = Literal["two stages", "one program"]

MOST_WAYS = 3  # different ways around that are made smooth; chosen
BEND = 0.1  # m^2: weight of squared curvature beside length in the first of two stages
CLOSE = 1.06  # times the least duration of two stages: slower ways are not tried in one program
_SPACING = 0.8  # of the outline's longer side, between control points; chosen
_FEWEST, _MOST, _STEP = 10, 64, 6  # control points, and the step between numbers of them
LONGER = 1.15  # times the shortest way: longer ones are not made smooth
_LEAST, _MORE = 0.002, 0.003  # m that discs keep beyond the clearance; more of it where it lacks
_ROOMY = 0.8  # of the room beside a disc: what discs may keep when a path is known; chosen
_TIGHT = 0.5  # of the room beside a disc in the narrowest place: what discs may keep there
_TRUST = 0.25  # of what discs leave of the outline, kept from the start; chosen: seldom too little
_ROUNDED = 1.8  # times that room: spacing of a field whose spline does not round a ridge off
_TRIES = 6  # times that more room is given
_BESIDE = (
    3  # nodes on either side that get more room too: a corner slides along the outline; chosen
)
_HELD = 0.95  # of the speeds of two stages that a program starts from
_EXACT = 1e-6  # m of clearance that is rounding


@dataclass(frozen=True, eq=False)
class Attempt:
    """One way, as far as it got: the ``path``, its ``trajectory`` and ``clearance``; why it ended
    where there is none. ``seconds`` of processor time after the search began it was there."""

    way: Way
    method: Method
    path: Path | None = None
    clearance: Clearance | None = None
    trajectory: Trajectory | None = None
    why: str = ""
    seconds: float = 0.0

    def cost(self, aim: Aim) -> float:
        """Duration (s) or length (m); inf where it did not get there."""
        if self.trajectory is None or self.path is None:
            return float("inf")
        return self.trajectory.duration if aim == "duration" else self.path.length


@dataclass(frozen=True, eq=False)
class Route:
    """``best`` of the ``attempts``, None where none got there; ``refused`` then says why, and
    ``proven`` whether no route can exist."""

    attempts: tuple[Attempt, ...]
    best: Attempt | None
    refused: str = ""
    proven: bool = False

    def __str__(self) -> str:
        if self.best is None:
            return self.refused
        tried = len({id(attempt.way) for attempt in self.attempts})
        return f"{self.best.method}, best of {tried} way{'s' if tried > 1 else ''} around"


@dataclass(frozen=True, eq=False)
class _Job:
    robot: Robot
    scene: Scene
    ends: tuple[Array, Array]
    limits: tuple[Limit, ...]
    clearance: float
    aim: Aim
    free: bool
    discs: Cover
    envelope: Envelope
    timing: dict[str, Any]


def plan_route(
    robot: Robot,
    scene: Scene,
    start: Sequence[float],
    goal: Sequence[float],
    limits: Sequence[Limit],
    *,
    clearance: float = 0.0,
    aim: Aim = "duration",
    free: bool | None = None,
    timing: Mapping[str, Any] | None = None,
) -> Route:
    """The best route found from rest at ``start`` to rest at ``goal`` (x, y, yaw) on which the
    outline keeps ``clearance`` (m) everywhere.

    ``free``: whether the heading is searched too (None: where the robot can move in every direction
    at once), else the robot drives along the path. ``timing`` are more arguments of ``time_scale``.
    Finding none is an answer, not an error. Raises InfeasibleError where the limits allow no motion
    at all.
    """
    started = time.process_time()
    free = robot.holonomic if free is None else free
    ends = (np.array(start, dtype=np.float64), np.array(goal, dtype=np.float64))
    discs = cover(tuple(robot.footprint))
    for name, pose in zip(("start", "goal"), ends, strict=True):
        near = _at_rest(robot, scene, pose)
        if near < clearance:
            where = f"at the {name} the outline is {_told(near)}; {clearance:g} m are to be kept"
            return Route((), None, where, True)
    job = _Job(
        robot,
        scene,
        ends,
        tuple(limits),
        clearance,
        aim,
        free,
        discs,
        envelope_of(robot, limits, free, scene.ground),
        dict(timing or {}),
    )
    field = field_of(scene, np.array([ends[0][:2], ends[1][:2]]))
    inner = discs.inner[2] + clearance
    found = ways(field, ends[0][:2], ends[1][:2], inner, 2 * inner, MOST_WAYS)
    attempts = [
        replace(attempt, seconds=time.process_time() - started)
        for attempt in _attempts(job, field, found)
    ]
    best = min(attempts, key=lambda a: a.cost(aim), default=None)
    if best is not None and best.trajectory is not None:
        return Route(tuple(attempts), best)
    if best is not None and best.clearance is not None:  # a free path that cannot be driven
        return Route(tuple(attempts), None, best.why)
    proven, why = why_none(robot, scene, ends, discs.inner, clearance)
    return Route(tuple(attempts), None, why, proven)


def _at_rest(robot: Robot, scene: Scene, pose: Array) -> float:
    """Distance of the outline at a pose, minus the depth."""
    import shapely

    outline = shapely.polygons(outlines_at(pose[None, :2], pose[2:], robot.footprint))
    return float(scene.keep_out.distances(outline)[0][0]) - float(
        scene.keep_out.overlaps(outline)[0]
    )


def _told(near: float) -> str:
    return "inside something" if near < 0 else f"{near:.3f} m from something"


def _attempts(job: _Job, field: Field, found: Sequence[Way]) -> Iterator[Attempt]:
    """Two stages for every way; then, for least time, one program from the better ones."""
    firsts: list[tuple[Attempt, Solved, Field, Array]] = []
    for way in found:
        if way.length > LONGER * found[0].length and firsts:
            continue
        near, room = _near(job, field, way)
        guess = _guess(job, way)
        rooms = np.full(len(guess.speeds) - 2, job.clearance + room)
        attempt, solved = _free(job, near, rooms, way, guess, "two stages")
        yield attempt
        firsts.append((attempt, solved, near, rooms))
    if job.aim != "duration":
        return
    least = min((first[0].cost("duration") for first in firsts), default=np.inf)
    for attempt, solved, near, rooms in firsts:
        if attempt.trajectory is None or attempt.cost("duration") > CLOSE * least:
            continue
        start = replace(solved, speeds=_HELD * _speeds(attempt.trajectory, len(solved.speeds)))
        yield _free(job, near, rooms, attempt.way, start, "one program")[0]


def _guess(job: _Job, way: Way) -> Solved:
    side = float(np.ptp(np.array(job.robot.footprint), axis=0).max())
    steps = int(np.ceil((way.length / (_SPACING * side) - _FEWEST + 3) / _STEP))
    count = int(np.clip(_FEWEST + _STEP * steps, _FEWEST, _MOST))
    points = fitted(way.points, count, job.ends, job.free)
    return Solved(points, np.zeros(CELLS * (count - 3) + 1))


def _speeds(trajectory: Trajectory, nodes: int) -> Array:
    """(nodes,): s' at the nodes of a program."""
    u = np.arange(nodes) / CELLS
    squares = np.interp(trajectory.path.parameter(u), trajectory.s, trajectory.sd**2)
    return np.sqrt(squares)


def _free(
    job: _Job, near: Field, rooms: Array, way: Way, start: Solved, method: Method
) -> tuple[Attempt, Solved]:
    """The program's path and its timing. ``rooms`` (N-1,), m, of discs at the inner nodes become
    what the outline needs there."""
    whole = method == "one program"
    weights = Weights(1.0) if whole else Weights(0.0, 1.0, BEND)
    envelope = job.envelope if whole else job.envelope.bare
    program = program_of(kind_of(envelope), len(start.points), len(job.discs.radii))
    attempt, solved, goal = Attempt(way, method), start, job.clearance - _EXACT
    more = np.zeros(len(rooms))
    for _ in range(_TRIES):
        solved = program.solve(solved, job.ends, envelope, job.discs, near, weights, rooms)
        path = as_path(solved.points, job.robot.turning_length)
        found = path_clearance(path, job.robot.footprint, job.scene.keep_out, enough=goal)
        if found.bound >= goal:
            return _timed(job, replace(attempt, path=path, clearance=found)), solved
        attempt = replace(attempt, why=f"{found}; IPOPT: {solved.status}")
        rooms[:] = _rooms(job, near, path, found, more)
    return attempt, solved


def _rooms(job: _Job, near: Field, path: Path, found: Clearance, more: Array) -> Array:
    """(N-1,): what discs have to keep at the inner nodes so that the outline keeps the clearance: by
    as much more as they are farther off than it here, as far as there is room; and ``more``, which
    grows where it lacks."""
    from scipy.ndimage import maximum_filter1d

    u = np.arange(1, len(more) + 1) / CELLS
    places, yaw = path.position(u)[:, :2], path.yaw(u)
    centres = outlines_at(places, yaw, job.discs.centres.tolist())
    discs = near.smooth(centres.reshape(-1, 2))[0].reshape(len(u), -1) - job.discs.radii
    own = outline_distances(path, u, job.robot.footprint, job.scene.keep_out)[0]
    lacks = job.clearance - own
    worst = np.argmin(np.abs(path.parameter(u) - found.s))
    lacks[worst] = max(lacks[worst], job.clearance - found.distance)
    more += np.where(maximum_filter1d(lacks, 2 * _BESIDE + 1) > 0, _MORE, 0.0)
    excess = maximum_filter1d(discs.min(axis=1) - own, 2 * _BESIDE + 1)
    slack = near.roomiest(places) - job.discs.inner[2] - job.clearance
    most = np.clip(_ROOMY * slack, _LEAST, 2 * job.discs.gap)
    return np.asarray(job.clearance + np.clip(excess, _LEAST, most) + more)


def _near(job: _Job, field: Field, way: Way) -> tuple[Field, float]:
    """The field around a way, finer where it is narrow; and what discs keep beyond the clearance
    (m), so that the outline, which they leave gaps of, does: all of the gap, or what the narrowest
    place allows."""
    near = field.cropped(way.points)
    slack = near.roomiest(way.points) - job.discs.inner[2] - job.clearance
    least = max(float(slack.min()), _LEAST)
    if _ROUNDED * least < near.spacing:
        tight = way.points[_ROUNDED * slack < near.spacing]
        reach = 1.5 * float(np.hypot(*np.transpose(job.robot.footprint)).max())
        near = near.finer(job.scene, _ROUNDED * least, tight, reach)
    return near, float(np.clip(_TIGHT * least, _LEAST, _TRUST * job.discs.gap))


def _timed(job: _Job, attempt: Attempt) -> Attempt:
    assert attempt.path is not None
    try:
        timed = time_scale(attempt.path, job.limits, robot=job.robot, **job.timing)
    except InfeasibleError as error:
        return replace(attempt, why=str(error))
    return replace(attempt, trajectory=timed, why="")
