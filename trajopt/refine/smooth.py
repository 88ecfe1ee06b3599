"""Motions whose jerk is bounded: acceleration is linear in time between gridpoints."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, IndexArray
from trajopt.timing.stages import Stages, assemble
from trajopt.timing.trajectory import Trajectory

FINE = 10  # checked points a node interval


@dataclass(frozen=True, eq=False, repr=False)
class SmoothMotion(Trajectory):
    """A trajectory with bounded jerk: s'' is linear in time between gridpoints.

    ``sdd`` is s'' in the mean over the path between them. ``slowdown`` >= 1 is the factor on time
    that removed what was broken between nodes. ``iterations``: IPOPT's.
    """

    moments: Array = field(default_factory=lambda: np.zeros(0))  # (N+1,) times of gridpoints, s
    a: Array = field(default_factory=lambda: np.zeros(0))  # (N+1,) s'' there, m/s^2
    jerk: Array = field(default_factory=lambda: np.zeros(0))  # (N,) in between, m/s^3
    iterations: int = 0

    @cached_property
    def times(self) -> Array:
        """(N+1,): times at the gridpoints, s."""
        return self.moments

    @property
    def v(self) -> Array:
        """(N+1,): s' at the gridpoints, m/s."""
        return self.sd

    def moving(
        self, i: IndexArray, after: Array, waits: BoolArray
    ) -> tuple[Array, Array, Array, Array]:
        """(M,) each: spline parameter, s, s' and s'' so long after intervals were entered; it rests
        nowhere."""
        j, h = self.jerk[i], np.where(waits, 0.0, after)
        a = self.a[i] + j * h
        v = np.maximum(self.sd[i] + h * (self.a[i] + j * h / 2), 0.0)
        s = self.s[i] + h * (self.sd[i] + h * (self.a[i] / 2 + j * h / 6))
        s = np.clip(s, 0.0, self.path.length)
        return self.path.locate(s), s, v, a

    def jerks(self, t: ArrayLike) -> Array:
        """(M,): jerk at times t (M,), s, m/s^3. Raises ArgumentError outside [0, duration]."""
        return np.asarray(self.jerk[self.placed(t)[0]])

    @cached_property
    def _slack(self) -> Array:
        """At ten points an interval."""
        rows, v, a = self.checked()
        left = rows.c - rows.a * a[:, None] - rows.b * (v**2)[:, None]
        with np.errstate(divide="ignore", invalid="ignore"):
            found = np.nan_to_num(1 - np.sqrt(v**2 / rows.bounds), nan=1.0).T
        for k in range(found.shape[1]):
            mine = left[:, rows.row_owner == k]
            found[:, k] = np.minimum(found[:, k], mine.min(axis=1, initial=np.inf))
        last = np.append(np.arange(FINE, len(found) - 1, FINE), len(found) - 1)
        return np.asarray(np.minimum(np.minimum.reduceat(found[:-1], last - FINE), found[last]))

    def checked(self) -> tuple[Stages, Array, Array]:
        """Rows, speeds and accelerations at ``FINE`` times in every node interval, and the
        last."""
        inside = self.times[:-1, None] + np.diff(self.times)[:, None] * (np.arange(FINE) / FINE)
        s, v, a = self.along(np.append(inside.ravel(), self.times[-1]))
        return rows_at(self, s, v**2), v, a


def smooth_motion(
    source: Trajectory,
    times: Array,
    s: Array,
    v: Array,
    a: Array,
    jerk: Array,
    slowdown: float,
    iterations: int,
) -> SmoothMotion:
    path = source.path
    s = np.maximum.accumulate(np.clip(s, 0.0, path.length))
    mean = np.diff(v**2) / (2 * np.maximum(np.diff(s), 1e-300))
    known = (path, source.limits, source.robot, source.ground, path.locate(s), s, v, mean)
    return SmoothMotion(
        *known,
        "jerk",
        slowdown,
        source.start_wheels,
        source.start_steering,
        moments=times,
        a=a,
        jerk=jerk,
        iterations=iterations,
    )


def rows_at(trajectory: Trajectory, s: Array, sd2: Array) -> Stages:
    samples = trajectory.track.samples(s, trajectory.path.locate(s))
    return assemble(replace(samples, sd2=sd2), trajectory.limits, trajectory.robot)
