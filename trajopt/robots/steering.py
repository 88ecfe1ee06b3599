"""Wheel states along a path: spin, steering and castor angles, functions of geometry alone.

Rolling and sliding rows are homogeneous in rates, so everything is told per unit of path parameter
and needs no timing. With v the velocity of a wheel's pivot and w the yaw rate (body frame, per unit
of path parameter), t the wheel's rolling direction and n the axle's, to its left:

    steered wheel   its angle is the direction of v, or the opposite one
    castor          beta' = v.n / trail - w
    spin            r phi' = v.t - lateral (w + beta')

A castor's equation is solved along the path. In z = exp(i (angle + beta)), with v a complex number,
it is Riccati's, z' = (v - conj(v) z^2) / (2 trail) - i w z, so a stretch of path acts on z as a
Moebius map of SU(1,1): z -> (a z + b) / (conj(b) z + conj(a)), which the sixth-order Magnus
expansion gives for all stretches at once.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any, NamedTuple

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.errors import ArgumentError
from trajopt.robots.robot import Robot

Complex = np.ndarray[tuple[int, ...], np.dtype[np.complex128]]

_STILL = 1e-9  # of a wheel's largest velocity per path parameter: slower, its pivot stands still


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

    def headings(self, twist: Array, *, groups: bool = False) -> tuple[Array, BoolArray]:
        """(N, S): steering angles of the steered wheels, or (N, G) of groups, modulo pi, and where
        the place that sets them stands still, so that any angle does."""
        at = self.steered
        place, angle = self.steering_place[at], self.angle[at]
        if groups:
            place, angle = self.group_place, self.group_angle
        v = self.velocities(twist, place)
        speed = np.hypot(v[..., 0], v[..., 1])
        still = speed <= _STILL * float(np.abs(twist).max(initial=0.0))
        return np.arctan2(v[..., 1], v[..., 0]) - angle, still

    def group_rates(
        self, twist: Array, twist_rate: Array, twist_bend: Array
    ) -> tuple[Array, Array]:
        """(N, G): first and second derivative of the groups' angles along the path parameter."""
        parts = (self.velocities(m, self.group_place) for m in (twist, twist_rate, twist_bend))
        return _direction_rates(*parts)

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
            v, v1, v2 = (
                self.velocities(m, self.steering_place[self.steered])
                for m in (twist, twist_rate, twist_bend)
            )
            rate[:, self.steered], bend[:, self.steered] = _direction_rates(v, v1, v2)
            group_rate, group_bend = self.group_rates(twist, twist_rate, twist_bend)
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
        return WheelStates(zero, zero, zero, spin, spin_rate, none, none, contacts)

    def start_angles(self, given: Mapping[str, float]) -> dict[int, float]:
        """Checked start angles by wheel; castors of one pivot share one. Raises ArgumentError."""
        found: dict[int, float] = {}
        turning = [self.names[i] for i in (*self.steered, *self.castors)]
        for name, angle in given.items():
            if name not in turning or not np.isfinite(angle):
                expected = f"finite angles, rad, of wheels among {', '.join(turning) or 'none'}"
                raise ArgumentError(f"start_steering['{name}']", angle, expected)
            found[self.names.index(name)] = float(angle)
        for pivot in self.robot.description.pivots:
            members = [self.names.index(name) for name in pivot.wheels]
            angles = {found[i] for i in members if i in found}
            if len(angles) > 1:
                expected = f"one angle for the pivot '{pivot.name}'"
                raise ArgumentError("start_steering", sorted(angles), expected)
            found.update({i: next(iter(angles)) for i in members if angles})
        return found


@lru_cache(maxsize=64)
def steering_of(robot: Robot) -> Steering:
    """The wheels of a robot as arrays."""
    return Steering(robot)


def _direction_rates(v: Array, v1: Array, v2: Array) -> tuple[Array, Array]:
    """First and second derivative of the direction of v (N, S, 2), whose own are v1 and v2; where v
    is zero, the limits, the second taken as zero."""

    def cross(a: Array, b: Array) -> Array:
        return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])

    square, square1 = np.sum(v * v, axis=2), np.sum(v1 * v1, axis=2)
    still = square <= (_STILL * np.max(square + square1, initial=0.0)) ** 2
    safe, safe1 = np.where(still, 1.0, square), np.where(square1 > 0, square1, 1.0)
    rate = np.where(still, cross(v1, v2) / (2 * safe1), cross(v, v1) / safe)
    bend = np.where(still, 0.0, (cross(v, v2) - 2 * rate * np.sum(v * v1, axis=2)) / safe)
    return rate, bend


class _Turn(NamedTuple):
    """Matrices [[i p, q], [conj(q), -i p]] of su(1,1), arrays (M, C)."""

    p: Array
    q: Complex

    def __add__(self, other: tuple[Any, ...]) -> _Turn:
        return _Turn(self.p + other[0], self.q + other[1])

    def __sub__(self, other: _Turn) -> _Turn:
        return _Turn(self.p - other.p, self.q - other.q)

    def __mul__(self, factor: Any) -> _Turn:
        return _Turn(self.p * factor, self.q * factor)

    def with_(self, other: _Turn) -> _Turn:
        """The commutator."""
        p, q = self
        return _Turn(2 * np.imag(q * np.conj(other.q)), 2j * (p * other.q - other.p * q))


@dataclass(frozen=True, eq=False)
class Swivel:
    """Moebius maps z -> (a z + b) / (conj(b) z + conj(a)) of M stretches of path for C castors."""

    a: Complex  # (M, C)
    b: Complex  # (M, C)

    @classmethod
    def of(cls, v: Complex, w: Array, length: Array, trail: Array) -> Swivel:
        """From pivot velocities v (M, 3, C) and yaw rates w (M, 3) at the three Gauss points of
        each stretch, per unit of its length (M,); trail (C,), m."""
        h = length[:, None]
        first, middle, last = (
            _Turn(-w[:, i, None] / 2 + np.zeros(trail.shape), v[:, i] / (2 * trail))
            for i in range(3)
        )
        a1 = middle * h
        a2 = (last - first) * (np.sqrt(15.0) / 3 * h)
        a3 = (last - middle * 2 + first) * (10 / 3 * h)
        c1 = a1.with_(a2)
        c2 = a1.with_(a3 * 2 + c1) * (-1 / 60)
        p, q = a1 + a3 * (1 / 12) + (a1 * -20 - a3 + c1).with_(a2 + c2) * (1 / 240)
        square = np.abs(q) ** 2 - p**2
        root = np.sqrt(np.abs(square))
        small = root < 1e-8
        safe = np.where(small, 1.0, root)
        c = np.where(square >= 0, np.cosh(root), np.cos(root))
        s = np.where(small, 1.0, np.where(square >= 0, np.sinh(safe), np.sin(safe)) / safe)
        return cls(c + 1j * p * s, q * s)

    def follow(self, angle: Array) -> Array:
        """(M+1, C): castors' directions, rad, continuous, from ``angle`` (C,) on."""
        z, first = np.empty((len(self.a) + 1, self.a.shape[1]), dtype=complex), np.exp(1j * angle)
        for k in range(self.a.shape[1]):
            at, column = complex(first[k]), [complex(first[k])]
            for a, b in zip(self.a[:, k].tolist(), self.b[:, k].tolist(), strict=True):
                at = (a * at + b) / (b.conjugate() * at + a.conjugate())
                at /= abs(at)
                column.append(at)
            z[:, k] = column
        turned = np.angle(z[1:] * np.conj(z[:-1]))
        return np.vstack([angle, angle + np.cumsum(turned, axis=0)])
