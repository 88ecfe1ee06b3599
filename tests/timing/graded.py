"""What a motion on level ground does, from x, y and yaw of ``at()`` alone, sampled in every cell.

Nothing of the package's samples, rows or kinematics is used: velocities and accelerations are
differences in time, wheels and forces follow from the sizes of two robots. ``balls`` has two fixed
wheels on the y axis and balls in front and behind; ``plates`` has four Mecanum wheels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trajopt.robots.robot import Robot
from trajopt.timing.trajectory import Trajectory

G = 9.80665
RADIUS, HALF_TRACK, BALL, HEIGHT, COG_X = 0.1, 0.22, 0.3, 0.25, 0.03
HALF_BASE = 0.28  # of plates
MASS, INERTIA, WHEEL = 40.0, 2.0, 1.0  # kg, kg m^2, kg of a wheel
STALL, FREE = 9.0, 60.0  # N m, rad/s: the motors' curve
FIRST = np.array([1, -8, 0, 8, -1]) / 12
SECOND = np.array([-1, 16, -30, 16, -1]) / 12
MOST = 4000  # cells that are looked at
SIMPLE = np.array([0, 1, -2, 1, 0])
SURE, NEAR = 1e-5, 5e-5  # by how much differences over three lengths, and simpler ones, may differ


def _robot(name: str, wheels: list[dict], driven: list[str], place: float) -> Robot:
    return Robot.of(
        {
            "name": name,
            "body": {
                "mass": MASS,
                "cog": [COG_X, 0.0, HEIGHT],
                "yaw_inertia": INERTIA,
                "chassis": [0.7, 0.5, 0.2],
                "chassis_place": [place, 0.0],
                "clearance": 0.05,
            },
            "wheels": wheels,
            "motors": [
                {
                    "name": "drives",
                    "wheels": driven,
                    "torque": STALL,
                    "curve": [[0.0, STALL], [FREE, 0.0]],
                }
            ],
        }
    )


def ball_robot() -> Robot:
    """Two driven fixed wheels, balls in front and behind, centre of gravity off the axle."""
    size = {"radius": RADIUS, "width": 0.04, "mass": WHEEL}
    wheels = [
        {"name": name, "kind": "fixed", "position": [0.0, y], **size}
        for name, y in (("left", HALF_TRACK), ("right", -HALF_TRACK))
    ]
    wheels += [
        {"name": name, "kind": "spherical", "position": [x, 0.0], **size}
        for name, x in (("front", BALL), ("rear", -BALL))
    ]
    return _robot("balls", wheels, ["left", "right"], 0.0)


CORNERS = np.array([[1, 1], [1, -1], [-1, 1], [-1, -1]]) * [HALF_BASE, HALF_TRACK]
SLANT = np.array([-1, 1, 1, -1])  # of vy in the spin: rollers on the ground form a diamond


def plate_robot() -> Robot:
    """Four Mecanum wheels, centre of gravity off the middle."""
    names = ["front-left", "front-right", "rear-left", "rear-right"]
    wheels = [
        {
            "name": name,
            "kind": "swedish",
            "position": corner.tolist(),
            "radius": RADIUS,
            "width": 0.05,
            "mass": WHEEL,
            "rollers": {"count": 8, "angle": float(slant * np.pi / 4), "radius": 0.015},
        }
        for name, corner, slant in zip(names, CORNERS, SLANT, strict=True)
    ]
    return _robot("plates", wheels, names, 0.0)


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
    """The largest share of a limit that the motion uses; 1 is all of it: see ``shares``."""
    return shares(trajectory, [limit])[0][limit.name]


def shares(trajectory: Trajectory, limits: Sequence) -> tuple[dict[str, float], float]:
    """The largest share of each limit that the motion uses, 1 is all of it; and at what part of all
    places every limit could be told.

    At the middle and the quarters of every cell, by differences inside the cell, which no jump of
    the acceleration falls into. Places where differences over three lengths, and of two orders, do
    not agree tell nothing: there the digits of poses run out (a turn within 1e-8 m).
    """
    which = (
        "plates" if trajectory.robot is not None and len(trajectory.robot.wheels) == 4 else "balls"
    )
    poses = replace(trajectory, robot=None, limits=(), start_wheels=np.zeros(0))
    cells = looked_at(len(poses.sdd))
    found, told, places = {limit.name: 0.0 for limit in limits}, 0, 0
    for share, reach in ((0.25, 8.4), (0.5, 4.2), (0.75, 8.4)):
        now = [sampled(poses, cells, share, k / reach) for k in (1, 0.8, 0.6)]
        all_sure = True
        for limit in limits:
            values, simple = (
                np.stack([used(limit.name, one[n], limit, which) for one in now]) for n in (0, 1)
            )
            sure = (np.ptp(values, axis=0) < SURE) & (np.abs(simple - values).max(axis=0) < NEAR)
            sure &= np.convolve(sure, np.ones(7), mode="same") >= 5  # not by chance amid noise
            all_sure = all_sure & sure
            largest = float(values[0][sure].max(initial=0.0))
            found[limit.name] = max(found[limit.name], largest)
        told, places = told + np.sum(all_sure), places + len(values[0])
    return found, float(told / places)


def looked_at(count: int) -> np.ndarray:
    """All cells; of many, forty stretches of a hundred."""
    if count <= MOST:
        return np.arange(count)
    first = np.random.default_rng(count).integers(0, count - 100, MOST // 100)
    return np.unique(first[:, None] + np.arange(100))


def sampled(
    trajectory: Trajectory, cells: np.ndarray, share: float, reach: float
) -> tuple[Sampled, Sampled]:
    """At ``share`` of the time of cells (N,), by differences over ``reach`` of it, of fourth order
    and of second."""
    width = np.diff(trajectory.times)[cells]
    middle, h = trajectory.times[cells] + width * share, width * reach
    pose = trajectory.at((middle[:, None] + h[:, None] * np.arange(-2, 3)).ravel()).pose
    pose = pose.reshape(len(middle), 5, 3)
    pose = pose - pose[:, 2:3] * [1.0, 1.0, 0.0]  # far coordinates keep their digits
    rate = np.einsum("ntk,t->nk", pose, FIRST) / h[:, None]
    cos, sin = np.cos(pose[:, 2, 2]), np.sin(pose[:, 2, 2])

    def resolved(second: np.ndarray) -> Sampled:
        return Sampled(
            cos * rate[:, 0] + sin * rate[:, 1],
            cos * rate[:, 1] - sin * rate[:, 0],
            rate[:, 2],
            cos * second[:, 0] + sin * second[:, 1],
            cos * second[:, 1] - sin * second[:, 0],
            second[:, 2],
        )

    orders = (np.einsum("ntk,t->nk", pose, by) / h[:, None] ** 2 for by in (SECOND, SIMPLE))
    first, simple = (resolved(second) for second in orders)
    return first, simple


def used(name: str, now: Sampled, limit: object, which: str = "balls") -> np.ndarray:
    """(N,): the share of a limit that the motion uses; 1 is all of it."""
    if name == "speed":
        return np.hypot(now.vx, now.vy) / limit.largest
    if name == "yaw_rate":
        return np.abs(now.w) / limit.largest
    if name == "acceleration":
        speed = np.hypot(now.vx, now.vy)
        along = (now.vx * now.ax + now.vy * now.ay) / np.maximum(speed, 1e-9)
        return np.maximum(along / limit.forward, -along / limit.braking)
    spin, spin_rate = _spins(now, which)
    if name == "wheel_speed":
        return np.abs(spin).max(axis=1) / limit.largest
    if name == "wheel_acceleration":
        return np.abs(spin_rate).max(axis=1) / limit.largest
    fx = now.ax - now.w**2 * COG_X
    fy = now.ay + now.turn * COG_X
    if name == "tip":
        return _tip(fx, fy, which)
    loads = _loads(fx, fy, which)
    if name == "contact":
        return 1 - loads.min(axis=1) / (G / 4)  # of an even share of the weight
    along, torques = _torques(now, fx, fy, spin_rate, which)
    if name == "slip":
        force, held = np.abs(along) / MASS, limit.friction * loads
        if which == "balls":  # both wheels hold the same across
            force, held = np.hypot(force, fy[:, None] / 2), held[:, :2]
        over = force - held
        return 1 + over.max(axis=1) / (limit.friction * G / 4)
    if name == "wheel_torque":
        return np.abs(torques).max(axis=1) / limit.largest
    if name == "power":
        return np.sum(torques * spin, axis=1) / limit.largest
    assert name == "motor_curve"
    asked = torques * np.where(spin < 0, -1.0, 1.0)
    curve = asked / STALL + np.abs(spin) / FREE
    return np.maximum(curve.max(axis=1), np.abs(spin).max(axis=1) / FREE)


def _spins(now: Sampled, which: str) -> tuple[np.ndarray, np.ndarray]:
    """(N, W) each: spins and their rates. The derivative of vx is ax + w vy: body axes turn."""
    x1, y1 = now.ax + now.w * now.vy, now.ay - now.w * now.vx
    if which == "balls":
        sides = np.array([HALF_TRACK, -HALF_TRACK])
        return (
            (now.vx[:, None] - now.w[:, None] * sides) / RADIUS,
            (x1[:, None] - now.turn[:, None] * sides) / RADIUS,
        )
    arm = (HALF_BASE + HALF_TRACK) * np.array([-1, 1, -1, 1])
    return (
        (now.vx[:, None] + now.vy[:, None] * SLANT + now.w[:, None] * arm) / RADIUS,
        (x1[:, None] + y1[:, None] * SLANT + now.turn[:, None] * arm) / RADIUS,
    )


def _feet(which: str) -> np.ndarray:
    """(4, 2): contacts from the foot of the centre of gravity, m."""
    balls = np.array([[0, HALF_TRACK], [0, -HALF_TRACK], [BALL, 0], [-BALL, 0]])
    return (CORNERS if which == "plates" else balls) - [COG_X, 0.0]


def _tip(fx: np.ndarray, fy: np.ndarray, which: str) -> np.ndarray:
    """Zero-moment point in the support: a rhombus, or a rectangle. A row's scale is the distance of
    the centre of gravity from its edge."""
    zx, zy = -HEIGHT * fx / G, -HEIGHT * fy / G
    if which == "balls":
        reach = np.abs((zx + COG_X) / BALL) + np.abs(zy / HALF_TRACK)
        return 1 + (reach - 1) / (1 - abs(COG_X) / BALL)
    ahead, behind = zx / (HALF_BASE - COG_X), -zx / (HALF_BASE + COG_X)
    return np.maximum(np.maximum(ahead, behind), np.abs(zy) / HALF_TRACK)


def _loads(fx: np.ndarray, fy: np.ndarray, which: str) -> np.ndarray:
    """(N, 4): loads of least norm, m/s^2."""
    feet = _feet(which)
    balance = np.column_stack([np.ones(4), feet]).T
    demand = np.stack([np.full_like(fx, G), -HEIGHT * fx, -HEIGHT * fy])
    return (np.linalg.pinv(balance) @ demand).T


def _torques(
    now: Sampled, fx: np.ndarray, fy: np.ndarray, spin_rate: np.ndarray, which: str
) -> tuple[np.ndarray, np.ndarray]:
    """(N, W) each: forces of wheels on their rollers' axes (or along them), N, and torques, N m."""
    moment = INERTIA * now.turn
    if which == "balls":
        # Both hold the same across: that force acts COG_X behind the centre of gravity.
        half, pair = MASS * fx / 2, (moment + MASS * COG_X * fy) / (2 * HALF_TRACK)
        forces = np.stack([half - pair, half + pair], axis=1)
        along = forces
    else:
        axes = np.column_stack([np.ones(4), SLANT]) / np.sqrt(2)
        feet = _feet(which)
        arms = feet[:, 0] * axes[:, 1] - feet[:, 1] * axes[:, 0]
        wrench = np.stack([MASS * fx, MASS * fy, moment])
        along = (np.linalg.pinv(np.vstack([axes.T, arms])) @ wrench).T
        forces = along / np.sqrt(2)
    return along, RADIUS * forces + WHEEL * RADIUS**2 / 2 * spin_rate
