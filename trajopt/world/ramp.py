"""Ramps on level ground, with edges rounded over a given length."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_finite, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_at
from trajopt.paths.spline import SplineBasis

_EDGE_KNOTS = (
    8  # knots across a rounded edge when a path is laid over a ramp; chosen: z within 0.1 mm
)


@dataclass(frozen=True)
class Ramp:
    """A ramp rising by ``height`` (m, < 0 falls) over ``run`` (m, horizontal) from its foot line.

    The foot passes through ``place`` (x, y), m, and the ramp rises along ``direction`` (rad,
    world); beyond it the ground stays at ``height``. Both edges are rounded over ``rounding`` (m),
    as a robot with that distance between its axles feels them: the height is the mean of the sharp
    ramp over that length.
    """

    place: tuple[float, float]
    direction: float
    run: float
    height: float
    rounding: float

    def __post_init__(self) -> None:
        for name in ("run", "rounding"):
            require_positive(f"ramp.{name}", getattr(self, name), "m")
        require_finite("ramp", [*self.place, self.direction, self.height])

    def along(self, x: Array, y: Array) -> Array:
        """Distance from the foot line along the ramp, m."""
        return np.asarray(
            (x - self.place[0]) * np.cos(self.direction)
            + (y - self.place[1]) * np.sin(self.direction)
        )

    def height_at(self, x: Array, y: Array) -> Array:
        """Ground height, m, at world positions."""
        d, half = self.along(x, y), self.rounding / 2
        rise = _integral(d + half, self.run) - _integral(d - half, self.run)
        return np.asarray(self.height * rise / self.rounding)


def _integral(d: Array, run: float) -> Array:
    """Integral of the unit ramp clip(d / run, 0, 1) up to d."""
    inside = np.clip(d, 0.0, run)
    return inside**2 / (2 * run) + np.maximum(d - run, 0.0)


@dataclass(frozen=True)
class Ramps:
    """Level ground with ramps; a path on it may nowhere be steeper than ``grade`` (rad)."""

    ramps: tuple[Ramp, ...]
    grade: float

    def __post_init__(self) -> None:
        if not 0 < self.grade < np.pi / 2:
            raise ArgumentError("terrain.grade", self.grade, "an angle between 0 and pi/2 rad")

    def height(self, x: Array, y: Array) -> Array:
        total = np.zeros(np.broadcast(x, y).shape)
        for ramp in self.ramps:
            total = total + ramp.height_at(x, y)
        return total

    def check(self, path: Path) -> None:
        """Raises InfeasibleError where the path is steeper than the robot's grade."""
        u = np.linspace(path.start, path.end, 16 * (len(path.basis.knots) - 1) + 1)
        slope = np.abs(sample_at(path, np.zeros_like(u), u).slope)
        if slope.max() > self.grade * (1 + 1e-9):
            i = int(np.argmax(slope > self.grade))
            raise InfeasibleError(
                "grade",
                float(path.parameter(u[[i]])[0]),
                f"the ground is {np.degrees(slope.max()):.3g} deg steep, the robot climbs "
                f"{np.degrees(self.grade):.3g} deg",
            )


def lay_over(path: Path, ramps: Sequence[Ramp]) -> Path:
    """The level ``path`` with z from the ramps' height: same curve in the plane, more knots at the
    edges.

    A cubic spline keeps its curve when knots are added, so x and y do not change. Raises
    ArgumentError for a path with a heading of its own or one that has a height already.
    """
    if path.heading is not None or path.coordinates.shape[1] != 2:
        raise ArgumentError(
            "path", path.coordinates.shape, "a level path that drives along its heading"
        )
    u = np.unique(
        np.concatenate([np.asarray(path.basis.knots), *(_edge_knots(path, r) for r in ramps)])
    )
    keep = np.concatenate([[True], np.diff(u) > 1e-9 * (path.end - path.start)])
    u = u[keep]
    u[-1] = path.end
    p = path.position(u)
    z = sum((r.height_at(p[:, 0], p[:, 1]) for r in ramps), np.zeros(len(u)))
    basis = SplineBasis(tuple(u.tolist()), clamped_start=True, clamped_end=True)
    ends = path.position(np.array([path.start, path.end]), 1)
    step = 1e-6 * (path.end - path.start)
    near = path.position(np.array([path.start, path.start + step, path.end - step, path.end]))
    height = sum((r.height_at(near[:, 0], near[:, 1]) for r in ramps), np.zeros(4))
    ends[:, 2] = (height[1] - height[0]) / step, (height[3] - height[2]) / step
    return Path(basis, np.vstack([np.column_stack([p[:, :2], z]), ends]))


def _edge_knots(path: Path, ramp: Ramp) -> Array:
    """Spline parameters of knots across the ramp's rounded edges, where the path crosses them."""
    u = np.linspace(path.start, path.end, 4000)
    p = path.position(u)
    d = ramp.along(p[:, 0], p[:, 1])
    half = ramp.rounding / 2
    levels = np.concatenate(
        [edge + np.linspace(-half, half, _EDGE_KNOTS + 1) for edge in (0.0, ramp.run)]
        + [np.linspace(half, ramp.run - half, 5)]
    )
    found = []
    for level in levels:
        side = d > level
        for i in np.flatnonzero(side[1:] != side[:-1]):
            share = (level - d[i]) / (d[i + 1] - d[i])
            found.append(u[i] + share * (u[i + 1] - u[i]))
    return np.asarray(found, dtype=np.float64)
