"""Friction that is not the same everywhere: one number a wheel, along the path, or over a map."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_finite, require_positive, require_rising
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.forces import contact_points
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class FrictionAlong:
    """Coefficient linear in s between ``places`` (m) with ``values``, constant beyond.

    Raises ArgumentError unless places increase and values are > 0.
    """

    places: tuple[float, ...]
    values: tuple[float, ...]

    def __post_init__(self) -> None:
        places = require_rising("friction.places", self.places, "path parameters, m")
        require_positive("friction.values", self.values, "a place", places.shape)


@dataclass(frozen=True, eq=False)
class FrictionMap:
    """Coefficients ``values`` (rows, columns) on a grid as a height map's, linear in each
    direction between its points.

    Raises ArgumentError for fewer than 2 x 2 values or values that are not > 0.
    """

    values: Array
    spacing: float
    origin: tuple[float, float]

    def __post_init__(self) -> None:
        values = require_positive("friction.values", self.values, "on a grid", (None, None))
        if min(values.shape) < 2:
            raise ArgumentError("friction.values", values.shape, "at least 2 x 2 values")
        require_finite("friction.origin", self.origin, "m", (2,))
        require_positive("friction.spacing", self.spacing, "m between grid points")

    def at(self, x: Array, y: Array, s: Array) -> Array:
        """Coefficients at positions (N, K). Raises InfeasibleError, with a place of s (N,), where a
        wheel leaves the map."""
        v, u = (y - self.origin[1]) / self.spacing, (x - self.origin[0]) / self.spacing
        rows, columns = np.shape(self.values)
        outside = (v < 0) | (v > rows - 1) | (u < 0) | (u > columns - 1)
        if outside.any():
            place = float(s[int(np.argmax(outside.any(axis=1)))])
            raise InfeasibleError("friction", place, "a wheel leaves the friction map here")
        i, j = (np.minimum(m.astype(np.intp), n - 2) for m, n in ((v, rows), (u, columns)))
        a, b, z = u - j, v - i, np.asarray(self.values, dtype=np.float64)
        lower = (1 - a) * z[i, j] + a * z[i, j + 1]
        return np.asarray((1 - b) * lower + b * ((1 - a) * z[i + 1, j] + a * z[i + 1, j + 1]))


Friction = float | tuple[float, ...] | FrictionAlong | FrictionMap


def require_friction(argument: str, friction: Friction) -> None:
    """Raises ArgumentError unless it is a coefficient > 0, several, or one of the classes here."""
    if not isinstance(friction, (FrictionAlong, FrictionMap)):
        shape = (None,) if hasattr(friction, "__len__") else ()
        require_positive(argument, friction, "(friction coefficient)", shape)


def coefficients(argument: str, friction: Friction, path: PathSamples, robot: Robot) -> Array:
    """(N or 1, K): coefficient under every wheel. Raises ArgumentError for another number of values
    than wheels."""
    count = len(robot.body.contacts)
    if isinstance(friction, FrictionAlong):
        along = np.interp(path.s, friction.places, friction.values)
        return np.repeat(along[:, None], count, axis=1)
    if isinstance(friction, FrictionMap):
        return friction.at(*_places(path, robot), path.s)
    values = np.atleast_1d(np.asarray(friction, dtype=np.float64))
    if len(values) not in (1, count):
        raise ArgumentError(argument, friction, f"one value, or {count}: one a wheel of the file")
    return np.broadcast_to(values, (1, count))


def edges(friction: Friction, path: PathSamples, robot: Robot) -> tuple[float, ...]:
    """Path parameters where the coefficient bends, m: on a map, where wheels cross its lines."""
    if isinstance(friction, FrictionAlong):
        return friction.places
    if not isinstance(friction, FrictionMap):
        return ()
    found = []
    for place, origin in zip(_places(path, robot), friction.origin, strict=True):
        cell = (place - origin) / friction.spacing
        before, after = cell[:-1], cell[1:]
        line = np.floor(np.maximum(before, after))
        crossed = np.floor(np.minimum(before, after)) < line
        share = (line - before)[crossed] / (after - before)[crossed]
        i = np.nonzero(crossed)[0]
        found.append(path.s[i] + share * (path.s[i + 1] - path.s[i]))
    return tuple(np.concatenate(found).tolist())


def _places(path: PathSamples, robot: Robot) -> tuple[Array, Array]:
    """x and y (N, K) of the wheels' contacts in the world, m."""
    points = contact_points(path, robot) @ path.rotation[:, :2, :2].swapaxes(1, 2)
    return path.position[:, :1] + points[..., 0], path.position[:, 1:2] + points[..., 1]
