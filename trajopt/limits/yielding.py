"""A limit that gives way to a robot which is already too fast for it: below the speed of a braking
motion it holds."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from trajopt.limits.limit import Limit, Rows, is_linear
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class Yielding:
    """``limit``, whose bound on the speed alone is raised to a braking motion: ``squares`` s'^2
    (m^2/s^2) at ``places`` (m), linear in between. Its rows on s'' stay as they are. ``edges`` (m):
    where the bound is reached.

    Made by time scaling for a robot that is faster than a bound and can only brake.
    """

    limit: Limit
    places: tuple[float, ...]
    squares: tuple[float, ...]
    edges: tuple[float, ...] = ()

    @property
    def name(self) -> str:
        return self.limit.name

    @property
    def linear(self) -> bool:
        return is_linear(self.limit)

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        rows = self.limit.rows(path, robot)
        braking = np.interp(path.s, self.places, self.squares)
        return replace(
            rows, sd2_max=np.maximum(rows.sd2_max, braking), edges=(*rows.edges, *self.edges)
        )
