"""Wheel states along a path: spin, steering and castor angles, functions of geometry alone.

Rolling and sliding rows are homogeneous in rates, so everything is told per unit of path parameter
and needs no timing. With v the velocity of a wheel's pivot and w the yaw rate (body frame, per unit
of path parameter), t the wheel's rolling direction and n the axle's, to its left:

    steered wheel   its angle is the direction of v, or the opposite one
    castor          beta' = v.n / trail - w
    spin            r phi' = v.t - lateral (w + beta')

A castor's equation is solved along the path, see ``robots/swivel.py``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.robots.robot import Robot

_STILL = 1e-9  # of a wheel's largest velocity per path parameter: slower, its pivot stands still
_NEAR = 1e-5  # m of path before and after a pivot's turning back; chosen
_NOISE = 1e-12  # relative, of cross products; chosen


@dataclass(frozen=True, eq=False)
class WheelStates:
    """Of all K wheels of a robot's file at N places; derivatives are along the path parameter."""

    steering: Array  # (N, K) rad, from the angle that the file gives; 0 for wheels that do not turn
    steering_rate: Array  # (N, K) rad/m
    steering_bend: Array  # (N, K) rad/m^2
    spin: Array  # (N, K) derivative of the wheel's angle, rad/m; 0 for balls
    spin_rate: Array  # (N, K) rad/m^2
    group_rate: Array  # (N, G) of the angle of each [[steering]], rad/m
    group_bend: Array  # (N, G) rad/m^2
    contacts: Array  # (N, K, 2) where the wheels stand in the body frame, m
    # (N, G): by how much group_rate jumps there, >= 0, rad/m: at knots, where curvature has corners
    group_jump: Array


@dataclass(frozen=True, eq=False)
class Steering:
    """The wheels of a robot as arrays (K,), in the order of its file."""

    robot: Robot

    @cached_property
    def names(self) -> tuple[str, ...]:
        return tuple(wheel.name for wheel in self.robot.description.wheels)

    @cached_property
    def rolling(self) -> IndexArray:
        """(W,): where the wheels of ``robot.wheels`` stand among all."""
        return np.array([self.names.index(n) for n in self.robot.wheel_names], dtype=np.intp)

    def _of(self, kind: str) -> BoolArray:
        return np.array([wheel.kind == kind for wheel in self.robot.description.wheels])

    @cached_property
    def steered(self) -> IndexArray:
        return np.flatnonzero(self._of("steered"))

    @cached_property
    def castors(self) -> IndexArray:
        return np.flatnonzero(self._of("castor"))

    @property
    def turns(self) -> bool:
        """Whether any wheel steers or swivels."""
        return bool(len(self.steered) or len(self.castors))

    @cached_property
    def angle(self) -> Array:
        return np.array([wheel.angle for wheel in self.robot.description.wheels])

    @cached_property
    def radius(self) -> Array:
        return np.array([wheel.radius for wheel in self.robot.description.wheels])

    @cached_property
    def trail(self) -> Array:
        return np.array([wheel.trail for wheel in self.robot.description.wheels])

    @cached_property
    def lateral(self) -> Array:
        return np.array([wheel.lateral for wheel in self.robot.description.wheels])

    @cached_property
    def place(self) -> Array:
        """(K, 2): wheel centres, castors' pivots, m."""
        return np.array([wheel.position for wheel in self.robot.description.wheels])

    @cached_property
    def groups(self) -> tuple[IndexArray, ...]:
        """The wheels of every [[steering]], whose angle is that of a wheel in their middle."""
        found = self.robot.description.steering
        return tuple(np.array([self.names.index(n) for n in g.wheels], np.intp) for g in found)

    @cached_property
    def group_place(self) -> Array:
        """(G, 2): the middle of every group's wheels, m."""
        return np.array([self.place[g].mean(axis=0) for g in self.groups]).reshape(-1, 2)

    @cached_property
    def group_angle(self) -> Array:
        """(G,): rolling direction at steering angle 0."""
        return np.array([self.angle[g[0]] for g in self.groups])

    @cached_property
    def ranges(self) -> Array:
        """(G, 2): from, to, rad; infinite where a steering turns without an end."""
        found = [g.range or (-np.inf, np.inf) for g in self.robot.description.steering]
        return np.array(found).reshape(-1, 2)

    @cached_property
    def steering_place(self) -> Array:
        """(K, 2): the places whose velocity sets steering angles: the wheels' own, or the middle of
        a group with parallel wheels."""
        place = self.place.copy()
        rules = [group.rule for group in self.robot.description.steering]
        for members, middle, rule in zip(self.groups, self.group_place, rules, strict=True):
            if rule == "parallel":
                place[members] = middle
        return place

    def velocities(self, twist: Array, places: Array) -> Array:
        """(N, P, 2): of points at places (P, 2) of a body with the twist (N, 3) (or a derivative of
        it)."""
        x, y = places[:, 0], places[:, 1]
        vx = twist[:, :1] - twist[:, 2:] * y
        return np.stack([vx, twist[:, 1:2] + twist[:, 2:] * x], axis=2)

    def headings(self, *motion: Array, groups: bool = False) -> tuple[Array, BoolArray]:
        """(N, S): steering angles of the steered wheels, or (N, G) of groups, modulo pi, at twists
        (N, 3) whose first and second derivatives may be given too; and where the place that sets
        them stands still with all that is given, so that any angle does."""
        at = self.steered
        place, angle = self.steering_place[at], self.angle[at]
        if groups:
            place, angle = self.group_place, self.group_angle
        found = np.zeros((len(motion[0]), len(place)))
        still = np.ones(found.shape, dtype=bool)
        for twist in motion:  # where a place stands still, it sets off along the next derivative
            v, moves = self._moving(twist, place)
            found = np.where(still & moves, np.arctan2(v[..., 1], v[..., 0]) - angle, found)
            still &= ~moves
        return found, still

    def _moving(self, twist: Array, place: Array) -> tuple[Array, BoolArray]:
        """Velocities of places (N, P, 2), or a derivative, and where it is not zero (N, P)."""
        v = self.velocities(twist, place)
        return v, np.hypot(v[..., 0], v[..., 1]) > _STILL * np.abs(twist).max(initial=0.0)

    def turning_rates(
        self, place: Array, twist: Array, twist_rate: Array, twist_bend: Array
    ) -> tuple[Array, Array]:
        """(N, P): first and second derivative along the path parameter of the directions in which
        places (P, 2) move. Where a place comes to rest and turns back, the limit of the first; the
        second is 0 there, and both where it rests on."""
        (v, moves), (v1, turns) = self._moving(twist, place), self._moving(twist_rate, place)
        v2, bent = self.velocities(twist_bend, place), _cross(v, v1)
        size, size1 = np.hypot(v[..., 0], v[..., 1]), np.hypot(v1[..., 0], v1[..., 1])
        # next to the turning back, cross products are rounding
        noise = _NOISE * np.abs(twist).max(initial=0.0) * size1
        moves &= (size > _NEAR * size1) | (np.abs(bent) > noise)
        square, square1 = np.where(moves, size**2, 1.0), np.where(turns, size1**2, np.inf)
        rate = np.where(moves, bent / square, _cross(v1, v2) / (2 * square1))
        bend = (_cross(v, v2) - 2 * rate * np.sum(v * v1, axis=2)) / square
        return rate, np.where(moves, bend, 0.0)

    def states(
        self, twist: Array, twist_rate: Array, twist_bend: Array | None, steering: Array
    ) -> WheelStates:
        """States at known steering angles (N, K); ``twist_bend`` (the second derivative) is needed
        where wheels are steered."""
        if not self.turns:
            return self.rigid(twist, twist_rate)
        shape, none = steering.shape, np.zeros((len(twist), 0))
        group_rate, group_bend = none, none
        rate, bend = np.zeros(shape), np.zeros(shape)
        if len(self.steered):
            assert twist_bend is not None
            motion = twist, twist_rate, twist_bend
            place = self.steering_place[self.steered]
            rate[:, self.steered], bend[:, self.steered] = self.turning_rates(place, *motion)
            group_rate, group_bend = self.turning_rates(self.group_place, *motion)
        v, v1 = self.velocities(twist, self.place), self.velocities(twist_rate, self.place)
        angle = self.angle + steering
        t = np.stack([np.cos(angle), np.sin(angle)], axis=2)
        n = np.stack([-t[..., 1], t[..., 0]], axis=2)
        along, across = np.sum(v * t, axis=2), np.sum(v * n, axis=2)
        w, w1, c = twist[:, 2:], twist_rate[:, 2:], self.castors
        rate[:, c], bend[:, c] = self.castor_rates(twist, twist_rate, steering)
        spin = (along - self.lateral * (w + rate)) / self.radius
        along1 = np.sum(v1 * t, axis=2) + across * rate
        spin_rate = (along1 - self.lateral * (w1 + bend)) / self.radius
        fixed = self.rigid(twist, twist_rate)
        plain = np.isin(np.arange(shape[1]), np.concatenate([self.steered, c]))
        return WheelStates(
            steering,
            rate,
            bend,
            np.where(plain, spin, fixed.spin),
            np.where(plain, spin_rate, fixed.spin_rate),
            group_rate,
            group_bend,
            self.place - self.trail[:, None] * t + self.lateral[:, None] * n,
            np.zeros_like(group_rate),
        )

    def castor_rates(self, twist: Array, twist_rate: Array, steering: Array) -> tuple[Array, Array]:
        """(N, C): first and second derivative of the castors' angles, at steering angles (N, K)."""
        c = self.castors
        angle, trail = self.angle[c] + steering[:, c], self.trail[c]
        cos, sin = np.cos(angle), np.sin(angle)
        v, v1 = (self.velocities(m, self.place[c]) for m in (twist, twist_rate))
        rate = (v[..., 1] * cos - v[..., 0] * sin) / trail - twist[:, 2:]
        across1 = v1[..., 1] * cos - v1[..., 0] * sin
        along = v[..., 0] * cos + v[..., 1] * sin
        return rate, (across1 - along * rate) / trail - twist_rate[:, 2:]

    def rigid(self, twist: Array, twist_rate: Array) -> WheelStates:
        """States of wheels that do not turn, from the robot's inverse kinematics."""
        shape, inverse = (len(twist), len(self.names)), self.robot.inverse
        spin, spin_rate, zero = np.zeros(shape), np.zeros(shape), np.zeros(shape)
        spin[:, self.rolling] = twist @ inverse.T
        spin_rate[:, self.rolling] = twist_rate @ inverse.T
        none, contacts = np.zeros((len(twist), 0)), np.broadcast_to(self.place, (*shape, 2))
        return WheelStates(zero, zero, zero, spin, spin_rate, none, none, contacts, none)


@lru_cache(maxsize=64)
def steering_of(robot: Robot) -> Steering:
    """The wheels of a robot as arrays."""
    return Steering(robot)


def _cross(a: Array, b: Array) -> Array:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
