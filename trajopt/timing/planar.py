"""Rows of the standard limits on level ground, compiled.

Where the ground is level and no wheel steers, all that rows hold of the path are a few numbers a
place: T = (vx, vy, w, p), the twist per sigma with p the length of (vx, vy), and T', its derivative
along sigma. With rigid wheels

    a = A T,    b = B (vx', vy', w', p', w^2, w vx, w vy),    c is constant,

and a bound on speed alone is |S T| sigma' <= 1. The matrices are read off the limits themselves,
from rows at made-up places, so that no formula stands twice; castors move contacts, and the rows of
``Slip`` and ``Tip`` with them, which ``planar_kernel`` writes out. Each limit is tried at other
made-up places before it is trusted; where one does not agree, or is not known here, rows come from
NumPy as they do on other grounds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import TrajoptError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.limit import Limit, spins
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.limits.yaw_rate import YawRate
from trajopt.robots.robot import STANDARD_GRAVITY, Robot
from trajopt.robots.start import start_angles
from trajopt.robots.steering import steering_of
from trajopt.timing.cells import Measure, Spots, Table
from trajopt.timing.made_up import made_up, samples_of_twists
from trajopt.timing.planar_slip import pushes, rigid
from trajopt.timing.stages import assemble
from trajopt.timing.track import Track

_PLACES = 24  # made up: half to read the matrices off, half to try them; chosen
_AGREE = 1e-10  # of a row's scale: how well rows agree there
_CONSTANT = (Acceleration, Contact, Slip, Tip, WheelAcceleration, WheelTorque)  # rigid wheels


@dataclass(frozen=True, eq=False)
class Block:
    """Rows of one limit: matrices a (M, 4), b (M, 7), c (M,) and speeds (Q, 4); where contacts
    move, ``moving`` rows instead, for which the limit itself is the key."""

    a: Array
    b: Array
    c: Array
    speeds: Array
    moving: int = 0

    @property
    def rows(self) -> int:
        return len(self.a) + self.moving

    @cached_property
    def across(self) -> tuple[Array, Array]:
        """a and b with their rows as columns, (4, M) and (7, M)."""
        return np.ascontiguousarray(self.a.T), np.ascontiguousarray(self.b.T)


@dataclass(frozen=True, eq=False)
class Planar:
    """Rows of limits on level ground, without steered wheels."""

    limits: tuple[Limit, ...]
    robot: Robot | None
    blocks: tuple[Block, ...]
    owner: IndexArray
    speeds: Array
    speed_owner: IndexArray

    def edges(self, track: Track, u: Array) -> tuple[float, ...]:  # noqa: ARG002
        """None of these limits jumps."""
        return ()

    def table(self, track: Track, measure: Measure, spots: Spots) -> Table:
        """Rows at the places of cells."""
        from trajopt.timing import planar_kernel as kernels

        free = measure.path.heading is not None
        knots, cubics = measure.cubics
        at = kernels.features(knots, cubics, measure.length, free, spots.u)
        arms = self._arms(track, measure, spots, at)
        a, b, c = self.rows(at, arms)
        bounds = np.empty((len(self.limits), len(at)))
        kernels.speed_bounds(at, self.speeds, self.speed_owner, bounds)
        names = tuple(limit.name for limit in self.limits)
        return Table(a, b, c, bounds, names, self.owner, ())

    def rows(self, at: Array, arms: Array | None) -> tuple[Array, Array, Array]:
        """a, b, c (P, R) from features (P, 11) and contacts (P, K, 2) where they move."""
        from trajopt.timing import planar_kernel as kernels

        shape = (len(at), sum(block.rows for block in self.blocks))
        # One block: the allocator keeps it for the next call, several of its size it gives back.
        a, b, c = np.empty((3, *shape))
        first = 0
        for limit, block in zip(self.limits, self.blocks, strict=True):
            if block.moving:
                assert self.robot is not None
                assert arms is not None
                cog, g = np.asarray(self.robot.body.cog), STANDARD_GRAVITY
                if isinstance(limit, Slip):
                    inside, start = np.cos(np.pi / limit.sides), first
                    for push, grips, size in pushes(limit, self.robot):
                        kernels.slip_rows(
                            at, arms, cog, grips, g, push, inside, size * g, start, a, b, c
                        )
                        start += len(push)
                elif isinstance(limit, Tip):
                    kernels.tip_rows(at, arms, cog, limit.reserve, _SMALLEST, first, a, b, c, g)
            elif len(block.a):
                kernels.linear(at, *block.across, block.c, first, a, b, c)
            first += block.rows
        return a, b, c

    def _arms(self, track: Track, measure: Measure, spots: Spots, at: Array) -> Array | None:
        """(P, K, 2): contacts from the foot of the centre of gravity, where castors move them."""
        if self.robot is None or not any(block.moving for block in self.blocks):
            return None
        from trajopt.timing import swivel_kernel as kernels

        steering = steering_of(self.robot)
        castors = steering.castors
        start = start_angles(steering, track.start_steering)
        first = np.array([start.get(int(i), 0.0) for i in castors]) + steering.angle[castors]
        pivots, trail = steering.place[castors], steering.trail[castors]
        knots, cubics = measure.cubics
        free = measure.path.heading is not None
        turned = kernels.swivels(
            knots,
            cubics,
            measure.length,
            free,
            spots.u,
            at,
            spots.left,
            spots.right,
            spots.d,
            pivots,
            trail,
            first,
        )
        return kernels.standing(
            turned,
            steering.place,
            trail,
            steering.lateral[castors],
            castors,
            np.asarray(self.robot.body.cog),
        )


_SMALLEST = 1e-3  # m, as in limits/tip


def planar_of(track: Track, measure: Measure, limits: Sequence[Limit]) -> Planar | None:
    """Rows for the limits, or None where they take the way through NumPy."""
    path = measure.path
    if not (track.ground.level and path.plain and path.coordinates.shape[1] == 2):
        return None
    try:
        return _planar(tuple(limits), track.robot)
    except TypeError:  # a limit that cannot be hashed
        return None


@lru_cache(maxsize=256)
def _planar(limits: tuple[Limit, ...], robot: Robot | None) -> Planar | None:
    castors = False
    if robot is not None:
        steering = steering_of(robot)
        castors = len(steering.castors) > 0
        if len(steering.steered) or np.isin(steering.castors, steering.rolling).any():
            return None
    blocks = []
    try:
        for limit in limits:
            block = _block(limit, robot, castors)
            if block is None:
                return None
            blocks.append(block)
    except TrajoptError:  # the same error comes again from the rows themselves
        return None
    owner = np.repeat(np.arange(len(limits)), [block.rows for block in blocks])
    speeds = np.concatenate([block.speeds for block in blocks])
    speed_owner = np.repeat(np.arange(len(limits)), [len(block.speeds) for block in blocks])
    found = Planar(limits, robot, tuple(blocks), owner, speeds, speed_owner)
    if castors and robot is not None and not _agrees(found, robot):
        return None
    return found


def _agrees(planar: Planar, robot: Robot) -> bool:
    """Whether rows with moving contacts are those of NumPy at made-up places."""
    samples, features = made_up(_PLACES)
    steering, cog = steering_of(robot), np.asarray(robot.body.cog)
    turned = np.zeros((_PLACES, len(steering.names)))
    turned[:, steering.castors] = np.random.default_rng(22).uniform(
        -3, 3, (_PLACES, len(steering.castors))
    )
    states = steering.states(samples.twist, samples.twist_rate, None, turned)
    rows = assemble(replace(samples, wheel_states=lambda: states), planar.limits, robot)
    ours = planar.rows(features, np.ascontiguousarray(states.contacts - cog[:2]))
    return all(
        np.allclose(
            np.sort(o[k]), np.sort(m[k]), rtol=0, atol=_AGREE * np.abs(m[k]).max(initial=1.0)
        )
        for o, m in zip(ours, (rows.a, rows.b, rows.c), strict=True)
        for k in range(_PLACES)
    )


def _block(limit: Limit, robot: Robot | None, castors: bool) -> Block | None:
    none = np.zeros((0, 4))
    speeds = _speeds(limit, robot)
    if speeds is not None:
        return Block(none, np.zeros((0, 7)), np.zeros(0), speeds)
    if type(limit) not in _CONSTANT:
        return None
    if isinstance(limit, Slip) and not isinstance(limit.friction, (int, float, tuple)):
        return None
    if castors and isinstance(limit, (Slip, Tip, Contact, WheelTorque)):
        assert robot is not None
        if isinstance(limit, (Contact, WheelTorque)):
            return None
        if isinstance(limit, Slip) and not rigid(limit, robot):
            return None
        slips = sum(len(part[0]) for part in pushes(limit, robot)) if isinstance(limit, Slip) else 0
        count = slips or len(robot.body.contacts)
        return Block(none, np.zeros((0, 7)), np.zeros(0), none, count)
    samples, features = made_up(_PLACES)
    rows = limit.rows(samples, robot)
    if np.isfinite(rows.sd2_max).any() or rows.edges:
        return None
    a, b, c = rows.a / rows.scale, rows.b / rows.scale, rows.c / rows.scale
    half = _PLACES // 2
    ma = np.linalg.lstsq(features[:half, :4], a[:half], rcond=None)[0]
    mb = np.linalg.lstsq(features[:half, 4:], b[:half], rcond=None)[0]
    off = max(
        np.abs(features[:, :4] @ ma - a).max(initial=0.0),
        np.abs(features[:, 4:] @ mb - b).max(initial=0.0),
        np.abs(c - c[0]).max(initial=0.0),
    )
    size = max(np.abs(a).max(initial=1.0), np.abs(b).max(initial=1.0))
    if off > _AGREE * size:
        return None
    ma, mb = (np.where(np.abs(m) > 1e-14 * size, m, 0.0) for m in (ma, mb))
    return Block(np.ascontiguousarray(ma.T), np.ascontiguousarray(mb.T), c[0].copy(), none)


def _speeds(limit: Limit, robot: Robot | None) -> Array | None:
    """(Q, 4): S of a limit that only bounds speeds, tried at made-up places; None for others."""
    if type(limit) is Speed:
        speeds = np.array([[0.0, 0.0, 0.0, 1 / limit.largest]])
    elif type(limit) is YawRate:
        speeds = np.array([[0.0, 0.0, 1 / limit.largest, 0.0]])
    elif type(limit) is WheelSpeed and robot is not None:
        unit = samples_of_twists(np.eye(3), np.zeros((3, 3)))
        spin, _ = spins(unit, robot)
        largest = np.broadcast_to(np.asarray(limit.largest, dtype=np.float64), spin.shape[1:])
        speeds = np.column_stack([(spin / largest).T, np.zeros(len(largest))])
    else:
        return None
    samples, features = made_up(_PLACES)
    rows = limit.rows(samples, robot)
    ours = 1 / np.max(np.abs(features[:, :4] @ speeds.T), axis=1) ** 2
    return speeds if np.allclose(ours, rows.sd2_max, rtol=_AGREE) else None
