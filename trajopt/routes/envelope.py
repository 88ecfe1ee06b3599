"""What a robot's limits allow, in the few numbers that a route's program is written in.

Speeds of wheels, turning and steering are exact. Limits on forces are linear in the acceleration of
the body origin along and across, the yaw acceleration, and gravity: their rows are read off the
limits themselves, a cone for each wheel's friction, at several curvatures where wheels steer. Where
wheels share what they hold (capacity), one ellipsoid stands for all of them. The motion that comes out
is timed under the limits themselves (``time_scale``), so what is left out costs time at most, never
a limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.forces import Affine
from trajopt.limits.limit import Limit, is_linear
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.paths.segments import Clothoid
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.timing.track import track
from trajopt.world.ground import Ground
from trajopt.world.plane import Plane

SHARPEST = 2.0  # of curvature, times the turning length; chosen: wheels then hardly reverse
SHARE = 0.98  # of the largest steering angle that routes use; chosen, so that rounding breaks none
_POWERS = 5  # of curvature in rows of robots that steer; chosen: 1e-3 of friction
_MOST_ROWS = 16  # of one limit, that are written one by one; chosen: more become an ellipsoid
_MOST = 1e3  # m/s, m/s^2: no bound


@dataclass(frozen=True, eq=False)
class Envelope:
    """``speed`` (m/s); ``box``: accelerating, braking, m/s^2;
    ``cones`` (C, P, 4, 4) and ``planes`` (F, P, 4): coefficients of P powers of curvature; with w =
    (acceleration along and across the body less that of gravity, m/s^2; yaw acceleration, rad/s^2;
    gravity across the ground, a share), each cone says |first three rows of w| <= last row of w,
    each plane 0 <= row of w, scaled so that 1 is what there is at rest;
    ``first`` and ``second`` (R, 3): rows of rates by body twist, scaled to 1, the second zero where
    the rate has a sign; ``changes``: of the first rows, 1 / (largest change, 1/s);
    ``curvature`` (1/m); ``base`` (m) and ``turning`` (rad/s) of the steering, 0 and inf without.
    ``cog`` (x, y), m: what centripetal acceleration there is besides that of the origin.
    ``down``: what gravity pulls along x and y of the world, and into the ground, shares of g.
    ``free``: the heading is, with ``length`` (m) as in the path parameter."""

    speed: float
    box: tuple[float, float]
    cones: Array
    planes: Array
    first: Array
    second: Array
    changes: Array
    curvature: float
    base: float
    turning: float
    cog: tuple[float, float]
    down: tuple[float, float, float]
    free: bool
    length: float

    @property
    def bare(self) -> Envelope:
        """Of the geometry alone: without what depends on speeds."""
        none = np.zeros((0, 3))
        return replace(
            self,
            cones=np.zeros((0, 1, 4, 4)),
            planes=np.zeros((0, 1, 4)),
            first=none,
            second=none,
            changes=np.zeros(0),
            turning=np.inf,
        )


def envelope_of(
    robot: Robot, limits: Sequence[Limit], free: bool, ground: Ground | None = None
) -> Envelope:
    """The envelope of a robot whose heading is free, or along the path. Of the ``ground`` only the
    slope of a plane is known to it."""
    rows, changes = _rates(robot, limits, free)
    speeds = [limit.largest for limit in limits if isinstance(limit, Speed)]
    box = [limit for limit in limits if isinstance(limit, Acceleration)]
    exact = (Speed, YawRate, WheelSpeed, WheelAcceleration, SteeringRate, Acceleration)
    rest = [m for m in limits if not isinstance(m, exact) and is_linear(m)]
    curvature, base, turning = _steering(robot, limits)
    cones, planes = _forces(robot, rest, curvature if base and not free else 0.0)
    normal = ground.normal if isinstance(ground, Plane) else (0.0, 0.0, 1.0)
    if free and speeds:
        rows[0].insert(0, [1 / min(speeds), 0.0, 0.0])
        rows[1].insert(0, [0.0, 1 / min(speeds), 0.0])
        changes.insert(0, 0.0)
    return Envelope(
        _MOST if free else min([*speeds, _MOST]),
        _along(robot, box),
        cones,
        planes,
        np.reshape(rows[0], (-1, 3)),
        np.reshape(rows[1], (-1, 3)),
        np.array(changes),
        curvature,
        base,
        turning,
        robot.body.cog[:2],
        (normal[0], normal[1], normal[2]),
        free,
        robot.turning_length if free else 0.0,
    )


def _rates(
    robot: Robot, limits: Sequence[Limit], free: bool
) -> tuple[tuple[list[list[float]], list[list[float]]], list[float]]:
    """Rows of wheels' and the body's rates, and bounds of their changes by them."""
    first: list[list[float]] = []
    second: list[list[float]] = []
    changes: list[float] = []
    wheels = robot.rolling
    speed = np.full(len(wheels), np.inf)
    rate = np.full(len(wheels), np.inf)
    for limit in limits:
        if isinstance(limit, WheelSpeed):
            speed = np.minimum(speed, np.broadcast_to(limit.largest, speed.shape))
        if isinstance(limit, WheelAcceleration):
            rate = np.minimum(rate, np.broadcast_to(limit.largest, rate.shape))
        if isinstance(limit, YawRate):
            first.append([0.0, 0.0, 1 / limit.largest])
            second.append([0.0, 0.0, 0.0])
            changes.append(0.0)
    for i, wheel in enumerate(wheels):
        if not (np.isfinite(speed[i]) or np.isfinite(rate[i])):
            continue
        size = min(speed[i], _MOST)
        x, y = wheel.position
        if wheel.kind in ("steered", "castor"):
            first.append([1 / wheel.radius / size, 0.0, -y / wheel.radius / size])
            second.append([0.0, 1 / wheel.radius / size, x / wheel.radius / size])
        else:
            first.append((robot.inverse[i] / size).tolist())
            second.append([0.0, 0.0, 0.0])
        changes.append(float(size / rate[i]) if np.isfinite(rate[i]) else 0.0)
    if not free:  # along the path a steered wheel's second component is its turning alone
        for row in (*first, *second):
            row[1] = 0.0
    return (first, second), changes


def _steering(robot: Robot, limits: Sequence[Limit]) -> tuple[float, float, float]:
    """Largest curvature, distance of the steered wheels from the fixed axle, rate."""
    steering = steering_of(robot)
    curvature, base, turning = SHARPEST / robot.turning_length, 0.0, np.inf
    for group, place in zip(robot.description.steering, steering.group_place, strict=True):
        base = float(abs(place[0]))
        if group.range is not None and base > 0:
            largest = SHARE * min(-group.range[0], group.range[1])
            if 0 < largest < np.pi / 2:
                curvature = min(curvature, float(np.tan(largest) / base))
    for limit in limits:
        if isinstance(limit, SteeringRate) and limit.largest is not None:
            turning = min(turning, float(np.min(limit.largest)))
    return curvature, base, turning


def _along(robot: Robot, limits: Sequence[Acceleration]) -> tuple[float, float]:
    """Largest s'' and -s''."""
    ahead, back = _MOST, _MOST
    for limit in limits:
        rows = limit.rows(_probe(robot, 0.0), robot)
        a, c = rows.a[0], rows.c[0]
        ahead = min(ahead, float(np.min(c[a > 0] / a[a > 0], initial=_MOST)))
        back = min(back, float(np.min(-c[a < 0] / a[a < 0], initial=_MOST)))
    return ahead, back


def _probe(robot: Robot, curvature: float) -> PathSamples:
    """Four samples with steered wheels as on a circle; a unit acceleration along, across and in yaw,
    and none, under gravity straight down."""
    path = Path.segments([Clothoid(1.0, curvature, curvature)], start=(0.0, 0.0, 0.0))
    s = np.full(4, path.length / 2)
    steers = len(steering_of(robot).steered) > 0  # else wheels, castors too, as they are drawn
    found = track(path, robot if steers else None).samples(s, path.locate(s))
    ahead, yaw = np.eye(4, 3) * [1.0, 1.0, 0.0], np.eye(4, 3) * [0.0, 0.0, 1.0]
    return replace(
        found, velocity=ahead, turning=yaw, twist=ahead + yaw, gravity=np.tile([0.0, 0.0, -1.0], (4, 1))
    )  # fmt: skip


def _forces(robot: Robot, limits: Sequence[Limit], sharpest: float) -> tuple[Array, Array]:
    """``cones`` and ``planes`` of an envelope, fitted from curvatures up to ``sharpest``."""
    nodes = np.cos(np.pi * (np.arange(_POWERS) + 0.5) / _POWERS)
    probes = [_probe(robot, float(k)) for k in (sharpest * nodes if sharpest else [0.0])]
    cones, planes = list[Array](), list[Array]()
    for probe in probes:
        found = [_read(limit, probe, robot) for limit in limits]
        cones.append(np.concatenate([np.zeros((0, 4, 4)), *(f[0] for f in found)]))
        planes.append(np.concatenate([np.zeros((0, 4)), *(f[1] for f in found)]))
    places = np.array([probe.curvature[0] for probe in probes])
    inverse = np.linalg.inv(np.vander(places, increasing=True))
    return (
        np.einsum("pk,kc...->cp...", inverse, np.array(cones)),
        np.einsum("pk,kc...->cp...", inverse, np.array(planes)),
    )


def _read(limit: Limit, probe: PathSamples, robot: Robot) -> tuple[Array, Array]:
    """Cones (C, 4, 4) and planes (F, 4) of a limit."""
    if isinstance(limit, Slip) and limit.rule_of(robot) != "capacity":
        inside = np.sqrt(np.cos(np.pi / limit.sides))  # between the polygon's sides and corners
        cones = []
        for force, grip, _ in limit.shares(probe, robot):
            cone = np.zeros((4, 4))
            cone[: force.a.shape[1]] = _row(force)
            cone[3] = _row(grip)[0] * (inside if force.a.shape[1] == 2 else 1.0)
            cones.append(cone / cone[3, 3])
        return np.array(cones), np.zeros((0, 4))
    rows = limit.rows(probe, robot)
    planes = -_row(Affine(rows.a, rows.b, -rows.c))
    if not (planes[:, 3] > 0).all():
        raise InfeasibleError("start", 0.0, f"'{limit.name}' allows no motion on level ground")
    planes /= planes[:, 3:]
    if len(planes) <= _MOST_ROWS:
        return np.zeros((0, 4, 4)), planes
    # As far as the rows let each of the three go alone, there and back.
    with np.errstate(divide="ignore"):
        least, most = (np.min(np.where(sign * planes[:, :3] < 0, 1 / np.abs(planes[:, :3]), np.inf), axis=0) for sign in (-1, 1))  # fmt: skip
    cone = np.zeros((4, 4))
    cone[:3, :3] = np.diag(2 / (least + most))
    cone[:3, 3] = (least - most) / (least + most)
    cone[3, 3] = 1.0
    return cone[None], np.zeros((0, 4))


def _row(value: Affine) -> Array:
    """(K, 4): what a probe's values are times w."""
    return np.column_stack([value.a[:3].T, value.c[0]])
