"""Bounds on the path speed along the path: zones, or a given profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, require_finite, require_not_negative, require_rising
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit, Rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

_TOUCH = 1e-9  # m; a zone reaches this far beyond its ends, so that the gridpoint on its edge belongs to it


@dataclass(frozen=True)
class SpeedZones(Limit):
    """Path speed s' <= speed inside zones: ``zones`` holds (from, to, speed) in m, m, m/s; they may
    overlap.

    Raises ArgumentError for an empty zone, a negative speed or a number that is not finite. A speed
    of 0 is a stop that no motion passes: time scaling says so.
    """

    zones: tuple[tuple[float, float, float], ...]
    name: str = "speed_zones"

    def __post_init__(self) -> None:
        name, expected = f"{self.name}.zones", "(from, to > from, speed >= 0), m and m/s, each"
        for i, zone in enumerate(require_finite(name, self.zones, expected, (None, 3))):
            if not (zone[0] < zone[1] and zone[2] >= 0):
                raise ArgumentError(f"{name}[{i}]", zone.tolist(), expected)

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        bound = np.full(len(path.s), np.inf)
        for start, end, speed in self.zones:
            inside = (path.s >= start - _TOUCH) & (path.s <= end + _TOUCH)
            bound[inside] = np.minimum(bound[inside], speed**2)
        edges = tuple(sorted({edge for start, end, _ in self.zones for edge in (start, end)}))
        return _bound(self.name, bound, edges)


@dataclass(frozen=True)
class SpeedProfile(Limit):
    """Path speed s' <= a profile: linear in s between ``places`` (m) with ``speeds`` (m/s),
    constant beyond.

    Raises ArgumentError unless places increase and speeds are finite and >= 0.
    """

    places: tuple[float, ...]
    speeds: tuple[float, ...]
    name: str = "speed_profile"

    def __post_init__(self) -> None:
        places = require_rising(f"{self.name}.places", self.places, "path parameters, m")
        require_not_negative(f"{self.name}.speeds", self.speeds, "m/s a place", places.shape)

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return _bound(
            self.name, np.interp(path.s, self.places, self.speeds) ** 2, tuple(self.places)
        )


def _bound(name: str, sd2_max: Array, edges: tuple[float, ...]) -> Rows:
    empty = np.zeros((len(sd2_max), 0))
    return Rows(name, empty, empty, empty, empty, sd2_max, edges)
