"""How a robot stands on the ground along a path: its axes in space, with their derivatives.

The normal is the ground's at the robot's origin, or, where the ground bends on the scale of a
robot, that of the plane through the heights under its wheels (least squares). The robot's x axis is
its direction of travel in that plane, or the direction in it above the heading of its own.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.paths.series import Series, Vector, cos_sin, cross, dot, scaled, unit
from trajopt.world.ground import Ground
from trajopt.world.laid import LaidPath, compose, ground_plan, plan_series

_MOVING = 1e-6  # as in paths/samples: slower per path parameter, it is a turn on the spot


@dataclass(frozen=True, eq=False)
class Frame:
    """Origin and axes of the body (world, m) as series in the spline parameter, and ``pace`` = ds/du
    of the path parameter."""

    origin: Vector
    x: Vector
    y: Vector
    z: Vector
    pace: Series

    def rate(self, value: Series) -> Series:
        """The derivative along the path parameter."""
        return value.d() / self.pace

    def body(self, vector: Vector) -> list[Series]:
        """Components along the body's axes."""
        return [dot(vector, axis) for axis in (self.x, self.y, self.z)]

    @property
    def velocity(self) -> list[Series]:
        """Of the origin per unit path parameter, body frame."""
        return self.body(tuple(self.rate(c) for c in self.origin))  # type: ignore[arg-type]

    @property
    def turning(self) -> list[Series]:
        """Angular velocity per unit path parameter, body frame: e_x' = W_z e_y - W_y e_z."""
        x1, y1 = ([self.rate(c) for c in axis] for axis in (self.x, self.y))
        return [
            dot((y1[0], y1[1], y1[2]), self.z),
            -dot((x1[0], x1[1], x1[2]), self.z),
            dot((x1[0], x1[1], x1[2]), self.y),
        ]


def frame_on(
    ground: Ground, path: Path, u: Array, contacts: Array | None = None, order: int = 3
) -> Frame:
    """Frames along ``path`` (laid on the ground, in space on it, or with ``Flat`` the ground itself)
    at spline parameters (N,).

    ``contacts`` (C, 2), m, body frame: where wheels stand, used where the ground bends. The origin
    has derivatives up to ``order`` (3 or 4), the axes up to one less.
    """
    x, y = plan_series(path, u, order + 1)
    at = ground_plan(path, u, order) if ground.lines else (x, y)
    own = None
    if path.heading is not None:
        own = cos_sin(Series.of([path.yaw(u, k) for k in range(4)], order))
    if isinstance(path, LaidPath):
        surface = compose(ground, *at, 0, 0, order)
    else:  # in space: its own height
        surface = Series.of([path.position(u, k)[:, 2] for k in range(4)], order)
    sign = 1.0 if path.plain else path.facing(u)
    pace = x.d() * x.d() + y.d() * y.d() + surface.d() * surface.d()
    if path.heading is not None:
        turn = Series.of([path.turning_length * path.yaw(u, k) for k in range(4)], order).d()
        pace = pace + turn * turn
    if ground.level:
        return _along(x.cut(order), y.cut(order), surface, own, pace.sqrt(), sign)
    if contacts is not None and ground.bends:
        ahead_of = own if own is not None else _direction(x, y, sign)
        z, slope_x, slope_y = _plane_under(ground, path, u, (x, y), ahead_of, contacts)
    else:
        z = surface
        slope_x = compose(ground, *at, 1, 0, order - 1)
        slope_y = compose(ground, *at, 0, 1, order - 1)
    up = unit((-slope_x, -slope_y, Series.of([np.ones(len(u))], order - 1)))
    origin = (x.cut(order), y.cut(order), z)
    if own is not None:
        ahead = (own[0], own[1], slope_x * own[0] + slope_y * own[1])
    else:
        travel = (x.d(), y.d(), z.d())
        off = scaled(up, dot(travel, up))
        ahead = (
            (travel[0] - off[0]) * sign,
            (travel[1] - off[1]) * sign,
            (travel[2] - off[2]) * sign,
        )
    forward = unit(ahead)
    return Frame(origin, forward, cross(up, forward), up, pace.sqrt())


def _along(
    x: Series,
    y: Series,
    z: Series,
    own: tuple[Series, Series] | None,
    pace: Series,
    sign: float | Array,
) -> Frame:
    """Frames where the path itself is the ground: its lateral axis stays level."""
    zero = Series(np.zeros((x.order, *x.c[0].shape)))
    if own is not None:  # on level ground, see Path
        cos, sin = own
        up = (zero, zero, zero + 1.0)
        return Frame((x, y, z), (cos, sin, zero), (-sin, cos, zero), up, pace)
    forward = unit((x.d() * sign, y.d() * sign, z.d() * sign))
    cos, sin = _direction(x, y, sign)
    left = (-sin, cos, zero)
    return Frame((x, y, z), forward, left, cross(forward, left), pace)


def samples_on(
    ground: Ground, path: Path, s: Array, u: Array, contacts: Array | None = None
) -> PathSamples:
    """Samples as ``paths.samples.sample_at``, with the posture that the ground gives."""
    return samples_of(frame_on(ground, path, u, contacts), s, u)


def samples_of(frame: Frame, s: Array, u: Array) -> PathSamples:
    """Samples of frames."""
    tangent = [frame.rate(c) for c in frame.origin]
    bend = [frame.rate(c) for c in tangent]
    v, w = frame.velocity, frame.turning
    twist = (v[0], v[1], w[2])
    (tx, ty, tz), (bx, by, bz) = ([c.at(0) for c in m] for m in (tangent, bend))
    up = [c.at(0) for c in frame.z]
    speed = np.sqrt(tx**2 + ty**2 + tz**2)
    moving = speed > _MOVING
    safe = np.where(moving, speed, 1.0)
    sideways = (
        up[0] * (ty * bz - tz * by) + up[1] * (tz * bx - tx * bz) + up[2] * (tx * by - ty * bx)
    )
    gravity = -np.column_stack([axis[2].at(0) for axis in (frame.x, frame.y, frame.z)])
    acceleration = frame.body((bend[0], bend[1], bend[2]))
    return PathSamples(
        s,
        u,
        np.column_stack([c.at(0) for c in frame.origin]),
        np.unwrap(np.arctan2(frame.x[1].at(0), frame.x[0].at(0))),
        np.column_stack([tx, ty, tz]),
        np.column_stack([c.at(0) for c in twist]),
        np.column_stack([frame.rate(c).at(0) for c in twist]),
        np.column_stack([c.at(0) for c in acceleration]),
        gravity,
        np.where(moving, sideways / safe**3, 0.0),
        np.where(moving, np.arcsin(np.clip(tz / safe, -1.0, 1.0)), 0.0),
        np.column_stack([c.at(0) for c in v]),
        np.column_stack([c.at(0) for c in w]),
        np.column_stack([frame.rate(c).at(0) for c in w]),
    )


def twist_bend(frame: Frame) -> Array:
    """(N, 3): second derivative of the twist along the path parameter, of frames of order 4."""
    v, w = frame.velocity, frame.turning
    return np.column_stack([frame.rate(frame.rate(c)).at(0) for c in (v[0], v[1], w[2])])


def _direction(x: Series, y: Series, sign: float | Array) -> tuple[Series, Series]:
    """Cosine and sine of the direction of travel in the ground plan, or where ``sign`` is -1 of the
    opposite one."""
    length = (x.d() * x.d() + y.d() * y.d()).sqrt() * sign
    return x.d() / length, y.d() / length


def _plane_under(
    ground: Ground,
    path: Path,
    u: Array,
    place: tuple[Series, Series],
    turn: tuple[Series, Series],
    contacts: Array,
) -> tuple[Series, Series, Series]:
    """Height at the origin and slopes along x and y of the plane through the heights under the
    wheels, least squares; ``turn``: cosine and sine of the heading. Raises InfeasibleError, with
    place, where there is no ground under a wheel."""
    (x, y), (cos, sin) = place, turn
    order = x.order - 1
    count = len(contacts)
    weights = np.column_stack([np.ones(count), contacts])
    if count < 3 or np.linalg.matrix_rank(weights, tol=1e-9) < 3:
        expected = "three wheels or more that do not stand on one line, to stand on this ground"
        raise ArgumentError("robot.wheels", contacts.tolist(), expected)
    fit = np.linalg.pinv(weights)
    found = [Series(np.zeros((order + 1, *x.c[0].shape))) for _ in range(3)]
    for (a, b), share in zip(contacts, fit.T, strict=True):
        px, py = x + cos * a - sin * b, y + sin * a + cos * b
        off = ~ground.covers(px.c[0], py.c[0])
        if off.any():
            i = int(np.argmax(off))
            raise InfeasibleError(
                "ground",
                float(path.parameter(u[[i]])[0]),
                f"there is none under a wheel, at ({px.c[0][i]:.3g}, {py.c[0][i]:.3g}) m",
            )
        h = compose(ground, px, py, 0, 0, order)
        found = [f + h * k for f, k in zip(found, share, strict=True)]
    height, along, across = found
    return height, along * cos - across * sin, along * sin + across * cos
