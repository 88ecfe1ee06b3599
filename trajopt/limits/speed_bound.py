"""Bounds on the path speed along the path: zones, or a given profile."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Rows
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot

_TOUCH = 1e-9  # m; a zone reaches this far beyond its ends, so that the gridpoint on its edge belongs to it


@dataclass(frozen=True)
class SpeedZones:
    """Path speed s' <= speed inside zones: ``zones`` holds (from, to, speed) in m, m, m/s; they may
    overlap.

    Raises ArgumentError for an empty zone, a negative speed or a number that is not finite. A speed
    of 0 is a stop that no motion passes: time scaling says so.
    """

    zones: tuple[tuple[float, float, float], ...]
    name: str = "speed_zones"

    def __post_init__(self) -> None:
        for i, zone in enumerate(self.zones):
            if len(zone) != 3 or not np.all(np.isfinite(zone)) or zone[1] <= zone[0] or zone[2] < 0:
                raise ArgumentError(
                    f"{self.name}.zones[{i}]", zone, "(from, to > from, speed >= 0), m and m/s"
                )

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        bound = np.full(len(path.s), np.inf)
        for start, end, speed in self.zones:
            inside = (path.s >= start - _TOUCH) & (path.s <= end + _TOUCH)
            bound[inside] = np.minimum(bound[inside], speed**2)
        edges = tuple(sorted({edge for start, end, _ in self.zones for edge in (start, end)}))
        return _bound(self.name, bound, edges)


@dataclass(frozen=True)
class SpeedProfile:
    """Path speed s' <= a profile: linear in s between ``places`` (m) with ``speeds`` (m/s),
    constant beyond.

    Raises ArgumentError unless places increase and speeds are finite and >= 0.
    """

    places: tuple[float, ...]
    speeds: tuple[float, ...]
    name: str = "speed_profile"

    def __post_init__(self) -> None:
        if (
            not self.places
            or not np.all(np.isfinite(self.places))
            or np.any(np.diff(self.places) <= 0)
        ):
            raise ArgumentError(f"{self.name}.places", self.places, "increasing path parameters, m")
        speeds = np.asarray(self.speeds, dtype=np.float64)
        if len(speeds) != len(self.places) or not np.all(np.isfinite(speeds)) or np.any(speeds < 0):
            raise ArgumentError(f"{self.name}.speeds", self.speeds, "one speed >= 0 m/s a place")

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:  # noqa: ARG002
        return _bound(
            self.name, np.interp(path.s, self.places, self.speeds) ** 2, tuple(self.places)
        )


def _bound(name: str, sd2_max: Array, edges: tuple[float, ...]) -> Rows:
    empty = np.zeros((len(sd2_max), 0))
    return Rows(name, empty, empty, empty, empty, sd2_max, edges)
