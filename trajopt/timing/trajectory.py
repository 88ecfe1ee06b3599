"""A timed motion along a path."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, IndexArray, as_numbers
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.shown import Shown
from trajopt.timing.energy import energies
from trajopt.timing.profile import Profile, margins, margins_of
from trajopt.timing.rests import Rest, rests_of
from trajopt.timing.states import Course, State, states_at
from trajopt.timing.steps import pulls, steps
from trajopt.timing.track import Track
from trajopt.world.ground import Ground

if TYPE_CHECKING:
    import pandas as pd

_BINDS = 2e-3  # relative margin below which a limit counts as binding; above the largest slow-down (0.1 %)
_AS_TIGHT = (
    1e-4  # relative margin within which limits bind alike; chosen: above what tightening leaves
)
_ON_TIME = 1e-12  # share of the duration by which a time may lie outside through rounding


class Stretch(NamedTuple):
    """Between path parameters ``start`` and ``end`` (m) the limit named ``limit`` binds."""

    start: float
    end: float
    limit: str


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Shown):
    """A path with a speed profile: s'' is constant between gridpoints, so s'^2 is linear in s
    there.

    ``slowdown`` >= 1 is the factor by which the whole motion was slowed uniformly, after the
    solver, so that the limits hold between gridpoints as well. ``engine`` says what computed it.
    """

    path: Path
    limits: tuple[Limit, ...]
    robot: Robot | None
    ground: Ground
    u: Array  # (N+1,) spline parameter at the gridpoints
    s: Array  # (N+1,) path parameter at the gridpoints, m
    sd: Array  # (N+1,) path speed, m/s
    sdd: Array  # (N,) path acceleration after each gridpoint, m/s^2
    engine: str
    slowdown: float
    start_wheels: Array = field(default_factory=lambda: np.zeros(0))  # (W,) rad; () means zeros
    start_steering: Mapping[str, float] = field(default_factory=dict)  # rad, see ``time_scale``
    profile: Profile | None = None  # in the cells, where s'' is not constant there
    bound: float | None = None  # s, which no motion that keeps the limits beats; None: unknown
    reason: str = ""  # why the gap is larger than was asked for

    def __post_init__(self) -> None:
        count = 0 if self.robot is None else len(self.robot.wheels)
        wheels = self.start_wheels if np.size(self.start_wheels) else np.zeros(count)
        if np.shape(wheels) != (count,) or not np.all(np.isfinite(wheels)):
            expected = f"{count} finite angles, one a wheel that rolls, rad"
            raise ArgumentError("start_wheels", np.asarray(wheels).tolist(), expected)
        object.__setattr__(self, "start_wheels", wheels)

    def __repr__(self) -> str:
        robot = "no robot" if self.robot is None else self.robot.name
        return f"Trajectory({robot}, {self.duration:.4g} s over {self.path.length:.4g} m)"

    def to_frame(self) -> pd.DataFrame:
        """The motion in steps of at most 10 ms (in all at most some 20,000, then by cells of the
        profile), the columns of ``trajectory.csv``; units in the names."""
        import pandas

        from trajopt.report.motion import trajectory_table

        return pandas.DataFrame(trajectory_table(self))

    @cached_property
    def times(self) -> Array:
        """(N+1,): times at which the robot leaves the gridpoints, s."""
        if self.profile is None:
            seconds = 2 * np.diff(self.s) / (self.sd[:-1] + self.sd[1:])
        else:
            seconds = self.profile.seconds
        return np.asarray(np.concatenate([[0.0], np.cumsum(seconds)]) + np.cumsum(self.waits))

    @cached_property
    def rests(self) -> tuple[Rest, ...]:
        """Where steered wheels turn while the robot rests."""
        if not (self.start_steering or (self.sd[1:-1] == 0).any()):
            return ()
        return rests_of(self.track, self.limits)

    @cached_property
    def waits(self) -> Array:
        """(N+1,): how long the robot rests at the gridpoints, s, while wheels turn."""
        found = np.zeros(len(self.u))
        for node, rest in self.resting.items():
            found[node] = rest.duration
        return found

    @cached_property
    def resting(self) -> dict[int, Rest]:
        """The rests by gridpoint."""
        return {int(np.argmin(np.abs(self.u - rest.u))): rest for rest in self.rests}

    @property
    def duration(self) -> float:
        """Duration, s."""
        return float(self.times[-1])

    @cached_property
    def energies(self) -> Array:
        """(N+1,): work of the motors from the start to each gridpoint, J; see
        ``timing.energy``."""
        return energies(self)

    @property
    def energy(self) -> float:
        """Work of the motors, J: mechanical, where they drive, less what braking gives back by the
        robot's file. Raises ArgumentError for robots whose torques are not known."""
        return float(self.energies[-1])

    @property
    def gap(self) -> float | None:
        """How far the duration can be from the least possible, at most, as a share of it; None
        where no bound was asked for."""
        return None if self.bound is None else max(0.0, 1.0 - self.bound / self.duration)

    @property
    def why_gap(self) -> str:
        """Why the gap is not known, or larger than was asked for; "" where neither is so."""
        if self.bound is None:
            return "no bound was asked for" if self.profile else f"engine {self.engine} makes none"
        return self.reason

    def along(self, t: ArrayLike) -> tuple[Array, Array, Array]:
        """Path parameter s (m), s' and s'' at times t (N,), s. Raises ArgumentError outside [0,
        duration]."""
        i, after, node, _ = self.placed(t)
        _, s, speed, sdd = self.moving(i, after, node >= 0)
        return s, speed, sdd

    def moving(
        self, i: IndexArray, after: Array, waits: BoolArray
    ) -> tuple[Array, Array, Array, Array]:
        """(N,) each: spline parameter, s, s' and s'' so long after intervals were entered."""
        if self.profile is not None:
            u, speed, pull = self.profile.along(i, after)
            g, slope = self.profile.measure.stretch(u)
            speed = speed / g
            s, sdd = self.path.parameter(u), (pull - slope * speed**2) / g
        else:
            s = self.s[i] + after * (self.sd[i] + after * self.sdd[i] / 2)
            s = np.clip(s, self.s[i], self.s[i + 1])
            u, sdd = self.path.locate(s), self.sdd[i]
            speed = np.maximum(self.sd[i] + sdd * after, 0.0)
        return u, s, np.where(waits, 0.0, speed), np.where(waits, 0.0, sdd)

    def inside(self, share: float) -> tuple[Array, Array, Array, Array]:
        """(N,) each: spline parameter, s (m), s' and s'' in every interval, a ``share`` of the time
        that it takes after it was entered."""
        moving = np.diff(self.times) - self.waits[1:]
        return self.moving(np.arange(len(moving)), share * moving, np.zeros(len(moving), bool))

    def placed(self, t: ArrayLike) -> tuple[IndexArray, Array, IndexArray, Array]:
        """At times t (N,): which interval between gridpoints and the time since it was entered; the
        gridpoint at which the robot waits, -1 while it moves, and the time since it came to rest
        there."""
        time = self.within(t)
        i = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.sdd) - 1)
        moving = self.times[i + 1] - self.waits[i + 1] - self.times[i]
        after = np.clip(time - self.times[i], 0.0, moving)
        node = np.where(time < self.times[0], 0, i + 1)
        since = time - (self.times[node] - self.waits[node])
        waits = (self.waits[node] > 0) & (since >= 0)
        return i, after, np.where(waits, node, -1), since

    def within(self, t: ArrayLike) -> Array:
        """(N,): times t, s. Raises ArgumentError outside [0, duration]."""
        time = np.atleast_1d(as_numbers("t", t, f"times in [0, {self.duration!r}] s"))
        slack = _ON_TIME * self.duration
        if time.ndim != 1 or not np.all((time >= -slack) & (time <= self.duration + slack)):
            raise ArgumentError("t", np.asarray(t).tolist(), f"times in [0, {self.duration!r}] s")
        return time

    def at(self, t: ArrayLike) -> State:
        """State at times t (N,) or one time (N = 1), s. Raises ArgumentError outside [0,
        duration]."""
        return states_at(self, t)

    def margins(self) -> Mapping[str, float]:
        """Least relative margin of every limit, recomputed at the ends and quarters of the cells,
        which are small where the motion varies, and where a parabola through these is highest."""
        least = self._slack.min(axis=0)
        return MappingProxyType(
            {limit.name: float(m) for limit, m in zip(self.limits, least, strict=True)}
        )

    @cached_property
    def binding(self) -> tuple[str, ...]:
        """(N,): name of the limit that binds in each interval between gridpoints, "" where none
        does."""
        slack = self._slack
        tight = (slack < _BINDS) & (slack < slack.min(axis=1, keepdims=True) + _AS_TIGHT)
        # Of several, the one that binds at the fewest places: that it does is said nowhere else.
        rare = np.argmin(np.where(tight, tight.sum(axis=0), np.iinfo(np.int64).max), axis=1)
        some = tight.any(axis=1)
        return tuple(self.limits[k].name if t else "" for k, t in zip(rare, some, strict=True))

    @cached_property
    def active(self) -> tuple[Stretch, ...]:
        """Stretches of the path with the limit that binds there; where none binds there is no
        stretch."""
        names = np.array(self.binding)
        starts = np.flatnonzero(np.concatenate([[True], names[1:] != names[:-1]]))
        ends = np.append(starts[1:], len(names))
        return tuple(
            Stretch(float(self.s[i]), float(self.s[j]), str(names[i]))
            for i, j in zip(starts, ends, strict=True)
            if names[i]
        )

    @cached_property
    def _slack(self) -> Array:
        """(N, L): least relative margin of every limit in each interval."""
        if self.profile is not None:
            return margins_of(self.track, self.profile, self.limits)
        cells = steps(self.track, self.u, self.limits, self.sd**2)
        return margins(cells, self.sd**2, *pulls(cells, self.sd**2))

    @cached_property
    def track(self) -> Track:
        """The path on its ground, with the robot's wheel states along it."""
        rests = self.u[self.sd == 0]
        return Track(self.path, self.robot, self.ground, self.start_steering, rests)

    @cached_property
    def course(self) -> Course:
        """What ``at`` needs once."""
        return Course(self)
