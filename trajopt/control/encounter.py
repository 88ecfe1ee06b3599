"""What a replanner knows of a path and of the things that may cross it.

Everything is written over one coordinate, the path parameter s: where the robot's outline stands,
how far its fastest corner travels, how fast the plan goes there, how hard the robot can brake and
accelerate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array, require_finite, require_not_negative, require_positive
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit, Rows
from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory

_SPACING = 0.01  # m between table entries; chosen
_FLAT = 1e-12  # a row with a smaller coefficient of s'' does not bound it


@dataclass(frozen=True)
class Obstacle:
    """A disc on the floor: ``centre`` (x, y) and ``radius``, m.

    Within t seconds it moves by ``velocity`` t (m/s) and at most ``deviation`` t (m/s) from there.
    """

    centre: tuple[float, float]
    radius: float
    velocity: tuple[float, float] = (0.0, 0.0)
    deviation: float = 0.0

    def __post_init__(self) -> None:
        require_finite("obstacle.centre", self.centre, "m", (2,))
        require_finite("obstacle.velocity", self.velocity, "m/s", (2,))
        for name in ("radius", "deviation"):
            require_not_negative(f"obstacle.{name}", getattr(self, name))


World = Callable[
    [float, Array], Sequence[Obstacle]
]  # the true obstacles at time t (s), robot at pose (3,)


@dataclass(frozen=True)
class Visitor:
    """A disc that comes in the robot's way once. Lengths m, times s, speed m/s.

    At time ``appears`` its nearest point is ``distance`` ahead of the outline's front and its
    centre ``aside`` to the left of the robot's middle; it then walks across at ``speed`` (to the
    left > 0) on a straight track and is gone after ``stays``.
    """

    appears: float
    stays: float
    distance: float
    aside: float = 0.0
    speed: float = 0.0
    radius: float = 0.15

    def __post_init__(self) -> None:
        for name in ("appears", "stays", "distance", "radius"):
            require_not_negative(f"visitor.{name}", getattr(self, name))
        for name in ("aside", "speed"):
            require_finite(f"visitor.{name}", getattr(self, name))


def visited_world(
    visitors: Sequence[Visitor], outline: Array, *, speed_bound: float | None = None
) -> World:
    """The world of ``visitors``, for one run: where each comes is told by the robot's pose when it
    appears.

    ``outline`` (K, 2), m, body frame. An obstacle may move by at most ``speed_bound`` (m/s) for all
    the robot knows; None: by its own speed.
    """
    front = float(np.asarray(outline)[:, 0].max())
    placed: dict[int, tuple[Array, Array]] = {}

    def world(now: float, pose: Array) -> list[Obstacle]:
        found = []
        for i, visitor in enumerate(visitors):
            since = now - visitor.appears
            if not 0.0 <= since < visitor.stays:
                continue
            if i not in placed:
                ahead, left = (
                    np.array([np.cos(pose[2] + turn), np.sin(pose[2] + turn)])
                    for turn in (0, np.pi / 2)
                )
                placed[i] = (
                    pose[:2]
                    + (front + visitor.distance + visitor.radius) * ahead
                    + visitor.aside * left,
                    visitor.speed * left,
                )
            centre = placed[i][0] + since * placed[i][1]
            bound = abs(visitor.speed) if speed_bound is None else speed_bound
            found.append(
                Obstacle((float(centre[0]), float(centre[1])), visitor.radius, (0.0, 0.0), bound)
            )
        return found

    return world


@dataclass(frozen=True, eq=False)
class Course:
    """Tables over the path parameter ``s`` (M,), m, of one planned motion."""

    s: Array
    pose: Array  # (M, 3) x, y, yaw of the body origin
    square: (
        Array  # (M,) m^2/s^2, the plan's speed squared (linear in s where acceleration is constant)
    )
    travel: Array  # (M,) m, travelled by the fastest point of the outline since the start
    braking: Array  # (M,) m/s^2 > 0, possible here at any speed up to the plan's
    acceleration: Array  # (M,) m/s^2 >= 0, the same
    outline: Array  # (K, 2) m, body frame, counter-clockwise

    @property
    def length(self) -> float:
        return float(self.s[-1])

    def speed(self, s: Array) -> Array:
        """(N,): the plan's speed at path parameters (N,), m/s."""
        return np.asarray(np.sqrt(np.interp(s, self.s, self.square)))

    @property
    def top_speed(self) -> float:
        """m/s."""
        return float(np.sqrt(self.square.max()))

    def poses(self, s: Array) -> Array:
        """(N, 3): poses at path parameters (N,)."""
        return np.column_stack([np.interp(s, self.s, self.pose[:, k]) for k in range(3)])

    def travelled(self, s: Array) -> Array:
        """(N,): travel of the fastest outline point, m."""
        return np.interp(s, self.s, self.travel)


def course(
    trajectory: Trajectory, robot: Robot, *, limits: Sequence[Limit] | None = None
) -> Course:
    """Tables for replanning along ``trajectory``; ``robot`` gives the outline.

    ``limits`` say how hard the replanner may brake and accelerate; None: those of the plan. A plan
    that uses all the friction in a bend leaves nothing to brake with: time it with less than what
    is allowed here. Raises ArgumentError where the robot cannot brake at all at some speed up to
    the plan's (braking rows at s'' < 0 leave nothing): then no replanner can promise a stop.
    """
    if trajectory.rests:
        expected = "a plan whose wheels need not turn at rest on the way"
        raise ArgumentError("trajectory", [rest.s for rest in trajectory.rests], expected)
    count = max(int(np.ceil(trajectory.path.length / _SPACING)) + 1, 3)
    s = np.linspace(0.0, trajectory.path.length, count)
    samples = trajectory.track.samples(s, trajectory.path.locate(s))
    square = np.interp(s, trajectory.s, trajectory.sd**2)
    samples = replace(samples, sd2=square)
    rows = [
        limit.rows(samples, trajectory.robot)
        for limit in (trajectory.limits if limits is None else limits)
    ]
    highest, lowest = _acceleration_range(rows, square)
    if not lowest.max() < 0:
        place = float(s[int(np.argmax(lowest))])
        raise ArgumentError(
            "trajectory", f"s = {place:.4g} m", "a plan from which the robot can brake everywhere"
        )
    corners: Array = np.asarray(robot.footprint, dtype=np.float64)
    yaw_rate, forward = samples.twist[:, 2:], samples.twist[:, :1]
    moves = np.hypot(
        forward - yaw_rate * corners[:, 1], samples.twist[:, 1:2] + yaw_rate * corners[:, 0]
    )
    fastest = moves.max(axis=1)
    travel = np.concatenate([[0.0], np.cumsum((fastest[1:] + fastest[:-1]) / 2 * np.diff(s))])
    pose = np.column_stack([samples.position[:, :2], samples.yaw])
    return Course(s, pose, square, travel, -lowest, np.maximum(highest, 0.0), corners)


def _acceleration_range(rows: list[Rows], square: Array) -> tuple[Array, Array]:
    """Greatest and least s'' (M,) that every speed from rest up to sqrt(square) allows.

    The bound a row sets on s'' is linear in s'^2, so rest and the plan's speed are the extremes.
    """
    highest, lowest = np.full(len(square), np.inf), np.full(len(square), -np.inf)
    for r in rows:
        for x in (np.zeros_like(square), square):
            room = r.c - r.b * x[:, None]
            with np.errstate(divide="ignore", invalid="ignore"):
                bound = room / r.a
            if r.a.shape[1]:
                highest = np.minimum(highest, np.where(r.a > _FLAT, bound, np.inf).min(axis=1))
                lowest = np.maximum(lowest, np.where(r.a < -_FLAT, bound, -np.inf).max(axis=1))
    return np.minimum(highest, 1e3), np.maximum(lowest, -1e3)


def clearance(poses: Array, outline: Array, centres: Array, radii: Array) -> Array:
    """(N,): least distance, m, between the outline at N poses and N discs (centres (N, 2), radii
    (N,)).

    Negative where they overlap (minus the radius at most; minus the depth where the centre is
    inside).
    """
    cos, sin = np.cos(poses[:, 2]), np.sin(poses[:, 2])
    d = centres - poses[:, :2]
    local = np.stack([cos * d[:, 0] + sin * d[:, 1], -sin * d[:, 0] + cos * d[:, 1]], axis=1)[
        :, None, :
    ]
    edge = np.roll(outline, -1, axis=0) - outline
    rel = local - outline[None]
    share = np.clip(np.sum(rel * edge, axis=2) / np.sum(edge * edge, axis=1), 0.0, 1.0)
    apart = rel - share[..., None] * edge
    distance = np.sqrt(np.sum(apart**2, axis=2)).min(axis=1)
    inside = (edge[:, 0] * rel[..., 1] - edge[:, 1] * rel[..., 0] > 0).all(axis=1)
    return np.asarray(np.where(inside, -distance, distance) - radii)


def safe_speed(
    sensor_range: float, delay: float, braking: float, *, obstacle_speed: float = 0.0
) -> float:
    """Greatest speed (m/s) from which the robot stops before what its sensor sees first at its
    range.

    v delay + v^2 / (2 braking) + w (delay + v / braking) <= range, with ``delay`` (s) from one scan
    to the reaction on the next, ``braking`` (m/s^2) what the slope leaves, w = ``obstacle_speed``
    towards the robot (m/s). [waheed2006], eq. 2.26, is the first term alone. 0 where even standing
    still is not far enough. Raises ArgumentError for values that are not positive.
    """
    for name, value in (("sensor_range", sensor_range), ("delay", delay), ("braking", braking)):
        require_positive(name, value)
    require_not_negative("obstacle_speed", obstacle_speed, "m/s")
    room = sensor_range - obstacle_speed * delay
    if room <= 0:
        return 0.0
    linear = delay + obstacle_speed / braking
    return float(2 * room / (linear + np.sqrt(linear**2 + 2 * room / braking)))
