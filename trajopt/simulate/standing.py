"""How a robot stands on a stage before it moves."""

from __future__ import annotations

import math

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot
from trajopt.robots.steering import Steering, steering_of
from trajopt.simulate.model import Vector
from trajopt.simulate.scene import Stage

_RIM = np.linspace(0.0, 1.0, 6)  # share of a wheel's radius at which the ground is looked at
_AROUND = np.linspace(0.0, 2.0 * math.pi, 13)[:-1]


def standing(stand: Stage, robot: Robot, pose: Vector, steering: Array) -> tuple[Array, Array]:
    """Place (3,) of the robot frame and its axes (3, 3) at ``pose`` (x, y, heading seen from above)
    with wheels at ``steering`` (K,) rad: the posture of ``world.posture``, lifted until no wheel is
    in the ground. Raises ArgumentError where a wheel stands beyond a height field."""
    x, y, yaw = pose
    ahead = np.array([math.cos(yaw), math.sin(yaw)])
    turn = np.column_stack([ahead, [-ahead[1], ahead[0]]])
    wheels = steering_of(robot)
    ground = stand.scene.ground
    if ground.bends:
        places = np.array(pose[:2]) + wheels.place @ turn.T
        _require_ground(stand, places, pose)
        rows = np.column_stack([np.ones(len(places)), places - pose[:2]])
        z, *slope = np.linalg.lstsq(rows, stand.height(places), rcond=None)[0].tolist()
    else:
        z, *slope = (float(ground.partial(x, y, *order)) for order in ((0, 0), (1, 0), (0, 1)))
    forward = np.array([*ahead, float(ahead @ slope)])
    up = np.array([-slope[0], -slope[1], 1.0])
    forward, up = forward / np.linalg.norm(forward), up / np.linalg.norm(up)
    axes = np.column_stack([forward, np.cross(up, forward), up])
    place = np.array([x, y, z])
    if stand.field is not None:
        place[2] += _lift(stand, wheels, place, axes, steering, pose)
    return place, axes


def _lift(
    stand: Stage, wheels: Steering, place: Array, axes: Array, steering: Array, pose: Vector
) -> float:
    """Height (m) by which the wheels, as balls, must rise above the ground."""
    angle = wheels.angle + steering
    t = np.column_stack([np.cos(angle), np.sin(angle)])
    contact = wheels.place - wheels.trail[:, None] * t
    contact += wheels.lateral[:, None] * np.column_stack([-t[:, 1], t[:, 0]])
    centre = place + np.column_stack([contact, wheels.radius]) @ axes.T
    out = np.stack([np.cos(_AROUND), np.sin(_AROUND)], axis=1)[:, None, :] * _RIM[:, None]
    near = centre[:, None, None, :2] + out * wheels.radius[:, None, None, None]
    _require_ground(stand, near, pose)
    ball = wheels.radius[:, None, None] * np.sqrt(1.0 - _RIM**2)
    return float((stand.height(near) + ball - centre[:, 2, None, None]).max())


def _require_ground(stand: Stage, places: Array, pose: Vector) -> None:
    off = beyond(stand, places)
    if off:
        raise ArgumentError("start pose", pose, f"a start on the height map; {off}")


def beyond(stand: Stage, places: Array) -> str:
    """Which of places (..., 2) no engine has ground for; empty when all have."""
    if stand.field is None:
        return ""
    low = np.array(stand.field.origin)
    off = np.any((places < low) | (places > low + np.array(stand.field.size)), axis=-1)
    if not off.any():
        return ""
    x, y = places[off][0]
    return f"a wheel is at ({x:.3g}, {y:.3g}) m; take a larger map"
