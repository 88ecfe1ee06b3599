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
from limits.space_statics import G, capacity_used, slip_used, statics, tip_margin

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.contact import Contact
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
