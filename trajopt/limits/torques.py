"""What the ground and their own inertia ask of the motors, affine in (s'', s'^2).

A wheel's motor turns it against the force of its contact: torque = radius x force along the rolling
direction + moment of inertia x angular acceleration. Forces are those of ``grip.contact_forces``; a
roller's force acts with its part along the rolling direction. A wheel's moment of inertia is that of
a disc of its mass and radius. Left out: friction of bearings, rolling resistance, spin of wheels
that no motor drives.
"""

from __future__ import annotations

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.forces import Affine
from trajopt.limits.grip import contact_forces, holds_of
from trajopt.limits.limit import spins
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

SLOWEST = (
    1e-13  # m/s, chosen: below it the tangent of a root is too steep to compute with; wheels turn
)
# fast even at that speed where a path turns in no length


def ground_torques(path: PathSamples, robot: Robot) -> Affine:
    """(N, W): torques that forces of the ground ask of the motors of ``robot.wheels``, N m, positive
    where they drive a wheel along its rolling direction; 0 for a wheel without a motor.

    Raises ArgumentError where wheels slide, or cannot push the robot along x and y and turn it.
    """
    holds = holds_of(robot)
    names = [robot.description.wheels[i].name for i in holds.wheel]
    lever = np.zeros((len(robot.wheels), len(names)))
    for i, wheel in enumerate(robot.rolling):
        if wheel.name in robot.driven:
            mine = np.array([name == wheel.name for name in names])
            lever[i] = wheel.radius * np.where(mine, np.cos(holds.direction), 0.0)
    return contact_forces(path, robot).through(lever) * robot.body.mass


def knows_torques(robot: Robot | None) -> bool:
    """Whether ``wheel_torques`` has motors to tell of. Where wheels slide at every turn (skid
    steering) the ground decides what torque turning takes."""
    return robot is not None and bool(robot.driven) and robot.description.skid is None


def wheel_torques(path: PathSamples, robot: Robot) -> Affine:
    """(N, W): as ``ground_torques``, with what spins the driven wheels up themselves."""
    spin, spin_rate = spins(path, robot)
    inertia = np.array(
        [w.mass * w.radius**2 / 2 if w.name in robot.driven else 0.0 for w in robot.rolling]
    )
    own = Affine(spin * inertia, spin_rate * inertia, np.zeros_like(spin))
    return ground_torques(path, robot) + own


def motor_power(path: PathSamples, robot: Robot) -> Affine:
    """(N, W): work of the motors of ``robot.wheels`` per unit of path, N: their power is this times
    s'."""
    spin, _ = spins(path, robot)
    return wheel_torques(path, robot) * spin


def tangent_speed(sd2: Array | None) -> Array | None:
    """(N,): path speeds, m/s, at which limits that are not linear in s'^2 take their tangents."""
    return None if sd2 is None else np.sqrt(np.maximum(sd2, SLOWEST**2))
