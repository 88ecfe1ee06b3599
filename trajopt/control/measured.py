"""What a controller is told, and what it answers: measurements, never the truth behind them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from trajopt.arrays import Array


def _none() -> Array:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class Measured:
    """Encoders: ``wheel_angles`` (W,) rad, counted on, ``wheel_speeds`` (W,) rad/s, and the angles
    of castors and pivots, ``swivels`` (C,) rad.

    ``pose`` (3,) m, m, rad where there is a new measurement, with its standard ``deviations``
    (3,); None in between.
    """

    wheel_angles: Array
    wheel_speeds: Array
    swivels: Array = field(default_factory=_none)
    pose: Array | None = None
    deviations: Array = field(default_factory=_none)


@dataclass(frozen=True, eq=False)
class Targets:
    """``wheel_speeds`` (W,) rad/s, and ``angles`` (rad) of steered wheels, then of driven axles, in
    the order of the robot's file; none: they stay at 0."""

    wheel_speeds: Array
    angles: Array = field(default_factory=_none)


class Controller(Protocol):
    """Called at every control period; lives for one run."""

    def step(self, t: float, measured: Measured) -> Targets:
        """What the drives shall reach by the next call; ``t`` in s."""
        ...
