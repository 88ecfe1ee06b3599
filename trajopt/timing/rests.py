"""Turns of steered wheels while the robot rests, from standstill to standstill as fast as steering
may."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.limits.steering_acceleration import SteeringAcceleration
from trajopt.limits.steering_rate import SteeringRate
from trajopt.robots.steering import Steering
from trajopt.timing.track import Track

AT = 1e-9  # share of the path's length within which a gridpoint is a stop; chosen


@dataclass(frozen=True, eq=False)
class Rest:
    """The robot rests at a path parameter ``s`` (m) while wheels (K,) turn by ``wheels``, rad, and
    with them the groups that steer them, by ``groups`` (G,), each at most at ``rate`` (rad/s) and
    with ``acceleration`` (rad/s^2; inf: none is needed)."""

    s: float
    u: float  # spline parameter
    wheels: Array
    groups: Array
    rate: Array
    acceleration: Array
    group_of: tuple[int, ...]  # (K,) -1 for wheels that are not steered

    @cached_property
    def _peak(self) -> Array:
        """(G,): greatest rates, rad/s, of trapezoids or triangles of speed."""
        turn = np.abs(self.groups)
        with np.errstate(invalid="ignore"):  # 0 inf: nothing turns
            return np.where(
                turn > 0, np.minimum(self.rate, np.sqrt(turn * self.acceleration)), self.rate
            )

    @cached_property
    def times(self) -> Array:
        """(G,): what each group needs, s."""
        turn = np.abs(self.groups)
        with np.errstate(invalid="ignore"):
            return np.where(turn > 0, turn / self._peak + self._peak / self.acceleration, 0.0)

    @property
    def duration(self) -> float:
        """s"""
        return float(self.times.max(initial=0.0))

    def ahead(self, t: Array) -> tuple[Array, Array]:
        """(N, K): by how much wheels still have to turn, rad, at times (N,) since the robot came to
        rest, and how fast they turn, rad/s."""
        left = np.clip(self.times - t[:, None], 0.0, self.times)  # (N, G)
        side = np.minimum(left, self.times - left)  # from the nearer end
        ramp = self._peak / self.acceleration
        with np.errstate(invalid="ignore", divide="ignore"):
            swept = np.where(
                side < ramp, self.acceleration * side**2 / 2, self._peak * (side - ramp / 2)
            )
            rate = np.where(side < ramp, self.acceleration * side, self._peak)
        turn = np.abs(self.groups)
        rest = np.where(2 * left <= self.times, swept, turn - swept)
        idle = (turn == 0) | (self.times == 0)
        safe = np.where(idle, 1.0, turn)
        share = np.where(idle, 0.0, rest / safe)
        pace = np.where(idle | (left <= 0) | (t[:, None] < 0), 0.0, rate / safe)
        mine, steered = np.array(self.group_of), np.array(self.group_of) >= 0
        return self.wheels * share[:, mine] * steered, self.wheels * pace[:, mine] * steered


def with_rests(track: Track, limits: Sequence[Limit], u: Array, stops: Array) -> Track:
    """The track with the gridpoints u (N,) that lie at ``stops`` (path parameters, m), where the
    robot rests. Raises as ``rests_of``, and where steered wheels cannot stand as the path needs."""
    if not track.steers:
        return track
    near = np.abs(track.path.parameter(u)[:, None] - stops).min(axis=1, initial=np.inf)
    found = replace(track, rests=u[near <= AT * track.path.length])
    rests_of(found, limits)
    return found


def rests_of(track: Track, limits: Sequence[Limit]) -> tuple[Rest, ...]:
    """The turns along a track, within the limits on steering given, or else those of the robot's
    file.

    Raises InfeasibleError, naming the key that is missing, where a wheel must turn and neither rate
    nor acceleration of its steering is known.
    """
    if track.robot is None or not track.steers:
        return ()
    steering, found = track.steering, []
    groups = steering.robot.description.steering
    rate = _largest(steering, limits, SteeringRate, "rate")
    acceleration = _largest(steering, limits, SteeringAcceleration, "acceleration")
    group_of = np.full(len(steering.names), -1)
    for g, members in enumerate(steering.groups):
        group_of[members] = g
    for turn in track.turning.turns:
        s = float(track.path.parameter(turn.u)[0])
        for g in np.flatnonzero(turn.groups).tolist():
            if np.isinf(rate[g]) and np.isinf(acceleration[g]):
                raise InfeasibleError(
                    "steering",
                    s,
                    f"steering '{groups[g].name}' must turn by "
                    f"{np.degrees(turn.groups[g]):.3g} deg at rest here, and how fast it can is not "
                    f"known: give steering.{groups[g].name}.rate in the robot's file, or the limit "
                    "SteeringRate",
                )
        owner = tuple(group_of.tolist())
        found.append(Rest(s, turn.u, turn.wheels, turn.groups, rate, acceleration, owner))
    return tuple(found)


def _largest(
    steering: Steering,
    limits: Sequence[Limit],
    kind: type[SteeringRate] | type[SteeringAcceleration],
    key: str,
) -> Array:
    """(G,): what the limits of a kind allow, or else the robot's file, inf without."""
    groups = steering.robot.description.steering
    own = np.array([getattr(group, key) or np.inf for group in groups])
    given = [x.largest for x in limits if isinstance(x, kind) and x.largest is not None]
    if not given:
        return own
    return np.asarray(np.min([np.broadcast_to(x, own.shape) for x in given], axis=0))
