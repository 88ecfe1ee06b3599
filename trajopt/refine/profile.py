"""Following a given speed profile as closely as the limits allow ([waheed2006], section 2.4).

From below, the profile is one more bound and the fastest motion under it is the closest at every
place: no feasible profile that stays below is faster anywhere. In the least-squares sense the
motion may also run above the profile where that pays for being below elsewhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.limits.speed_bound import SpeedProfile
from trajopt.optimize.symbols import numpy_on_symbols, solve_program, stacked, total, variables
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.timing.profile import excess
from trajopt.timing.scaling import time_scale
from trajopt.timing.steps import pulls, stages_of, steps
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground

_CELLS = 400  # intervals of the least-squares program; chosen
_TIGHTER = 1e-6  # share by which its rows are tightened, for the solver's own tolerance
_FLOOR = 1e-8  # m^2/s^2, least s'^2 inside the path: no rest on the way
_MOST_SLOWDOWN = 1.01  # of time; chosen
_INSIDE = np.arange(8) / 8  # of an interval's time, where errors are looked at; chosen


@dataclass(frozen=True, eq=False)
class Followed:
    """The motion, and how far its speed is from the profile's over the path: root mean square and
    largest, m/s."""

    trajectory: Trajectory
    wanted: Array  # (N+1,) m/s at the trajectory's gridpoints

    @property
    def error(self) -> float:
        s, off = self._off
        square = off**2
        return float(np.sqrt(np.sum((square[1:] + square[:-1]) / 2 * np.diff(s)) / np.ptp(s)))

    @property
    def largest_error(self) -> float:
        return float(np.abs(self._off[1]).max())

    @cached_property
    def _off(self) -> tuple[Array, Array]:
        """Path parameters, also between gridpoints, and how much faster the motion is there: where
        it starts from rest, speed grows as the root of s."""
        times = self.trajectory.times
        t = np.append(times[:-1, None] + np.diff(times)[:, None] * _INSIDE, times[-1])
        s, speed, _ = self.trajectory.along(t)
        return s, speed - np.interp(s, self.trajectory.s, self.wanted)


def follow(
    path: Path,
    profile: SpeedProfile,
    limits: Sequence[Limit],
    *,
    robot: Robot | None = None,
    ground: Ground | None = None,
    start_speed: float = 0.0,
    end_speed: float = 0.0,
    start_wheels: ArrayLike = (),
    start_steering: Mapping[str, float] | None = None,
    manner: Literal["below", "least_squares"] = "below",
) -> Followed:
    """The motion closest to ``profile`` (s' over s) within ``limits``.

    "below": nowhere above the profile; exact (it is a time-optimal problem). "least_squares": least
    integral of (s'^2 - profile^2)^2 over the path, a convex program on the same rows solved by
    IPOPT, then checked and slowed uniformly by what is left. Raises as ``time_scale``.
    """
    if manner not in ("below", "least_squares"):
        raise ArgumentError("manner", manner, "below or least_squares")
    below = time_scale(
        path,
        [*limits, profile],
        robot=robot,
        ground=ground,
        start_speed=start_speed,
        end_speed=end_speed,
        start_wheels=start_wheels,
        start_steering=start_steering,
    )
    if manner == "least_squares" and len(below.path.joints):
        expected = "below, on a path of several pieces: least squares does not stop between them"
        raise ArgumentError("manner", manner, expected)
    if manner == "below":
        return Followed(below, np.interp(below.s, profile.places, profile.speeds))
    return _least_squares(profile, tuple(limits), below)


@numpy_on_symbols(False)
def _least_squares(profile: SpeedProfile, limits: tuple[Limit, ...], warm: Trajectory) -> Followed:
    path = warm.path
    places = np.unique(
        np.concatenate([np.linspace(0.0, path.length, _CELLS + 1), np.asarray(profile.places)])
    )
    places = places[(places >= 0) & (places <= path.length)]
    u = np.unique(np.concatenate([path.locate(places), np.asarray(path.basis.knots)]))
    u = u[np.concatenate([[True], np.diff(u) > 1e-9 * (path.end - path.start)])]
    u[-1] = path.end
    s = path.parameter(u)
    first = np.interp(s, warm.s, warm.sd**2)
    cells = steps(warm.track, u, limits, first)
    stages, step, n = stages_of(cells), cells.d, len(cells.d)
    wanted = np.interp(s, profile.places, profile.speeds)
    bound = np.full(n + 1, np.inf)
    np.minimum.at(bound, np.repeat(np.arange(n + 1), 2)[1:-1], stages.sd2_max)
    x = variables(n + 1)
    rate = (x[1:] - x[:-1]) / (2 * step)
    rows = []
    for end, square in ((0, x[:-1]), (1, x[1:])):
        a, b, c = (m[end::2] for m in (stages.a, stages.b, stages.c))
        rows += [a[:, k] * rate + b[:, k] * square - c[:, k] for k in range(a.shape[1])]
    weights = np.concatenate([[step[0]], step[:-1] + step[1:], [step[-1]]]) / 2
    cost = total(weights * (x - wanted**2) ** 2)
    lower, upper = np.full(n + 1, _FLOOR), (1 - _TIGHTER) * bound
    lower[[0, -1]] = upper[[0, -1]] = first[[0, -1]]
    constraints = stacked(rows)
    count = constraints.shape[0]
    result = solve_program(
        x,
        cost,
        constraints,
        start=np.clip(first, lower, upper),
        lower=lower,
        upper=upper,
        constraint_lower=np.full(count, -np.inf),
        constraint_upper=np.full(count, -_TIGHTER),
    )
    if not result.solved:
        raise InfeasibleError(
            "speed_profile", 0.0, f"IPOPT found no closest motion ({result.status})"
        )
    sd2 = np.maximum(result.x, 0.0)
    factor = float(excess(cells, sd2, *pulls(cells, sd2))[1].max())
    if np.sqrt(factor) > _MOST_SLOWDOWN:
        raise InfeasibleError(
            "speed_profile", 0.0, f"between gridpoints it would have to slow by {factor**0.5:.3g}"
        )
    sd2 = sd2 / factor
    found = Trajectory(
        path,
        limits,
        warm.robot,
        warm.ground,
        u,
        s,
        np.sqrt(sd2),
        pulls(cells, sd2)[0],
        "least_squares",
        float(np.sqrt(factor)),
        warm.start_wheels,
        warm.start_steering,
    )
    return Followed(found, wanted)
