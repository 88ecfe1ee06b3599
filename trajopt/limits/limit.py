"""What a limit is: rows that are linear in (s'', s'^2) at every gridpoint of a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot


@dataclass(frozen=True)
class Rows:
    """Rows a s'' + b s'^2 <= c at N gridpoints, R rows each, and an upper bound on s'^2.

    ``scale`` (N, R) is positive and has the unit of ``c``: the size of the limit itself (a wheel
    acceleration limit, mu g, ...). Margins are reported relative to it. ``edges`` are path
    parameters (m) where the limit jumps or bends (ends of a speed zone): time scaling puts
    gridpoints there.
    """

    name: str  # the limit's name, as reported when it binds or cannot be met
    a: Array  # (N, R)
    b: Array  # (N, R)
    c: Array  # (N, R)
    scale: Array  # (N, R)
    sd2_max: Array  # (N,) m^2/s^2, inf where the limit does not bound the speed alone
    edges: tuple[float, ...] = ()  # m


class Limit(Protocol):
    """A limit of a motion. ``name`` is unique among the limits used together."""

    @property
    def name(self) -> str: ...

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        """Rows at the gridpoints of ``path``. Raises ArgumentError where the limit needs a
        robot."""
        ...


def linear_rows(name: str, a: Array, b: Array, c: Array, scale: Array | float) -> Rows:
    """Rows a s'' + b s'^2 <= c, arrays (N, R), without a bound on the speed alone."""
    return Rows(
        name,
        a,
        b,
        c,
        np.broadcast_to(np.asarray(scale, dtype=np.float64), a.shape),
        np.full(len(a), np.inf),
    )


def speed_rows(name: str, rate: Array, largest: float) -> Rows:
    """The bound rate * s' <= largest, with rate (N,) >= 0 per unit path speed."""
    with np.errstate(divide="ignore", over="ignore"):
        sd2_max = (largest / rate) ** 2  # inf where the quantity does not move
    empty = np.zeros((len(rate), 0))
    return Rows(name, empty, empty, empty, empty, sd2_max)


def require_each_positive(argument: str, values: float | tuple[float, ...], unit: str) -> None:
    """Raises ArgumentError unless every value is > 0, and one at least is finite."""
    array = np.asarray(values, dtype=np.float64)
    if array.ndim > 1 or not array.size or not (np.all(array > 0) and np.isfinite(array).any()):
        raise ArgumentError(argument, values, f"finite values > 0 {unit}")


def by_wheel(
    argument: str, largest: float | tuple[float, ...], wheels: int
) -> tuple[float, Array | float]:
    """The least of the values and, for each wheel, that least as a share of its own value."""
    values = np.asarray(largest, dtype=np.float64)
    if values.ndim == 0:
        return float(values), 1.0
    if len(values) != wheels:
        raise ArgumentError(argument, largest, f"one value, or {wheels}: one a wheel that rolls")
    return float(values.min()), values.min() / values


def require_robot(name: str, robot: Robot | None) -> Robot:
    """The robot, or ArgumentError: the limit ``name`` cannot be told without one."""
    if robot is None:
        raise ArgumentError(
            "robot", None, f"a robot: the limit '{name}' depends on its wheels or masses"
        )
    return robot
