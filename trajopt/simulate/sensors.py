"""Sensors of a simulated robot: where its measurements, and their noise, come from."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.control.measured import Measured
from trajopt.errors import ArgumentError
from trajopt.simulate.engine import Observation

Sense = Callable[[float, Observation], Measured]


def exact(t: float, seen: Observation) -> Measured:  # noqa: ARG001 - a Sense
    """Everything as it is, at every control period."""
    return _encoders(seen, seen.pose, np.zeros(3))


@dataclass(frozen=True)
class Sensors:
    """Exact encoders, and a pose measurement every ``period`` (s; 0: at every control period, inf:
    the first only) with standard deviations ``position`` (m) and ``yaw`` (rad)."""

    period: float = 0.05
    position: float = 0.005
    yaw: float = math.radians(0.5)

    def __post_init__(self) -> None:
        if not (self.period >= 0 and self.position >= 0 and self.yaw >= 0):
            raise ArgumentError(
                "sensors",
                (self.period, self.position, self.yaw),
                "a period >= 0 and deviations >= 0",
            )

    def sense(self, rng: Generator) -> Sense:
        """Measurements of one run, blurred by ``rng``."""
        due = 0.0
        deviations = np.array([self.position, self.position, self.yaw])

        def measure(t: float, seen: Observation) -> Measured:
            nonlocal due
            if t < due - 1e-9:
                return _encoders(seen, None, deviations)
            due += self.period
            return _encoders(seen, seen.pose + rng.normal(0.0, 1.0, 3) * deviations, deviations)

        return measure


def _encoders(seen: Observation, pose: Array | None, deviations: Array) -> Measured:
    return Measured(seen.wheel_angles, seen.wheel_speeds, seen.swivels, pose, deviations)
