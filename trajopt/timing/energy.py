"""Work of a robot's motors along a motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from trajopt.arrays import Array
from trajopt.limits.limit import require_robot
from trajopt.limits.torques import motor_power

if TYPE_CHECKING:
    from trajopt.timing.trajectory import Trajectory

_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(3)


def energies(trajectory: Trajectory) -> Array:
    """(N+1,): work of all motors from the start to each gridpoint, J.

    Mechanical work of every motor where it drives, less what ``regeneration`` of its braking comes
    back; losses of motors and gears are left out. Three-point Gauss over the time of every
    interval. Raises ArgumentError where torques are not known (``limits/torques.py``), or without a
    robot.
    """
    robot = require_robot("energy", trajectory.robot)
    back = np.zeros(len(robot.wheels))
    for motor in robot.description.motors:
        mine = [robot.wheel_names.index(name) for name in motor.wheels]
        back[mine] = 0.0 if motor.regeneration is None else motor.regeneration
    cells = np.zeros(len(trajectory.sdd))
    for x, weight in zip(_GAUSS_X, _GAUSS_W, strict=True):
        u, s, speed, sdd = trajectory.inside((1 + x) / 2)
        work = motor_power(trajectory.track.samples(s, u), robot).at(sdd, speed**2)
        cells += weight / 2 * np.where(work > 0, work, back * work).sum(axis=1) * speed
    moving = np.diff(trajectory.times) - trajectory.waits[1:]
    return np.concatenate([[0.0], np.cumsum(cells * moving)])
