"""Torque that falls with speed: the curves of the motors."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import ClassVar

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit, Rows, require_robot, spins
from trajopt.limits.torques import tangent_speed, wheel_torques
from trajopt.paths.samples import PathSamples
from trajopt.robots.description import MotorSection
from trajopt.robots.robot import Robot

Curve = tuple[tuple[float, float], ...]


@dataclass(frozen=True)
class MotorCurve(Limit):
    """Torque of every motor that has a ``curve`` in the robot's file <= its curve at the speed of
    the wheel, and the wheel no faster than the curve's last point.

    For a DC motor of stall torque T and free speed w: torque <= T (1 - |spin| s' / w). Torque
    against the motion is bounded likewise where ``braking = "curve"``. Speed is the square root of
    s'^2, so these are not linear in (s'', s'^2): rows are taken at ``path.sd2``, with the tangent of
    the root there. As the root bends down and a curve (or each part of it that ``pieces`` names)
    bends up, they are exact there and stricter everywhere else; time scaling repeats its passes until
    both agree. Without ``path.sd2`` rows hold the torque at rest.

    Raises ArgumentError for a robot whose motors have no curve, or without a robot, and as
    ``WheelTorque``.
    """

    name: str = "motor_curve"
    linear: ClassVar[bool] = False

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        robot = require_robot(self.name, robot)
        torque, (spin, _) = wheel_torques(path, robot), spins(path, robot)
        speed = tangent_speed(path.sd2)
        found: list[tuple[Array, ...]] = []
        fastest = np.full(len(path.s), np.inf)
        for motor in robot.description.motors:
            if motor.curve is None:
                continue
            curve = at_wheel(motor)
            for i in (robot.wheel_names.index(name) for name in motor.wheels):
                rate = np.abs(spin[:, i])
                with np.errstate(divide="ignore"):
                    fastest = np.minimum(fastest, (curve[-1][0] / rate) ** 2)
                forward = np.where(spin[:, i] < 0, -1.0, 1.0)
                for sign in (1.0, -1.0) if motor.braking == "curve" else (1.0,):
                    way = sign * forward
                    a, b, c = way * torque.a[:, i], way * torque.b[:, i], way * torque.c[:, i]
                    for piece in pieces(curve):
                        c0, b0 = _tangent(piece, rate, speed)
                        found.append((a, b + b0, c0 - c, np.full_like(a, curve[0][1])))
        if not found:
            raise ArgumentError(
                "robot.motors.curve", robot.name, f"a curve for the limit '{self.name}'"
            )
        a, b, c, scale = (np.stack(column, axis=1) for column in zip(*found, strict=True))
        return Rows(self.name, a, b, c, scale, fastest)


def at_wheel(motor: MotorSection) -> Curve:
    """The curve as the wheel sees it: speeds divided, torques multiplied by the gear."""
    gear = 1.0 if motor.gear is None else motor.gear
    return tuple((speed / gear, torque * gear) for speed, torque in motor.curve or ())


def pieces(curve: Curve) -> tuple[Curve, ...]:
    """Curves that bend up, or not, whose least is ``curve``: its lines where it bends down, else its
    level start and what follows."""
    lines = tuple(pairwise(curve))
    slopes = [(t1 - t0) / (w1 - w0) for (w0, t0), (w1, t1) in lines]
    if all(after <= before for before, after in pairwise(slopes)):
        return lines
    return (lines[0], curve[1:]) if slopes[0] == 0 else (curve,)


def _tangent(piece: Curve, rate: Array, speed: Array | None) -> tuple[Array, Array]:
    """(N,): c and b of torque + b s'^2 <= c, the tangent at path speeds (N,) of a piece's torque over
    s'^2, for wheels that turn ``rate`` rad/m; without speeds its torque at rest."""
    w, t = np.array(piece).T
    slopes = np.diff(t) / np.diff(w)
    if speed is None:
        return np.full_like(rate, t[0] - slopes[0] * w[0]), np.zeros_like(rate)
    spins = rate * speed
    k = np.clip(np.searchsorted(w, spins) - 1, 0, len(slopes) - 1)
    # T(rate sqrt(x)) with sqrt(x) <= speed / 2 + x / (2 speed)
    return t[k] + slopes[k] * (spins / 2 - w[k]), -slopes[k] * rate / (2 * speed)
