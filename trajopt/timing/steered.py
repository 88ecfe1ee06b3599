"""Angles of steered wheels along a path: continuous between places of rest, where wheels may turn."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.errors import InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples
from trajopt.robots.start import given_angles
from trajopt.robots.steering import Steering

Motion = Callable[[Array, Array], tuple[PathSamples, Array | None]]

_SWING = 0.3  # rad that a steered wheel turns between two places of its table, at most; chosen
_CELLS = 16  # of a spline segment, before they are halved; chosen
_ROUNDS = 28  # of halving cells; chosen
_SHORTEST = 1e-9  # share of the path below which a cell is a place
_FITS = 1e-6  # rad between angles that count as the same; chosen


class Turn(NamedTuple):
    """By how much wheels (K,) and the groups that steer them (G,) turn, rad, while the robot rests
    at a spline parameter."""

    u: float
    wheels: Array
    groups: Array


@dataclass(frozen=True, eq=False)
class _Table:
    """Directions that steered wheels (S), then groups (G), need at places: arrays (P, S + G),
    modulo half turns, and where any does. ``part`` (P,) counts the places of rest before."""

    samples: PathSamples
    raw: Array
    still: BoolArray
    part: IndexArray


def steered_along(
    path: Path, steering: Steering, motion: Motion, start: Mapping[int, float], rests: Array
) -> tuple[Array, Array, tuple[Turn, ...]]:
    """Angles of steered wheels (P, S) at spline parameters (P,), close enough to tell half turns,
    and how wheels turn at ``rests``, spline parameters.

    Between rests angles are continuous. At a rest wheels turn to the nearest angles with which the
    path goes on inside their range; so they do at the start, where ``start`` says that they stand
    otherwise. Raises InfeasibleError with place where a wheel must turn and the robot does not rest,
    and where steering would leave its range.
    """
    inner = np.unique(rests[(rests > path.start) & (rests < path.end)])
    table = _close_places(path, steering, motion, inner)
    count = len(steering.steered)
    angles = np.empty_like(table.raw)
    first = given_angles(steering, start)
    last: Array | None = None
    turns: list[Turn] = []
    for part in range(len(inner) + 1):
        here = table.part == part
        before = first if last is None else last
        angles[here] = _continuous(table.raw[here], table.still[here], before)
        angles[here] += _branch(path, steering, motion, table.samples.u[here], angles[here], before)
        change = np.where(np.isnan(before), 0.0, angles[here][0] - before)
        change = np.where(np.abs(change) > _FITS, change, 0.0)
        if change.any():
            place = float(table.samples.u[here][0])
            if part == 0 and not (rests <= path.start).any():
                _refuse_start(steering, before, change)
            wheels = np.zeros(len(steering.names))
            wheels[steering.steered] = change[:count]
            turns.append(Turn(place, wheels, change[count:]))
        last = angles[here][-1]
    return table.samples.u, angles[:, :count], tuple(turns)


def _close_places(path: Path, steering: Steering, motion: Motion, inner: Array) -> _Table:
    """Places between which no wheel turns by more than ``_SWING``. Raises InfeasibleError where it
    does so at once."""
    jumps = np.append(inner, path.basis.knots[1:-1])  # of directions, or of derivatives
    u = np.concatenate([cells(path, _CELLS), inner, np.nextafter(jumps, -np.inf)])
    span, u = np.ptp(path.basis.knots), np.unique(u)
    for _ in range(_ROUNDS):
        samples, bend = motion(path.parameter(u), u)
        assert bend is not None
        twists = samples.twist, samples.twist_rate, bend
        wheels, still = steering.headings(*twists)
        groups, rests = steering.headings(*twists, groups=True)
        part = np.searchsorted(inner, u, side="right")
        table = _Table(samples, np.hstack([wheels, groups]), np.hstack([still, rests]), part)
        swing = _swings(table)
        wide = (swing > _SWING).any(axis=1) & (np.diff(u) > _SHORTEST * span)
        if not wide.any():
            break
        u = np.sort(np.concatenate([u, ((u[:-1] + u[1:]) / 2)[wide]]))
    jump = (swing > _SWING).any(axis=1)
    if jump.any():
        k = int(np.argmax(jump))
        worst = int(np.argmax(swing[k, : len(steering.steered)]))
        name, place = steering.names[int(steering.steered[worst])], float(samples.s[k + 1])
        raise InfeasibleError(
            "steering",
            place,
            f"wheel '{name}' stands still here and must turn by "
            f"{np.degrees(swing[k].max()):.3g} deg before the path goes on: come to rest here for it "
            f"(stops = [{place!r}]), or lead the path around",
        )
    return table


def _held(raw: Array, still: BoolArray) -> Array:
    """Angles (P, S) where a wheel that stands still keeps its last one, or takes its first."""
    found = raw.copy()
    for k in range(raw.shape[1]):
        moving = np.flatnonzero(~still[:, k])
        if len(moving):
            at = np.clip(np.searchsorted(moving, np.arange(len(raw)), side="right") - 1, 0, None)
            found[:, k] = raw[moving[at], k]
    return found


def _swings(table: _Table) -> Array:
    """(P-1, S + G): how far each wheel turns from place to place, modulo half turns, rad; 0 across a
    rest, and where it stands still all the way from rest to rest."""
    swing = np.zeros((len(table.raw) - 1, table.raw.shape[1]))
    for part in range(int(table.part[-1]) + 1):
        here = np.flatnonzero(table.part == part)
        change = np.diff(_held(table.raw[here], table.still[here]), axis=0)
        change = np.abs(change - np.pi * np.round(change / np.pi))
        swing[here[:-1]] = np.where(table.still[here].all(axis=0), 0.0, change)
    return swing


def _continuous(raw: Array, still: BoolArray, before: Array) -> Array:
    """Continuous angles from rest to rest; ``before`` (or 0) of what stands still all the way."""
    found = np.unwrap(_held(raw, still), axis=0, period=np.pi)
    return np.where(still.all(axis=0), np.nan_to_num(before), found)


def _branch(
    path: Path, steering: Steering, motion: Motion, u: Array, angles: Array, before: Array
) -> Array:
    """(S + G,): multiples of pi that take angles from rest to rest (P, S + G) as near to ``before``
    (NaN: to 0) as the range allows. Raises InfeasibleError, with place and the radius that would do,
    where a group must turn beyond its range."""
    count = len(steering.steered)
    place = {int(i): k for k, i in enumerate(steering.steered)}
    shift = np.zeros(angles.shape[1])
    wanted = np.nan_to_num(before)
    reach = _reach(path, steering, motion, u, angles[:, count:])
    for g, members in enumerate(steering.groups):
        low, high = steering.ranges[g]
        first = angles[0, count + g]
        turns = np.pi * (np.arange(-3, 4) + np.round((wanted[count + g] - first) / np.pi))
        beyond = np.maximum(reach.high[g] + turns - high, low - reach.low[g] - turns)
        away = np.abs(first + turns - wanted[count + g])
        best = int(np.argmin(np.where(beyond <= _FITS, away, 100.0 + 1000.0 * beyond)))
        if beyond[best] > _FITS:
            _refuse_range(steering, g, float(turns[best]), reach)
        shift[count + g] = turns[best]
        for k in (place[int(i)] for i in members):
            shift[k] = np.pi * np.round((first + turns[best] - angles[0, k]) / np.pi)
    return shift


class _Reach(NamedTuple):
    """Least and greatest angle of every group (G,), and where: samples (P,), angles (P, G)."""

    low: Array
    high: Array
    samples: PathSamples
    angles: Array


def _reach(path: Path, steering: Steering, motion: Motion, u: Array, angles: Array) -> _Reach:
    """Extremes of the groups' angles at places (P,) and between them, where a rate passes through
    zero: vertices of the cubics that angles and rates at both ends of a cell make. Without a range
    nobody asks for them."""
    if np.isinf(steering.ranges).all():
        none = np.zeros(angles.shape[1])
        return _Reach(none, none, motion(path.parameter(u[:1]), u[:1])[0], angles[:1])
    ends = np.stack([u[:-1], np.nextafter(u[1:], -np.inf)], axis=1).ravel()
    samples, bend = motion(path.parameter(ends), ends)
    assert bend is not None
    rate, _ = steering.turning_rates(steering.group_place, samples.twist, samples.twist_rate, bend)
    rate = (rate * path.rate(ends)[:, None]).reshape(-1, 2, angles.shape[1])
    turns = (rate[:, 0] * rate[:, 1] < 0).any(axis=1)
    h, rise = np.diff(u)[turns, None], np.diff(angles, axis=0)[turns]
    d0, d1 = rate[turns, 0] * h, rate[turns, 1] * h
    # derivative of the cubic: d0 + 2 b t + 3 c t^2
    b, c = 3 * rise - 2 * d0 - d1, d0 + d1 - 2 * rise
    root = np.sqrt(np.maximum(b**2 - 3 * c * d0, 0.0))
    steep = -b - np.copysign(root, b)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.concatenate([steep / (3 * c), d0 / steep])
    t = np.clip(np.nan_to_num(t, nan=0.0, posinf=0.0, neginf=0.0), 0.0, 1.0)
    more = (np.tile(u[:-1][turns], 2)[:, None] + t * np.tile(h, (2, 1))).ravel()
    places = np.unique(np.concatenate([u, more]))
    samples, _ = motion(path.parameter(places), places)
    raw, still = steering.headings(samples.twist, groups=True)
    near = np.stack([np.interp(places, u, column) for column in angles.T], axis=1)
    found = np.where(still, near, raw + np.pi * np.round((near - raw) / np.pi))
    return _Reach(found.min(axis=0), found.max(axis=0), samples, found)


def _refuse_range(steering: Steering, g: int, shift: float, reach: _Reach) -> None:
    """Raises InfeasibleError: the place where the range is left, the worst angle beyond, and for
    robots that drive along their heading the radius that would do."""
    low, high = steering.ranges[g]
    angles = reach.angles[:, g] + shift
    beyond = np.maximum(angles - high, low - angles)
    k, twist = int(np.argmax(beyond)), reach.samples.twist
    bound = high if angles[k] > high else low
    name = steering.robot.description.steering[g].name
    reason = (
        f"steering '{name}' must turn to {angles[k]:.4g} rad, its range ends at {bound:.4g} rad"
    )
    if steering.robot.drivable.shape[1] == 2 and twist[k, 2]:
        x, y = steering.group_place[g]
        tangent = np.tan(bound + steering.group_angle[g])
        radius = abs((x + y * tangent) / tangent) if tangent else np.inf
        there = abs(twist[k, 0] / twist[k, 2])
        reason += f"; the path's radius is {there:.4g} m, {radius:.4g} m would do"
    raise InfeasibleError(
        "steering", float(reach.samples.s[int(np.argmax(beyond > _FITS))]), reason
    )


def _refuse_start(steering: Steering, before: Array, change: Array) -> None:
    """Raises InfeasibleError: wheels do not stand as the path begins, and the robot moves."""
    k = int(np.argmax(np.abs(change[: len(steering.steered)])))
    name = steering.names[int(steering.steered[k])]
    raise InfeasibleError(
        "steering",
        0.0,
        f"wheel '{name}' starts at {before[k]:.6g} rad, the path begins with it at "
        f"{before[k] + change[k]:.6g} rad: start there, or from rest",
    )


def cells(path: Path, count: int | Array) -> Array:
    """Knots with every interval cut into ``count`` equal cells (one number, or one each)."""
    knots = np.asarray(path.basis.knots)
    parts = [
        np.linspace(a, b, n, endpoint=False)
        for a, b, n in zip(
            knots[:-1], knots[1:], np.broadcast_to(count, len(knots) - 1).tolist(), strict=True
        )
    ]
    return np.append(np.concatenate(parts), knots[-1])
