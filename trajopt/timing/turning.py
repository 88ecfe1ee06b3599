"""How castors swivel and steered wheels turn along a path, whatever the timing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots.steering import Steering
from trajopt.robots.swivel import Swivel
from trajopt.timing.steered import Motion, Turn, cells, steered_along

_GAUSS = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(15.0) / 10
_SWIVEL = 1e-7  # rad by which castor angles may change when cells are halved a last time; chosen
_STEP = 0.5  # trails that a castor's pivot goes in a first cell, at most; chosen
_ROUNDS = 14  # of halving cells; chosen


@dataclass(frozen=True, eq=False)
class Turning:
    """Castors' angles (M, C), first and second derivatives along s at both ends of every cell (M-1,
    2, C), at places s (M,); steered wheels' angles (P, S) at spline parameters u (P,), which tell
    one half turn from the next; and how they turn where the robot rests."""

    steering: Steering
    s: Array
    castor: Array
    castor_rate: Array
    castor_bend: Array
    u: Array
    steered: Array
    turns: tuple[Turn, ...] = ()
    castor_u: Array = field(default_factory=lambda: np.zeros(0))  # (M,) spline parameters of s

    def at(self, samples: PathSamples, bend: Array | None) -> Array:
        """(N, K): steering angles of all wheels, rad, at samples and the second derivative of their
        twist (needed where wheels are steered)."""
        s, u = samples.s, samples.u
        found = np.zeros((len(s), len(self.steering.names)))
        if len(self.steering.castors):
            found[:, self.steering.castors] = self._castors(s)
        if len(self.steering.steered):
            assert bend is not None
            angle, still = self.steering.headings(samples.twist, samples.twist_rate, bend)
            near = np.stack([np.interp(u, self.u, column) for column in self.steered.T], axis=1)
            turned = angle + np.pi * np.round((near - angle) / np.pi)
            found[:, self.steering.steered] = np.where(still, near, turned)
        return found

    def _castors(self, s: Array) -> Array:
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        t, a = ((s - self.s[i]) / (self.s[i + 1] - self.s[i]))[:, None], self.castor_powers[:, i]
        return np.asarray(a[0] + t * (a[1] + t * (a[2] + t * (a[3] + t * (a[4] + t * a[5])))))

    @cached_property
    def castor_powers(self) -> Array:
        """(6, M-1, C): coefficients of 1, t, .. t^5 of quintic Hermite interpolation in the cells, t
        from 0 to 1."""
        h = np.diff(self.s)[:, None]
        y0, y1 = self.castor[:-1], self.castor[1:]
        d0, d1 = (self.castor_rate[:, k] * h for k in (0, 1))
        c0, c1 = (self.castor_bend[:, k] * h**2 / 2 for k in (0, 1))
        rest = y1 - y0 - d0 - c0
        slope, bend = d1 - d0 - 2 * c0, c1 - c0
        a3 = 10 * rest - 4 * slope + bend
        a4, a5 = -15 * rest + 7 * slope - 2 * bend, 6 * rest - 3 * slope + bend
        return np.stack([y0, d0, c0, a3, a4, a5])


def turning_along(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float], rests: Array
) -> Turning:
    """Solved along the whole path; ``start`` angles by wheel, rad; ``rests``: spline parameters where
    the robot rests."""
    none = np.zeros((0, 0))
    turns: tuple[Turn, ...] = ()
    u, steered = np.zeros(0), none
    if len(steering.steered):
        u, steered, turns = steered_along(path, steering, motion, start, rests)
    if not len(steering.castors):
        return Turning(steering, np.zeros(0), none, none, none, u, steered, turns)
    s, castor, rate, bend, places = _castors(path, steering, motion, start)
    return Turning(steering, s, castor, rate, bend, u, steered, turns, places)


def _castors(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float]
) -> tuple[Array, Array, Array, Array, Array]:
    """Cells are halved until the angles in their middles, solved and interpolated, agree."""
    at = steering.castors
    trail = steering.trail[at]
    first = np.array([start.get(int(i), 0.0) for i in at])
    count = np.ceil(np.diff(path.knot_parameters) / (_STEP * trail.min())).astype(int)
    u = cells(path, np.maximum(count, 4))
    known: Turning | None = None
    for done in range(_ROUNDS):
        s = path.parameter(u)
        nodes = (u[:-1, None] + np.diff(u)[:, None] * _GAUSS).ravel()
        samples, _ = motion(path.parameter(nodes), nodes)
        pace = path.rate(nodes)[:, None]
        v = steering.velocities(samples.twist, steering.place[at]) * pace[..., None]
        shape = (len(u) - 1, 3)
        maps = Swivel.of(
            (v[..., 0] + 1j * v[..., 1]).reshape(*shape, -1),
            (samples.twist[:, 2] * pace[:, 0]).reshape(shape),
            np.diff(u),
            trail,
        )
        angle = maps.follow(first + steering.angle[at]) - steering.angle[at]
        rate, bend = _castor_rates(u, s, steering, motion, angle)
        found = Turning(steering, s, angle, rate, bend, u, np.zeros((0, 0)))
        if known is None:
            coarse = np.ones(len(u) - 1, dtype=bool)
        else:
            off = np.abs(known._castors(s) - angle).max(axis=1)
            coarse = (off[1:] > _SWIVEL) | (off[:-1] > _SWIVEL)
        if not coarse.any() or done == _ROUNDS - 1:
            break
        known = found
        u = np.sort(np.concatenate([u, ((u[:-1] + u[1:]) / 2)[coarse]]))
    return s, angle, rate, bend, u


def _castor_rates(
    u: Array, s: Array, steering: Steering, motion: Motion, angle: Array
) -> tuple[Array, Array]:
    """(M, 2, C): derivatives of the castors' angles at both ends of every cell, from inside it."""
    places = np.stack([u[:-1], np.nextafter(u[1:], -np.inf)], axis=1).ravel()
    ends = np.stack([s[:-1], s[1:]], axis=1).ravel()
    samples, _ = motion(ends, places)
    angles = np.zeros((len(places), len(steering.names)))
    angles[:, steering.castors] = np.stack([angle[:-1], angle[1:]], axis=1).reshape(len(places), -1)
    rate, bend = steering.castor_rates(samples.twist, samples.twist_rate, angles)
    shape = (len(u) - 1, 2, len(steering.castors))
    return rate.reshape(shape), bend.reshape(shape)
