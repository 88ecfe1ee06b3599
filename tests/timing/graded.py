"""What a motion on level ground does, from x, y and yaw of ``at()`` alone, sampled in every cell.

Nothing of the package's samples, rows or kinematics is used: velocities and accelerations are
differences in time, wheels and forces follow from the sizes of a robot with two fixed wheels on the
y axis and balls in front and behind.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory

G = 9.80665
RADIUS, HALF_TRACK, BALL, HEIGHT, COG_X = 0.1, 0.22, 0.3, 0.25, 0.03
FIRST = np.array([1, -8, 0, 8, -1]) / 12
SECOND = np.array([-1, 16, -30, 16, -1]) / 12


def ball_robot() -> Robot:
    """Two driven fixed wheels, balls in front and behind, centre of gravity off the axle."""
    size = {"radius": RADIUS, "width": 0.04, "mass": 1.0}
    wheels = [
        {"name": name, "kind": "fixed", "position": [0.0, y], **size}
        for name, y in (("left", HALF_TRACK), ("right", -HALF_TRACK))
    ]
    wheels += [
        {"name": name, "kind": "spherical", "position": [x, 0.0], **size}
        for name, x in (("front", BALL), ("rear", -BALL))
    ]
    return Robot.of(
        {
            "name": "balls",
            "body": {
                "mass": 40.0,
                "cog": [COG_X, 0.0, HEIGHT],
                "yaw_inertia": 2.0,
                "chassis": [0.7, 0.5, 0.2],
                "clearance": 0.05,
            },
            "wheels": wheels,
            "motors": [{"name": "drives", "wheels": ["left", "right"], "torque": 9.0}],
        }
    )


@dataclass(frozen=True)
class Sampled:
    """Rates in the body frame at N instants, SI."""

    vx: np.ndarray
    vy: np.ndarray
    w: np.ndarray
    ax: np.ndarray  # acceleration of the origin, body axes
    ay: np.ndarray
    turn: np.ndarray  # yaw acceleration


def worst(trajectory: Trajectory, limit: object) -> float:
    """The largest share of a limit that the motion uses; 1 is all of it.

    At the middle and the quarters of every cell, by differences inside the cell, which no jump of
    the acceleration falls into. Places where differences over three lengths do not agree tell
    nothing: there the digits of poses run out (a turn within 1e-8 m).
    """
    trajectory = replace(trajectory, robot=None, limits=(), start_wheels=np.zeros(0))  # poses alone
    found = 0.0
    for share, reach in ((0.25, 8.4), (0.5, 4.2), (0.75, 8.4)):
        values = np.stack(
            [used(limit.name, sampled(trajectory, share, k / reach), limit) for k in (1, 0.8, 0.6)]
        )
        sure = np.ptp(values, axis=0) < 1e-5
        found = max(found, float(values[0][sure].max(initial=0.0)))
    return found


def sampled(trajectory: Trajectory, share: float, reach: float) -> Sampled:
    """At ``share`` of every cell's time, by differences over ``reach`` of it."""
    width = np.diff(trajectory.times)
    middle, h = trajectory.times[:-1] + width * share, width * reach
    pose = trajectory.at((middle[:, None] + h[:, None] * np.arange(-2, 3)).ravel()).pose
    pose = pose.reshape(len(middle), 5, 3)
    pose = pose - pose[:, 2:3] * [1.0, 1.0, 0.0]  # far coordinates keep their digits
    rate = np.einsum("ntk,t->nk", pose, FIRST) / h[:, None]
    second = np.einsum("ntk,t->nk", pose, SECOND) / h[:, None] ** 2
    cos, sin = np.cos(pose[:, 2, 2]), np.sin(pose[:, 2, 2])
    return Sampled(
        cos * rate[:, 0] + sin * rate[:, 1],
        cos * rate[:, 1] - sin * rate[:, 0],
        rate[:, 2],
        cos * second[:, 0] + sin * second[:, 1],
        cos * second[:, 1] - sin * second[:, 0],
        second[:, 2],
    )


def used(name: str, now: Sampled, limit: object) -> np.ndarray:
    """(N,): the share of a limit that the motion uses; 1 is all of it."""
    if name == "speed":
        return np.hypot(now.vx, now.vy) / limit.largest
    if name == "yaw_rate":
        return np.abs(now.w) / limit.largest
    if name == "acceleration":
        speed = np.hypot(now.vx, now.vy)
        along = (now.vx * now.ax + now.vy * now.ay) / np.maximum(speed, 1e-9)
        return np.maximum(along / limit.forward, -along / limit.braking)
    if name == "wheel_speed":
        sides = np.multiply.outer([HALF_TRACK, -HALF_TRACK], now.w)
        return np.abs(now.vx - sides).max(axis=0) / RADIUS / limit.largest
    if name == "wheel_acceleration":
        # The derivative of vx is ax + w vy: the body's axes turn.
        forward = now.ax + now.w * now.vy
        sides = np.multiply.outer([HALF_TRACK, -HALF_TRACK], now.turn)
        return np.abs(forward - sides).max(axis=0) / RADIUS / limit.largest
    fx = now.ax - now.w**2 * COG_X
    fy = now.ay + now.turn * COG_X
    if name == "tip":
        # Zero-moment point, from the foot of the centre of gravity, and the rhombus of contacts.
        zx, zy = -HEIGHT * fx / G, -HEIGHT * fy / G
        reach = np.abs((zx + COG_X) / BALL) + np.abs(zy / HALF_TRACK)
        rest = abs(COG_X) / BALL
        return 1 + (reach - 1) / (1 - rest)
    arms = np.array(
        [[-COG_X, HALF_TRACK], [-COG_X, -HALF_TRACK], [BALL - COG_X, 0], [-BALL - COG_X, 0]]
    )
    balance = np.column_stack([np.ones(4), arms]).T
    demand = np.stack([np.full_like(fx, G), -HEIGHT * fx, -HEIGHT * fy])
    loads = np.linalg.pinv(balance) @ demand
    free = limit.friction * loads[:2].sum(axis=0)
    return 1 + (np.hypot(fx, fy) - free) / (limit.friction * G)
