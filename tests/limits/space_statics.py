"""Forces and loads of a motion in space by Newton, Euler and statics: see space_check.py."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import linprog

from trajopt.limits.friction import Friction, FrictionAlong, FrictionMap
from trajopt.limits.slip import Slip
from trajopt.robots.robot import Robot

if TYPE_CHECKING:
    from limits.space_check import Instant

G = 9.80665
CORNERS = 72  # a polygon that many sided around a circle is up to 0.1 % larger


@dataclass(frozen=True)
class Statics:
    """Force and moment that the ground gives the body, per mass in its axes; arms (K, 3) and loads
    (K,) of wheels, and of what holds the body up: wheels, and axles that tilt."""

    force: np.ndarray
    moment: np.ndarray
    arms: np.ndarray
    loads: np.ndarray
    cog: np.ndarray
    axles: list[Axle]


@dataclass(frozen=True)
class Axle:
    """``wheels`` on an axle that turns freely about the line through ``middle`` (3,), from the
    centre of gravity, along ``ahead`` (3,)."""

    wheels: list[int]
    middle: np.ndarray
    ahead: np.ndarray


def axles_that_tilt(robot: Robot, now: Instant) -> list[Axle]:
    found, wheels = [], robot.description.wheels
    for pivot in robot.description.pivots:
        if pivot.tilt == "passive":
            mine = [k for k, wheel in enumerate(wheels) if wheel.name in pivot.wheels]
            first = wheels[mine[0]]
            angle = first.angle + now.steering[2, mine[0]]
            ahead = np.array([np.cos(angle), np.sin(angle), 0.0])
            joint = np.array([*first.position, first.radius])
            middle = joint - first.trail * ahead - np.array(robot.body.cog)
            found.append(Axle(mine, middle, ahead))
    return found


def statics(robot: Robot, now: Instant) -> Statics:
    body = robot.body
    acceleration = now.second(now.points(np.array(body.cog))) + np.array([0.0, 0.0, G])
    force = now.axes.T @ acceleration
    inertia = np.array([body.roll_inertia, body.pitch_inertia, body.yaw_inertia]) / body.mass
    moment = now.axes.T @ now.moment(inertia)
    arms = []
    for k, wheel in enumerate(robot.description.wheels):
        angle = wheel.angle + now.steering[2, k]
        c, s = np.cos(angle), np.sin(angle)
        x = wheel.position[0] - wheel.trail * c - wheel.lateral * s
        y = wheel.position[1] - wheel.trail * s + wheel.lateral * c
        arms.append([x - body.cog[0], y - body.cog[1], -body.cog[2]])
    arms = np.array(arms)
    # the tangential forces all act at the contacts' height: only their sum tips the body
    tilt = moment - np.cross([0.0, 0.0, -body.cog[2]], [force[0], force[1], 0.0])
    balance = np.vstack([np.ones(len(arms)), arms[:, 1], -arms[:, 0]])
    wanted = [force[2], tilt[0], tilt[1]]
    axles, cog = axles_that_tilt(robot, now), np.array(body.cog)
    level = shares(robot, now, Statics(force, moment, arms, np.zeros(len(arms)), cog, axles))
    for axle in axles:  # the moment of loads and forces of its wheels about its axis
        turning = np.zeros(len(arms))
        along = 0.0
        for k in axle.wheels:
            arm = arms[k] - axle.middle
            turning[k] = np.cross(arm, [0.0, 0.0, 1.0]) @ axle.ahead
            along += float(np.cross(arm, [*level.get(k, (0.0, 0.0)), 0.0]) @ axle.ahead)
        balance, wanted = np.vstack([balance, turning]), [*wanted, -along]
    loads = np.linalg.lstsq(balance, np.array(wanted))[0]
    return Statics(force, moment, arms, loads, cog, axles)


def possible(
    robot: Robot, now: Instant, found: Statics
) -> tuple[np.ndarray, list[int], np.ndarray, np.ndarray]:
    """Directions (F, 2) of all forces of wheels that can hold, the wheel of each, and the equations
    (E, F), (E,) that forces per mass obey: sums, yaw moment, pivots that turn freely."""
    driven = {name for motor in robot.description.motors for name in motor.wheels}
    pivots = [set(p.wheels) for p in robot.description.pivots]
    together = set().union(*pivots) if pivots else set()
    pivots += [{w.name} for w in robot.description.wheels if w.kind == "castor"]
    pivots = [p for p in pivots if p & driven and not (len(p) == 1 and p <= together)]
    columns, owner = [], []
    for k, wheel in enumerate(robot.description.wheels):
        angle = wheel.angle + now.steering[2, k]
        if wheel.rollers is not None:
            angles = [angle + wheel.rollers.angle] if wheel.name in driven else []
        elif wheel.kind == "spherical" or (
            wheel.kind == "castor" and not any(wheel.name in p for p in pivots)
        ):
            angles = []
        else:
            angles = [angle] if wheel.name in driven else []
            angles.append(angle + np.pi / 2)
        for direction in angles:
            columns.append([np.cos(direction), np.sin(direction)])
            owner.append(k)
    d, at = np.array(columns), found.arms[owner]
    rows = [d[:, 0], d[:, 1], at[:, 0] * d[:, 1] - at[:, 1] * d[:, 0]]
    wanted = [found.force[0], found.force[1], found.moment[2]]
    for pivot in pivots:
        lever = []
        for k, e in zip(owner, d, strict=True):
            wheel = robot.description.wheels[k]
            arm = found.arms[k, :2] + np.array(robot.body.cog[:2]) - np.array(wheel.position)
            lever.append(arm[0] * e[1] - arm[1] * e[0] if wheel.name in pivot else 0.0)
        rows.append(np.array(lever))
        wanted.append(0.0)
    return d, owner, np.array(rows), np.array(wanted)


def shares(robot: Robot, now: Instant, found: Statics) -> dict[int, np.ndarray]:
    """Least-norm force of every wheel that can hold, in the body's x and y, per mass."""
    d, owner, rows, wanted = possible(robot, now, found)
    forces = np.linalg.lstsq(rows, wanted)[0]
    return {
        k: sum(f * e for f, e, o in zip(forces, d, owner, strict=True) if o == k)
        for k in dict.fromkeys(owner)
    }


def tip_margin(found: Statics) -> float:
    """Load on the far side of the edge that tips first: over every pair of contacts, or middles of
    axles that tilt, with all others on one side."""
    together = {k for axle in found.axles for k in axle.wheels}
    alone = [k for k in range(len(found.loads)) if k not in together]
    points = np.array([found.arms[k, :2] for k in alone] + [a.middle[:2] for a in found.axles])
    loads = [*found.loads[alone], *(found.loads[a.wheels].sum() for a in found.axles)]
    least, centre = np.inf, np.array(loads) @ points
    for i in range(len(points)):
        for j in range(len(points)):
            edge = points[j] - points[i]
            length = np.hypot(*edge)
            if length < 1e-9:
                continue
            normal = np.array([edge[1], -edge[0]]) / length
            distance = float(normal @ points[i])
            if np.all(points @ normal <= distance + 1e-12):
                least = min(least, (found.loads.sum() * distance - normal @ centre) / distance)
    return float(least)


def capacity_used(robot: Robot, now: Instant, there: Statics, limit: Slip) -> float:
    """The least share of every wheel's friction with which any forces hold the robot: a linear
    programme, whose cones have CORNERS sides outside them."""
    d, owner, rows, wanted = possible(robot, now, there)
    mu, count = friction_under(now, there, limit.friction), len(owner)
    angles = 2 * np.pi * np.arange(CORNERS) / CORNERS
    bounds = []
    for k in dict.fromkeys(owner):
        mine = np.array([o == k for o in owner])
        for normal in np.column_stack([np.cos(angles), np.sin(angles)]):
            hold = max(mu[k] * there.loads[k], 1e-9)
            bounds.append([*np.where(mine, d @ normal, 0.0), -hold])
    done = linprog(
        [*np.zeros(count), 1.0],
        A_ub=np.array(bounds),
        b_ub=np.zeros(len(bounds)),
        A_eq=np.column_stack([rows, np.zeros(len(rows))]),
        b_eq=wanted,
        bounds=[(None, None)] * count + [(0, None)],
    )
    assert done.status == 0, done.message
    return float(done.x[-1])


def slip_used(robot: Robot, now: Instant, there: Statics, limit: Slip) -> float:
    return max(
        force / max(hold, 1e-9) for force, hold in forces_and_holds(robot, now, there, limit)
    )


def forces_and_holds(
    robot: Robot, now: Instant, there: Statics, limit: Slip
) -> list[tuple[float, float]]:
    """Force and friction times load, m/s^2, of every wheel that holds, or of all together."""
    driven = {name for motor in robot.description.motors for name in motor.wheels}
    wheels, mu = robot.description.wheels, friction_under(now, there, limit.friction)
    forces = shares(robot, now, there)
    alone = all(wheels[k].kind in ("fixed", "steered") and wheels[k].name in driven for k in forces)
    if limit.rule == "load":
        assert alone
        hold = sum(mu[k] * there.loads[k] for k in forces)
        return [(float(np.hypot(*there.force[:2])), hold)]
    return [(float(np.hypot(*f)), mu[k] * there.loads[k]) for k, f in forces.items()]


def friction_under(now: Instant, there: Statics, friction: Friction) -> np.ndarray:
    """(K,) under every wheel."""
    count = len(there.loads)
    if isinstance(friction, FrictionAlong):
        return np.full(count, np.interp(now.s, friction.places, friction.values))
    if isinstance(friction, FrictionMap):
        places = now.position[2] + (there.arms + there.cog) @ now.axes.T
        rows, columns = np.shape(friction.values)
        x, y = (
            friction.origin[k] + friction.spacing * np.arange(n)
            for k, n in ((0, columns), (1, rows))
        )
        return RegularGridInterpolator((x, y), np.asarray(friction.values).T)(places[:, :2])
    return np.broadcast_to(np.asarray(friction, dtype=float), (count,))
