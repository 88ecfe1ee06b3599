"""Wheel speeds and steering angles for a body twist, and the twist that wheels have measured, for
wheels of any kind.

Both are those of ``robots.steering`` at the angles at which castors and steered wheels stand.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.robots.robot import Robot
from trajopt.robots.steering import Steering, steering_of

SLOW = 0.03  # m/s of a steered wheel below which it keeps its angle, chosen: noise has no direction
_HALVINGS = 20  # in search of the sharpest turn that steering allows


@dataclass(frozen=True, eq=False)
class WheelCommands:
    """For a controller of ``robot``."""

    robot: Robot

    @cached_property
    def steering(self) -> Steering:
        return steering_of(self.robot)

    @cached_property
    def _swivels(self) -> list[list[int]]:
        """Wheels of each of ``measured.Measured.swivels``: castors alone, then pivots."""
        names, pivots = self.steering.names, self.robot.description.pivots
        shared = {name for pivot in pivots for name in pivot.wheels}
        alone = [[int(i)] for i in self.steering.castors if names[i] not in shared]
        return alone + [[names.index(name) for name in pivot.wheels] for pivot in pivots]

    def measured(self, steering: Array, swivels: Array) -> Array:
        """(K,): ``steering`` with the castors' angles as measured."""
        found = steering.copy()
        for wheels, angle in zip(self._swivels, swivels, strict=True):
            found[wheels] = angle
        return found

    def angles_of(self, steering: Array) -> Array:
        """(S,): ``measured.Targets.angles`` of all wheels' angles (K,); driven axles stay level."""
        tilts = sum(pivot.tilt == "driven" for pivot in self.robot.description.pivots)
        return np.append(steering[self.steering.steered], np.zeros(tilts))

    def at(self, twist: Array, steering: Array) -> tuple[Array, Array]:
        """Wheel speeds (W,) rad/s and steering angles (K,) rad for a ``twist`` (3,) (m/s, m/s,
        rad/s) at the angles ``steering`` (K,) at which wheels stand: steered ones turn from there
        by the shorter way, slow ones not at all; the robot turns as sharply as its steering
        allows."""
        wheels, found = self.steering, steering.copy()
        twist = self._allowed(twist)
        at = wheels.steered
        if len(at):
            angle, _ = wheels.headings(twist[None])
            turned = angle[0] + np.pi * np.round((steering[at] - angle[0]) / np.pi)
            v = wheels.velocities(twist[None], wheels.steering_place[at])[0]
            found[at] = np.where(np.hypot(*v.T) < SLOW, steering[at], turned)
        return self._rows(found) @ twist, found

    def twist(self, turned: Array, steering: Array) -> Array:
        """(3,): body motion (m, m, rad) in which wheels turned by ``turned`` (W,) rad at steering
        angles (K,), least squares; fixed and steered wheels do not slide."""
        wheels = self.steering
        radius = wheels.radius[wheels.rolling]
        kinds = [wheel.kind for wheel in self.robot.description.wheels]
        held = np.array([k in ("fixed", "steered") for k in kinds])
        if self.robot.description.skid is not None:
            held[:] = False
        angle = (wheels.angle + steering)[held]
        v = wheels.velocities(np.eye(3), wheels.place[held])
        across = (v[..., 1] * np.cos(angle) - v[..., 0] * np.sin(angle)).T
        rows = np.vstack([radius[:, None] * self._rows(steering), across])
        wanted = np.concatenate([radius * turned, np.zeros(len(across))])
        return np.asarray(np.linalg.lstsq(rows, wanted, rcond=None)[0])

    def _rows(self, steering: Array) -> Array:
        """(W, 3): wheel speeds for a unit of each part of a twist."""
        none, angles = np.zeros((3, 3)), np.tile(steering, (3, 1))
        spin = self.steering.states(np.eye(3), none, none, angles).spin
        return np.asarray(spin[:, self.steering.rolling].T)

    def _allowed(self, twist: Array) -> Array:
        """The twist with as much of its turn as the ranges of steering allow."""
        wheels = self.steering
        low, high = wheels.ranges.T
        if not np.isfinite(wheels.ranges).any():
            return twist

        def fits(share: float) -> bool:
            angle, still = wheels.headings((twist * [1.0, 1.0, share])[None], groups=True)
            angle = np.arctan(np.tan(angle))  # wheels roll backwards too
            return bool(np.all(still | ((angle >= low) & (angle <= high))))

        if fits(1.0):
            return twist
        few, many = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = (few + many) / 2.0
            few, many = (middle, many) if fits(middle) else (few, middle)
        return np.asarray(twist * [1.0, 1.0, few])
