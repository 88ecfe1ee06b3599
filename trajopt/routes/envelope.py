"""What a robot's limits allow, in the few numbers that a route's program is written in.

Speeds of wheels, turning and steering are exact. Friction, tipping and loads enter as an ellipse in
accelerations along and across the body, whose axes are those of the limits' own rows on a straight
line and on a circle; torques as a box. The motion that comes out is timed under the limits
themselves (``time_scale``), so what the ellipse leaves out costs time at most, never a limit.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit, is_linear
from trajopt.limits.speed import Speed
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.wheel_torque import WheelTorque
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of
from trajopt.timing.stages import assemble
from trajopt.timing.track import track

SHARPEST = 2.0  # of curvature, times the turning length; chosen: wheels then hardly reverse
SHARE = 0.98  # of the largest steering angle that routes use; chosen, so that rounding breaks none
_RADIUS = 5.0  # m of the circle on which friction is read; chosen
_MOST = 1e3  # m/s, m/s^2: no bound


@dataclass(frozen=True, eq=False)
class Envelope:
    """``speed`` (m/s); ``box`` and ``ellipse``: accelerating, braking (and across), m/s^2;
    ``first`` and ``second`` (R, 3): rows of rates by body twist, scaled to 1, the second zero where
    the rate has a sign; ``changes``: of the first rows, 1 / (largest change, 1/s);
    ``curvature`` (1/m); ``base`` (m) and ``turning`` (rad/s) of the steering, 0 and inf without.
    Accelerations are those of the centre of gravity, ``cog`` (x, y), m.
    ``free``: the heading is, with ``length`` (m) as in the path parameter."""

    speed: float
    box: tuple[float, float]
    ellipse: tuple[float, float, float]
    first: Array
    second: Array
    changes: Array
    curvature: float
    base: float
    turning: float
    cog: tuple[float, float]
    free: bool
    length: float


def envelope_of(robot: Robot, limits: Sequence[Limit], free: bool) -> Envelope:
    """The envelope of a robot whose heading is free, or along the path."""
    rows, changes = _rates(robot, limits, free)
    speeds = [limit.largest for limit in limits if isinstance(limit, Speed)]
    box_kinds = (Acceleration, WheelTorque)
    box = [limit for limit in limits if isinstance(limit, box_kinds)]
    exact = (Speed, YawRate, WheelSpeed, WheelAcceleration, SteeringRate, *box_kinds)
    rest = [m for m in limits if not isinstance(m, exact) and is_linear(m)]
    ahead, back = _along(robot, box, free, 0.0)
    slip = _along(robot, rest, free, 0.0)
    across = min(_along(robot, rest, free, np.pi / 2)) if free else _across(robot, rest)
    curvature, base, turning = _steering(robot, limits)
    if free and speeds:
        rows[0].insert(0, [1 / min(speeds), 0.0, 0.0])
        rows[1].insert(0, [0.0, 1 / min(speeds), 0.0])
        changes.insert(0, 0.0)
    return Envelope(
        _MOST if free else min([*speeds, _MOST]),
        (ahead, back),
        (*slip, across),
        np.reshape(rows[0], (-1, 3)),
        np.reshape(rows[1], (-1, 3)),
        np.array(changes),
        curvature,
        base,
        turning,
        robot.body.cog[:2],
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


def _along(robot: Robot, limits: Sequence[Limit], free: bool, turn: float) -> tuple[float, float]:
    """Largest s'' and -s'' near rest on a straight line, at an angle to the body's axis."""
    if not limits:
        return _MOST, _MOST
    line = np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]])
    heading = np.full(3, -turn) if free else None
    path = Path.through(line, heading=heading, turning_length=robot.turning_length)
    rows = assemble(track(path, robot).samples(np.array([1.0]), path.locate([1.0])), limits, robot)
    a, c = rows.a[0], rows.c[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        ahead = np.where(a > 1e-12, c / a, np.inf).min(initial=_MOST)
        back = np.where(a < -1e-12, c / -a, np.inf).min(initial=_MOST)
    if not (ahead > 0 and back > 0):
        raise InfeasibleError("start", 0.0, "the limits allow no motion on a straight line")
    return float(ahead), float(back)


def _arc(sign: float) -> Path:
    angle = np.linspace(0.0, 1.0, 9)
    return Path.through(_RADIUS * np.column_stack([np.sin(angle), sign * (1 - np.cos(angle))]))


def _across(robot: Robot, limits: Sequence[Limit]) -> float:
    """Largest lateral acceleration at constant speed on a circle, either way round."""
    found = _MOST
    for sign in (1.0, -1.0) if limits else ():
        path = _arc(sign)
        s = np.array([path.length / 2])
        samples = track(path, robot).samples(s, path.locate(s))
        rows = assemble(samples, limits, robot)
        b, c = rows.b[0], rows.c[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            fastest = np.where(b > 1e-12, c / b, np.inf).min(initial=np.inf)
        fastest = min(float(fastest), float(rows.sd2_max[0]))
        found = min(found, fastest * abs(float(samples.curvature[0])))
    return found
