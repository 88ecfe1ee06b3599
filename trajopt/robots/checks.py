"""What is worth knowing of a described robot before it drives: does it stand, do its wheels fit its
outline, do its motors rule its motion.

A finding is a fault where the robot cannot do what its file says, a note where something follows
from the file that its reader may not expect.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.robots.mobility import (
    Mobility,
    admissible_at,
    forward_at,
    generic_steering,
    inverse_at,
    mobility_of,
    steering_for,
)
from trajopt.robots.robot import Robot

FEWEST_ROLLERS = 12  # around a wheel; with fewer it hobbles, measured in Bullet
_INSIDE = 1e-6  # m by which a wheel may touch its outline


@dataclass(frozen=True)
class Finding:
    """``fault``: the robot cannot do this as described."""

    about: str
    text: str
    fault: bool = False


def findings(robot: Robot) -> list[Finding]:
    """Faults and notes, in the order of the file: body, wheels, motors, steering."""
    return [*_body(robot), *_stand(robot), *_wheels(robot), *_motors(robot), *_steering(robot)]


def support_margin(robot: Robot) -> float:
    """m that the foot of the centre of gravity lies inside the polygon of the contacts, castors
    trailing or leading, whichever is less; not above 0 where it does not stand."""
    wheels = robot.description.wheels
    foot = np.array(robot.description.body.cog[:2])
    trailing = np.array([wheel.contact for wheel in wheels])
    leading = 2 * np.array([wheel.position for wheel in wheels]) - trailing
    return min(_depth(trailing - foot), _depth(leading - foot))


def _depth(points: Array) -> float:
    """Distance of the origin from the edge of the convex hull of ``points`` (K, 2), > 0 inside.

    The normals of the hull's edges are among those of all pairs, and in any direction the hull
    reaches at least as far as its nearest edge.
    """
    pairs = (points[:, None] - points[None]).reshape(-1, 2)
    pairs = pairs[np.hypot(*pairs.T) > 1e-9]
    if not len(pairs):
        return 0.0
    normals = np.column_stack([-pairs[:, 1], pairs[:, 0]]) / np.hypot(*pairs.T)[:, None]
    return float((normals @ points.T).max(axis=1).min())


def top_speed(robot: Robot) -> float:
    """m/s straight ahead, where the first motor is at its largest speed; inf where none has one, 0
    where the wheels forbid it."""
    ahead = np.array([1.0, 0.0, 0.0])
    angles = steering_for(robot, ahead)
    if not np.allclose(forward_at(robot, angles) @ inverse_at(robot, angles) @ ahead, ahead):
        return 0.0
    rates = np.abs(inverse_at(robot, angles) @ ahead)
    turning = rates > 1e-9
    return float((robot.motor_array("speed")[turning] / rates[turning]).min(initial=math.inf))


def _body(robot: Robot) -> list[Finding]:
    body, found = robot.description.body, list[Finding]()
    if body.yaw_inertia is None:
        text = f"{robot.yaw_inertia:.4g} kg m^2, from the masses of chassis and wheels"
        found.append(Finding("yaw inertia", f"not given: {text}"))
    if body.footprint is None:
        size = np.ptp(robot.footprint, axis=0)
        text = f"not given: the box around chassis and wheels, {size[0]:.3f} x {size[1]:.3f} m"
        found.append(Finding("outline", text))
    return found


def _stand(robot: Robot) -> list[Finding]:
    wheels = robot.description.wheels
    around = np.mean([wheel.contact for wheel in wheels], axis=0)
    if len(wheels) < 3 or not _depth(np.array([w.contact for w in wheels]) - around) > 1e-9:
        text = f"{len(wheels)} contacts: it needs three that do not lie on one line"
        return [Finding("stand", text, fault=True)]
    margin = support_margin(robot)
    if not margin > 0:
        text = f"the centre of gravity lies {-margin:.3f} m outside its contacts: it tips over"
        return [Finding("stand", text, fault=True)]
    return [Finding("stand", f"the centre of gravity lies {margin:.3f} m inside its contacts")]


def _wheels(robot: Robot) -> list[Finding]:
    found = list[Finding]()
    corners = np.array(robot.footprint)
    middle = corners.mean(axis=0)
    for name, places in robot.reached.items():
        shrunk = places + (middle - places) * _INSIDE
        if robot.description.body.footprint is not None and not _inside(shrunk, corners).all():
            text = f"{name} reaches beyond body.footprint"
            found.append(Finding("outline", text, fault=True))
    for wheel in robot.description.wheels:
        if wheel.rollers is None:
            continue
        around = wheel.rollers.count * (2 if wheel.double else 1)
        if around < FEWEST_ROLLERS:
            text = f"{wheel.name}: {around} around it, it hobbles below {FEWEST_ROLLERS}"
            found.append(Finding("rollers", text, fault=True))
    return found


def _inside(points: Array, corners: Array) -> Array:
    """(K,): whether points (K, 2) lie in a polygon, by the edges that a ray to the right
    crosses."""
    x, y = points.T[:, :, None]
    (x0, y0), (x1, y1) = corners.T, np.roll(corners, -1, axis=0).T
    crossed = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        at = x0 + (y - y0) * (x1 - x0) / (y1 - y0)
    return np.asarray(np.sum(crossed & (x < at), axis=1) % 2 == 1)


def _motors(robot: Robot) -> list[Finding]:
    degrees = mobility_of(robot)
    if degrees.mobility == 0:
        return [Finding("motion", "its wheels forbid every motion", fault=True)]
    found = list[Finding]()
    if degrees == Mobility(1, 0):
        text = "its wheels forbid every turn; give [skid] with an effective track to let them slide"
        found.append(Finding("motion", text, fault=True))
    angles, driven = generic_steering(robot), np.isin(robot.wheel_names, robot.driven)
    rates = inverse_at(robot, angles) @ admissible_at(robot, angles)
    rank = int(np.linalg.matrix_rank(rates[driven], tol=1e-9))
    if rank < degrees.mobility:
        text = f"motors rule {rank} of {_counted(degrees.mobility)}"
        found.append(Finding("motors", text, fault=True))
    elif int(driven.sum()) > rank:
        text = f"{driven.sum()} driven wheels for {_counted(rank)}: their speeds must agree"
        found.append(Finding("motors", text))
    speed = top_speed(robot)
    if 0 < speed < math.inf:
        found.append(Finding("motors", f"up to {speed:.3g} m/s straight ahead"))
    return found


def _counted(motions: int) -> str:
    return f"{motions} free motion{'s' if motions > 1 else ''}"


def _steering(robot: Robot) -> list[Finding]:
    return [
        Finding("steering", f"{group.name}: {_angles(group.range)}")
        for group in robot.description.steering
    ]


def _angles(turns: tuple[float, float] | None) -> str:
    if turns is None:
        return "without an end"
    return f"from {math.degrees(turns[0]):.1f} to {math.degrees(turns[1]):.1f} deg"
