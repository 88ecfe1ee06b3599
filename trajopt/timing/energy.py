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
    back; losses of motors and gears are left out. Power is work per path times s', so s' drops out
    of the integral over s: three-point Gauss in every interval, where s'' is constant. Raises
    ArgumentError where torques are not known (``limits/torques.py``), or without a robot.
    """
    robot, path = require_robot("energy", trajectory.robot), trajectory.path
    back = np.zeros(len(robot.wheels))
    for motor in robot.description.motors:
        mine = [robot.wheel_names.index(name) for name in motor.wheels]
        back[mine] = 0.0 if motor.regeneration is None else motor.regeneration
    half = np.diff(trajectory.u)[:, None] / 2
    u = (trajectory.u[:-1, None] + half * (1 + _GAUSS_X)).ravel()
    s = path.parameter(u)
    before = trajectory.s[:-1].repeat(len(_GAUSS_X))
    sdd = trajectory.sdd.repeat(len(_GAUSS_X))
    sd2 = trajectory.sd[:-1].repeat(len(_GAUSS_X)) ** 2 + 2 * sdd * (s - before)
    work = motor_power(trajectory.track.samples(s, u), robot).at(sdd, sd2)
    spent = np.where(work > 0, work, back * work).sum(axis=1) * path.rate(u)
    cells = (spent.reshape(-1, len(_GAUSS_X)) * half) @ _GAUSS_W
    return np.concatenate([[0.0], np.cumsum(cells)])
