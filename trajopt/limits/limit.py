"""What a limit is: rows that are linear in (s'', s'^2) at every gridpoint of a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from trajopt.paths.samples import PathSamples
from trajopt.robots.platform import Platform

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rows:
    """Rows a s'' + b s'^2 <= c at N gridpoints, R rows each, and an upper bound on s'^2.

    ``scale`` (N, R) is positive and has the unit of ``c``: the size of the limit itself (a wheel
    acceleration limit, mu g, ...). Margins are reported relative to it.
    """

    name: str  # the limit's name, as reported when it binds or cannot be met
    a: Array  # (N, R)
    b: Array  # (N, R)
    c: Array  # (N, R)
    scale: Array  # (N, R)
    sd2_max: Array  # (N,) m^2/s^2, inf where the limit does not bound the speed alone


class Limit(Protocol):
    """A limit of a motion. ``name`` is unique among the limits used together."""

    @property
    def name(self) -> str: ...

    def rows(self, path: PathSamples, robot: Platform | None) -> Rows:
        """Rows at the gridpoints of ``path``. Raises ArgumentError where the limit needs a robot."""
        ...
