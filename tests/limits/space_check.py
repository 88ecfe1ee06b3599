"""What a motion does in space, from its sampled poses and joint angles alone.

Nothing of the package's kinematics or forces is used: velocities and accelerations are finite
differences in time of world positions, rotations and joint angles, forces follow from Newton and
Euler for the rigid body, loads and shares from statics. Joint positions, sizes and masses come from
the robot's description.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import linprog

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
from trajopt.limits.friction import Friction, FrictionAlong, FrictionMap
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.robots.robot import Robot
from trajopt.timing.track import Track
from trajopt.timing.trajectory import Trajectory

G = 9.80665
CORNERS = 72  # a polygon that many sided around a circle is up to 0.1 % larger
FIRST = np.array([1, -8, 0, 8, -1]) / 12
SECOND = np.array([-1, 16, -30, 16, -1]) / 12


@dataclass(frozen=True)
class Instant:
    """Five poses h seconds apart: positions (5, 3), rotations (5, 3, 3), joint angles (5, K)."""

    h: float
    position: np.ndarray
    rotation: np.ndarray
    spin: np.ndarray
    steering: np.ndarray
    s: float  # path parameter

    def rate(self, values: np.ndarray) -> np.ndarray:
        return np.tensordot(FIRST, values, axes=1) / self.h

    def second(self, values: np.ndarray) -> np.ndarray:
        return np.tensordot(SECOND, values, axes=1) / self.h**2

    @property
    def axes(self) -> np.ndarray:
        """The body's axes now, columns."""
        return self.rotation[2]

    def points(self, body: np.ndarray) -> np.ndarray:
        """(5, 3) world places of a point that may move in the body, (3,) or (5, 3)."""
        return self.position + np.einsum("tij,tj->ti", self.rotation, np.broadcast_to(body, (5, 3)))

    @property
    def turning(self) -> np.ndarray:
        """Angular velocity in the world."""
        w = self.rate(self.rotation) @ self.axes.T
        return np.array([w[2, 1] - w[1, 2], w[0, 2] - w[2, 0], w[1, 0] - w[0, 1]]) / 2

    def moment(self, inertia: np.ndarray) -> np.ndarray:
        """Rate of the angular momentum about the centre of gravity, world, by differences."""
        # angular velocity at each of the inner poses from the poses beside it
        spins = []
        for i in (1, 2, 3):
            w = (self.rotation[i + 1] - self.rotation[i - 1]) / (2 * self.h) @ self.rotation[i].T
            spins.append([w[2, 1] - w[1, 2], w[0, 2] - w[2, 0], w[1, 0] - w[0, 1]])
        momenta = [
            r @ np.diag(inertia) @ r.T @ (np.array(w) / 2)
            for r, w in zip(self.rotation[1:4], spins, strict=True)
        ]
        return (momenta[2] - momenta[0]) / (2 * self.h)


def instants(trajectory: Trajectory, count: int, rng: np.random.Generator) -> list[Instant]:
    """At random times whose neighbours lie in one interval of constant s''."""
    widths = np.diff(trajectory.times)
    wide = np.flatnonzero(widths > 1e-3)
    found = []
    for i in rng.choice(wide, min(count, len(wide)), replace=False):
        h = min(widths[i] / 5, 4e-3)
        middle = trajectory.times[i] + widths[i] * rng.uniform(0.45, 0.55)
        times = middle + h * np.arange(-2, 3)
        state, s = trajectory.at(times), float(trajectory.along(times)[0][2])
        angles = state.spin_angles, state.steering_angles
        found.append(Instant(h, state.position, state.rotation, *angles, s))
    return found


def instant_of(track: Track, s: float, sdd: float, sd2: float, h: float = 1e-3) -> Instant:
    """At s, with s'^2 and a constant s'', whatever the limits."""
    t = h * np.arange(-2, 3)
    places = s + np.sqrt(sd2) * t + sdd * t**2 / 2
    u = track.path.locate(places)
    samples = track.samples(places, u)
    assert samples.wheels is not None
    angles = track.wheels.at(u), samples.wheels.steering
    return Instant(h, samples.position, samples.rotation, *angles, s)


def contact_slips(robot: Robot, now: Instant) -> np.ndarray:
    """(K,) m/s: of each wheel's lowest point, in the directions in which it may not slip."""
    slips, up = [], now.axes[:, 2]
    for k, wheel in enumerate(robot.description.wheels):
        angle = wheel.angle + now.steering[:, k]
        t = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
        n = np.stack([-np.sin(angle), np.cos(angle), 0 * angle], axis=1)
        pivot = np.array([*wheel.position, wheel.radius])
        centre = pivot - wheel.trail * t + wheel.lateral * n
        velocity = now.rate(now.points(centre))
        axle = now.axes @ n[2]
        forward = now.axes @ t[2]
        turning = now.turning + up * now.rate(now.steering[:, k]) + axle * now.rate(now.spin[:, k])
        slip = velocity + np.cross(turning, -wheel.radius * up)
        if wheel.kind == "spherical":
            slips.append(0.0)
        elif wheel.rollers is not None:
            roller = np.cos(wheel.rollers.angle) * forward + np.sin(wheel.rollers.angle) * axle
            slips.append(abs(slip @ roller))
        else:
            slips.append(float(np.hypot(slip @ forward, slip @ axle)))
    return np.array(slips)


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


def used(robot: Robot, limits: Sequence, now: Instant) -> dict[str, float]:
    """How much of every limit an instant uses; 1 is all of it."""
    velocity = now.rate(now.position)
    rolling = [[w.name for w in robot.description.wheels].index(n) for n in robot.wheel_names]
    there = statics(robot, now)
    found = {}
    for limit in limits:
        match limit:
            case Speed():
                found[limit.name] = planar(now, velocity) / limit.largest
            case Acceleration():
                before, after = (
                    np.hypot(
                        *((now.position[i + 1] - now.position[i - 1]) @ now.rotation[i, :, :2])
                    )
                    for i in (1, 3)
                )
                along = (after - before) / (2 * now.h) ** 2
                found[limit.name] = max(along / limit.forward, -along / limit.braking)
            case YawRate():
                found[limit.name] = abs(now.turning @ now.axes[:, 2]) / limit.largest
            case WheelSpeed():
                rates = np.abs(now.rate(now.spin))[rolling]
                found[limit.name] = float(np.max(rates / np.asarray(limit.largest)))
            case WheelAcceleration():
                rates = np.abs(now.second(now.spin))[rolling]
                found[limit.name] = float(np.max(rates / np.asarray(limit.largest)))
            case SteeringRate():
                found[limit.name] = np.abs(_group(robot, now, now.rate)).max() / limit.largest
            case SteeringAcceleration():
                found[limit.name] = np.abs(_group(robot, now, now.second)).max() / limit.largest
            case Tip():
                found[limit.name] = 1 - tip_margin(there) / G
            case Contact():
                found[limit.name] = 1 - there.loads.min() / (G / len(there.loads))
            case Slip():
                check = capacity_used if limit.rule == "capacity" else slip_used
                found[limit.name] = check(robot, now, there, limit)
            case _:
                raise NotImplementedError(limit)
    return found


def planar(now: Instant, velocity: np.ndarray) -> float:
    """Size of a velocity in the body's plane."""
    return float(np.hypot(velocity @ now.axes[:, 0], velocity @ now.axes[:, 1]))


def _group(robot: Robot, now: Instant, derivative) -> np.ndarray:
    """Derivative of the steering angles; of wheels steered alone, so that groups are wheels."""
    steered = [k for k, w in enumerate(robot.description.wheels) if w.kind == "steered"]
    assert all(len(g.wheels) == 1 for g in robot.description.steering)
    return derivative(now.steering)[steered]


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
