"""How castors swivel and steered wheels turn along a path, whatever the timing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.errors import InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots.steering import Steering, Swivel

Motion = Callable[[Array, Array], tuple[PathSamples, Array | None]]

_GAUSS = 0.5 + np.array([-1.0, 0.0, 1.0]) * np.sqrt(15.0) / 10
_SWIVEL = 1e-7  # rad by which castor angles may change when cells are halved a last time; chosen
_STEP = 0.5  # trails that a castor's pivot goes in a first cell, at most; chosen
_ROUNDS = 14  # of halving cells; chosen
_SWING = 0.3  # rad that a steered wheel turns between two places of its table, at most; chosen
_SHORTEST = 1e-9  # share of the path below which a cell is a place
_FITS = 1e-6  # rad between a given start angle and the path's; chosen


@dataclass(frozen=True, eq=False)
class Turning:
    """Castors' angles (M, C), first and second derivatives along s at both ends of every cell (M-1,
    2, C), at places s (M,); steered wheels' angles (P, S) at spline parameters u (P,), which tell
    one half turn from the next."""

    steering: Steering
    s: Array
    castor: Array
    castor_rate: Array
    castor_bend: Array
    u: Array
    steered: Array

    def at(self, s: Array, u: Array, twist: Array) -> Array:
        """(N, K): steering angles of all wheels, rad, at path parameters whose twist (N, 3) is
        known."""
        found = np.zeros((len(s), len(self.steering.names)))
        if len(self.steering.castors):
            found[:, self.steering.castors] = self._castors(s)
        if len(self.steering.steered):
            angle, still = self.steering.headings(twist)
            near = np.stack([np.interp(u, self.u, column) for column in self.steered.T], axis=1)
            turned = angle + np.pi * np.round((near - angle) / np.pi)
            found[:, self.steering.steered] = np.where(still, near, turned)
        return found

    def _castors(self, s: Array) -> Array:
        """Quintic Hermite interpolation."""
        i = np.clip(np.searchsorted(self.s, s, side="right") - 1, 0, len(self.s) - 2)
        h = (self.s[i + 1] - self.s[i])[:, None]
        t = (s - self.s[i])[:, None] / h
        y0, y1 = self.castor[i], self.castor[i + 1]
        d0, d1 = (self.castor_rate[i, k] * h for k in (0, 1))
        c0, c1 = (self.castor_bend[i, k] * h**2 / 2 for k in (0, 1))
        rest = y1 - y0 - d0 - c0
        slope, bend = d1 - d0 - 2 * c0, c1 - c0
        a3, a4, a5 = (
            10 * rest - 4 * slope + bend,
            -15 * rest + 7 * slope - 2 * bend,
            6 * rest - 3 * slope + bend,
        )
        return np.asarray(y0 + t * (d0 + t * (c0 + t * (a3 + t * (a4 + t * a5)))))


def turning_along(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float]
) -> Turning:
    """Solved along the whole path; ``start`` angles by wheel, rad."""
    none = np.zeros((0, 0))
    u, steered = np.zeros(0), none
    if len(steering.steered):
        u, steered = _steered(path, steering, motion, start)
    if not len(steering.castors):
        return Turning(steering, np.zeros(0), none, none, none, u, steered)
    s, castor, rate, bend = _castors(path, steering, motion, start)
    return Turning(steering, s, castor, rate, bend, u, steered)


def _castors(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float]
) -> tuple[Array, Array, Array, Array]:
    """Cells are halved until the angles in their middles, solved and interpolated, agree."""
    at = steering.castors
    trail = steering.trail[at]
    first = np.array([start.get(int(i), 0.0) for i in at])
    knots = np.asarray(path.basis.knots)
    count = np.ceil(np.diff(path.knot_parameters) / (_STEP * trail.min())).astype(int)
    u = _divided(knots, np.maximum(count, 4))
    known: Turning | None = None
    for _ in range(_ROUNDS):
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
        if not coarse.any():
            break
        known = found
        u = np.sort(np.concatenate([u, ((u[:-1] + u[1:]) / 2)[coarse]]))
    return s, angle, rate, bend


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


def _steered(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float]
) -> tuple[Array, Array]:
    """Continuous angles of steered wheels, on places close enough to tell half turns. Raises
    InfeasibleError."""
    knots = np.asarray(path.basis.knots)
    u = _divided(knots, np.full(len(knots) - 1, 16))
    for _ in range(2 * _ROUNDS):
        samples, _ = motion(path.parameter(u), u)
        wheels, still = steering.headings(samples.twist)
        groups, still_groups = steering.headings(samples.twist, groups=True)
        raw, rests = np.hstack([wheels, groups]), np.hstack([still, still_groups])
        swing = _swings(raw, rests)
        wide = (swing > _SWING).any(axis=1) & (np.diff(u) > _SHORTEST * (path.end - path.start))
        if not wide.any():
            break
        u = np.sort(np.concatenate([u, ((u[:-1] + u[1:]) / 2)[wide]]))
    names = [steering.names[i] for i in steering.steered]
    s, count = samples.s, len(names)
    jump = (swing > _SWING).any(axis=1)
    if jump.any():
        k = int(np.argmax(jump))
        worst = int(np.argmax(swing[k, :count])) if count else 0
        raise InfeasibleError(
            "steering",
            float(s[k]),
            f"wheel '{names[worst]}' stands still here and must turn by "
            f"{np.degrees(swing[k].max()):.3g} deg before the path goes on; lead the path around, or "
            "split it here",
        )
    table = np.unwrap(_held(raw, rests), axis=0, period=np.pi)
    shift = _first_branch(steering, table[0], start)
    table = table + shift
    _require_range(steering, table[:, count:], samples)
    return u, table[:, :count]


def _held(angle: Array, still: BoolArray) -> Array:
    """Angles (P, S) where a wheel that stands still keeps its last one, or takes its first."""
    found = angle.copy()
    for k in range(angle.shape[1]):
        moving = np.flatnonzero(~still[:, k])
        if len(moving):
            at = np.clip(np.searchsorted(moving, np.arange(len(angle)), side="right") - 1, 0, None)
            found[:, k] = angle[moving[at], k]
    return found


def _swings(angle: Array, still: BoolArray) -> Array:
    """(P-1, S): how far each wheel turns from place to place, modulo half turns, rad."""
    change = np.diff(_held(angle, still), axis=0)
    return np.abs(change - np.pi * np.round(change / np.pi))


def _first_branch(steering: Steering, first: Array, start: Mapping[int, float]) -> Array:
    """(S + G,): multiples of pi that take the first angles of wheels, then of groups, to where they
    start: nearest to 0 or to the angle given, inside the range."""
    count = len(steering.steered)
    place = {int(i): k for k, i in enumerate(steering.steered)}
    shift = np.zeros(len(first))
    for g, members in enumerate(steering.groups):
        mine = [place[int(i)] for i in members]
        wanted = next((start[int(i)] for i in members if int(i) in start), 0.0)
        low, high = steering.ranges[g]
        turns = np.pi * (np.arange(-3, 4) + np.round((wanted - first[count + g]) / np.pi))
        angles = first[count + g] + turns
        inside = (angles >= low - _FITS) & (angles <= high + _FITS)
        away = np.abs(angles - wanted) + np.where(inside, 0.0, 100.0)
        shift[count + g] = turns[int(np.argmin(away))]
        for k in mine:
            shift[k] = np.pi * np.round((first[count + g] + shift[count + g] - first[k]) / np.pi)
        for i, k in zip(members, mine, strict=True):
            given, found = start.get(int(i)), first[k] + shift[k]
            if given is not None and abs(given - found) > _FITS:
                raise InfeasibleError(
                    "steering",
                    0.0,
                    f"wheel '{steering.names[i]}' starts at {given:.6g} rad, the path begins with it "
                    f"at {found:.6g} rad: turn it first",
                )
    return shift


def _require_range(steering: Steering, angles: Array, samples: PathSamples) -> None:
    """Raises InfeasibleError, with place and the radius that would do, where a group must turn
    beyond its range."""
    low, high = steering.ranges.T
    beyond = np.maximum(angles - high, low - angles)
    if not len(beyond) or beyond.max(initial=0.0) <= _FITS:
        return
    k, g = (int(i) for i in np.unravel_index(int(np.argmax(beyond)), beyond.shape))
    first = int(np.argmax(beyond[:, g] > _FITS))
    name, angle = steering.robot.description.steering[g].name, float(angles[k, g])
    bound = float(high[g] if angle > high[g] else low[g])
    reason = f"steering '{name}' must turn to {angle:.4g} rad, its range ends at {bound:.4g} rad"
    if steering.robot.drivable.shape[1] == 2 and samples.twist[k, 0] > 0:
        x, y = steering.group_place[g]
        tangent = np.tan(bound + steering.group_angle[g])
        radius = abs((x + y * tangent) / tangent) if tangent else np.inf
        there = abs(1 / samples.twist[k, 2])
        reason += f"; the path's radius is {there:.3g} m, {radius:.3g} m would do"
    raise InfeasibleError("steering", float(samples.s[first if first else k]), reason)


def _divided(knots: Array, cells: Array) -> Array:
    """Knots with every interval cut into so many equal cells."""
    parts = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(knots[:-1], knots[1:], cells.tolist(), strict=True)
    ]
    return np.append(np.concatenate(parts), knots[-1])
