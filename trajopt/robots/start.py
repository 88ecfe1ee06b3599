"""Where castors and steered wheels stand at the start, as a caller gives it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.steering import Steering

_AGREE = 1e-6  # rad between given angles and those that one motion needs; chosen


def start_angles(steering: Steering, given: Mapping[str, Any]) -> dict[int, float]:
    """Checked start angles (rad, by name) of castors and steered wheels, by the wheel's place in the
    file; castors of one pivot share one. Raises ArgumentError for other wheels, angles that are not
    finite, castors of one pivot that disagree, and steering out of its range."""
    found: dict[int, float] = {}
    turning = [steering.names[i] for i in (*steering.steered, *steering.castors)]
    for name, angle in given.items():
        number = isinstance(angle, (int, float, np.number)) and not isinstance(angle, bool)
        if name not in turning or not number or not np.isfinite(angle):
            expected = f"finite angles, rad, of wheels among {', '.join(turning) or 'none'}"
            raise ArgumentError(f"start_steering['{name}']", angle, expected)
        found[steering.names.index(name)] = float(angle)
    for pivot in steering.robot.description.pivots:
        members = [steering.names.index(name) for name in pivot.wheels]
        angles = {found[i] for i in members if i in found}
        if len(angles) > 1:
            expected = f"one angle for the pivot '{pivot.name}'"
            raise ArgumentError("start_steering", sorted(angles), expected)
        found.update({i: next(iter(angles)) for i in members if angles})
    given_angles(steering, found)
    return found


def given_angles(steering: Steering, start: Mapping[int, float]) -> Array:
    """(S + G,): angles of steered wheels, then of groups, rad, that ``start`` (by wheel) means; NaN
    where it says nothing. Wheels of a group that it does not name stand as those that it names.
    Raises ArgumentError."""
    count = len(steering.steered)
    found = np.full(count + len(steering.groups), np.nan)
    place = {int(i): k for k, i in enumerate(steering.steered)}
    for g, members in enumerate(steering.groups):
        named = {int(i): start[int(i)] for i in members if int(i) in start}
        if not named:
            continue
        angle, wheels = _group(steering, g, named)
        low, high = steering.ranges[g]
        if not low - _AGREE <= angle <= high + _AGREE:
            name = steering.names[next(iter(named))]
            expected = (
                f"an angle for which its steering stands in its range, {low:g} to {high:g} rad"
            )
            raise ArgumentError(f"start_steering['{name}']", next(iter(named.values())), expected)
        found[count + g] = angle
        found[[place[int(i)] for i in members]] = wheels
    return found


def _group(steering: Steering, g: int, named: Mapping[int, float]) -> tuple[float, Array]:
    """Angle of a group and of all its wheels, of which some are given: the robot's motion for which
    those stand right tells the rest."""
    members, group = steering.groups[g], steering.robot.description.steering[g]
    at = np.array(list(named))
    direction = steering.angle[at] + np.array(list(named.values()))
    if len(members) == 1 or (group.rule == "parallel" and np.ptp(direction) <= _AGREE):
        wheels = direction[0] - steering.angle[members]
        return float(wheels[0]), wheels
    sin, cos = np.sin(direction), np.cos(direction)
    x, y = steering.steering_place[at].T
    # across its direction a wheel's place has no velocity
    across = np.column_stack([-sin, cos, x * cos + y * sin]) @ steering.robot.drivable
    _, sizes, axes = np.linalg.svd(across)
    free = axes[int((sizes > _AGREE).sum()) :]
    if len(free) != 1:
        expected = f"angles of all wheels of the steering '{group.name}'" + (
            "" if len(free) else ", as one motion of the robot needs them"
        )
        raise ArgumentError("start_steering", dict(_names(steering, named)), expected)
    twist = (steering.robot.drivable @ free[0])[None]
    wheels, _ = steering.headings(twist)
    groups, _ = steering.headings(twist, groups=True)
    near = next(iter(named.values()))
    found = [
        raw + np.pi * np.round((near - raw) / np.pi)
        for raw in (groups[0, [g]], wheels[0, np.searchsorted(steering.steered, members)])
    ]
    return float(found[0][0]), np.asarray(found[1])


def _names(steering: Steering, named: Mapping[int, float]) -> list[tuple[str, float]]:
    return [(steering.names[i], angle) for i, angle in named.items()]
