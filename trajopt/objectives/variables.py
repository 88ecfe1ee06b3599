"""The decision variables of a spline motion with given ends: which control values are free, where
they may lie, and the path through them."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.paths.spline import SplineBasis, uniform_basis
from trajopt.problem import Problem
from trajopt.robots.robot import Robot

HEADING_MARGIN = (
    np.pi / 2
)  # rad beyond start and goal heading for free heading control points, chosen
DURATION_RANGE = (0.25, 4.0)  # times the nominal duration, for a free duration, chosen

_NAMES = {
    "p1": ("p1.x_m", "p1.y_m"),
    "p2": ("p2.x_m", "p2.y_m"),
    "heading": ("p1.yaw_rad", "p2.yaw_rad"),
    "duration": ("duration_s",),
}  # of the decision variables, by what is free


@dataclass(frozen=True)
class ControlPoints:
    """Control values of n candidates in columns: x, y, yaw (4, n) and duration (1, n) in s."""

    x: Any
    y: Any
    yaw: Any
    duration: Any

    @property
    def first(self) -> tuple[Array, Array, Array, float]:
        """x, y, yaw (4,) and duration of the first candidate."""
        return self.x[:, 0], self.y[:, 0], self.yaw[:, 0], float(self.duration[0, 0])


@dataclass(frozen=True)
class TerminalVariables:
    """The free control values of ``problem``.

    Decision variables, in this order where free: x1, y1 (p1), x2, y2 (p2), yaw1, yaw2 (heading),
    duration.
    """

    problem: Problem
    robot: Robot

    @property
    def basis(self) -> SplineBasis:
        return uniform_basis(4)

    @property
    def nominal_duration(self) -> float:
        """s; drives that follow end at the same angles whatever it is."""
        return 1.0 if self.problem.actuator is None else self.problem.actuator.duration

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the decision variables with their units."""
        free = self.problem.search.free
        return tuple(name for key, names in _NAMES.items() if key in free for name in names)

    @property
    def dimension(self) -> int:
        return len(self.names)

    @cached_property
    def bounds(self) -> Array:
        """(d, 2): the navigation space for points; margins around start and goal for heading;
        duration."""
        p = self.problem.search
        yaws = (p.start[2], p.goal[2])
        by_suffix = {
            "x_m": p.space.x,
            "y_m": p.space.y,
            "yaw_rad": (min(yaws) - HEADING_MARGIN, max(yaws) + HEADING_MARGIN),
            "duration_s": tuple(f * self.nominal_duration for f in DURATION_RANGE),
        }
        return np.array([by_suffix[name.split(".")[-1]] for name in self.names], dtype=np.float64)

    @cached_property
    def _usual(self) -> dict[str, float]:
        """Every control value where it is not free: the thesis's P1 (Table 5.4 with x_min = x_0,
        x_max = x_f), P2 on the far third, linear heading."""
        (x0, y0, a0), (xf, yf, af) = self.problem.search.start, self.problem.search.goal
        return {
            "p1.x_m": x0 + (xf - x0) / 2.5,
            "p1.y_m": y0 + (yf - y0) / 3,
            "p2.x_m": x0 + (xf - x0) * 2 / 3,
            "p2.y_m": y0 + (yf - y0) * 2 / 3,
            "p1.yaw_rad": a0 + (af - a0) / 3,
            "p2.yaw_rad": a0 + (af - a0) * 2 / 3,
            "duration_s": self.nominal_duration,
        }

    @cached_property
    def default(self) -> Array:
        """(d,): where the free values stand when nothing is known, kept inside their bounds."""
        return np.clip([self._usual[name] for name in self.names], *self.bounds.T)

    def control_points(self, z: Any) -> ControlPoints:
        """Control values from decision variables ``z`` (d, n): arrays or symbols, candidates in
        columns."""
        column, task = 0 * z[0:1], self.problem.search
        value = {name: column + usual for name, usual in self._usual.items()}
        value |= {name: z[i : i + 1] for i, name in enumerate(self.names)}
        ends = zip(("x_m", "y_m", "yaw_rad"), task.start, task.goal, strict=True)
        x, y, yaw = (
            np.vstack([column + first, value[f"p1.{w}"], value[f"p2.{w}"], column + last])
            for w, first, last in ends
        )
        return ControlPoints(x, y, yaw, value["duration_s"])

    def path(self, candidate: Array) -> Path:
        """The path through the control points of one candidate (d,)."""
        x, y, yaw, _ = self.control_points(np.asarray(candidate, dtype=np.float64)[:, None]).first
        return Path(self.basis, np.column_stack([x, y]), yaw, self.robot.turning_length)
