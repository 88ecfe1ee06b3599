"""What a limit is: rows that are linear in (s'', s'^2) at every gridpoint of a path."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from trajopt.arrays import Array, IndexArray, as_numbers
from trajopt.errors import ArgumentError
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import Robot
from trajopt.robots.steering import WheelStates, steering_of


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
    """A limit of a motion. ``name`` is unique among the limits used together.

    One that is not linear in (s'', s'^2) has an attribute ``linear`` = False, and rows that are
    exact at s'^2 = ``path.sd2`` and nowhere looser than the limit; ``a`` does not depend on ``sd2``:
    see ``MotorCurve``. ``free_at_rest`` = True says that it leaves any force at rest, as ``Power``,
    whose ``work`` the lower bound on time integrates.
    """

    @property
    def name(self) -> str: ...

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        """Rows at the gridpoints of ``path``. Raises ArgumentError where the limit needs a
        robot."""
        ...


def is_linear(limit: Limit) -> bool:
    """Whether its rows are the same at every speed."""
    return bool(getattr(limit, "linear", True))


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
    array = as_numbers(argument, values, f"finite values > 0 {unit}")
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
        raise ArgumentError(argument, largest, f"one value, or {wheels}: one each")
    if np.isinf(values).all():
        raise ArgumentError(argument, None, "a value: the robot's file gives none")
    return float(values.min()), values.min() / values


def spins(path: PathSamples, robot: Robot) -> tuple[Array, Array]:
    """(N, W): rates of the wheels of ``robot.wheels`` per unit path speed, rad/m, and their
    derivative along the path; where samples hold no wheel states, of castors as they are drawn.

    Raises ArgumentError for a robot with steered wheels and samples without wheel states.
    """
    wheels, steering = path.wheels, steering_of(robot)
    if wheels is not None:
        return wheels.spin[:, steering.rolling], wheels.spin_rate[:, steering.rolling]
    if len(steering.steered):
        raise ArgumentError("path", "samples without wheel states", "those of a Track: it steers")
    return path.twist @ robot.inverse.T, path.twist_rate @ robot.inverse.T


def steered_wheels(
    name: str, path: PathSamples, robot: Robot | None, key: str
) -> tuple[WheelStates, tuple[float, ...]]:
    """Wheel states, and the ``key`` of every [[steering]] of the robot, inf without. Raises
    ArgumentError for a robot that does not steer, or none."""
    groups = require_robot(name, robot).description.steering
    if robot is None or not groups:
        found = None if robot is None else robot.name
        raise ArgumentError("robot", found, f"a robot that steers: the limit '{name}' needs one")
    if path.wheels is None:
        raise ArgumentError("path", "samples without wheel states", "those of a Track: it steers")
    own = [getattr(group, key) for group in groups]
    return path.wheels, tuple(np.inf if value is None else value for value in own)


@dataclass(frozen=True, eq=False)
class Turns:
    """Of M wheels that a [[steering]] turns, and of the angles of the G [[steering]] with several
    wheels: derivatives (N, M + G), and the place (M + G,) of each among all [[steering]]."""

    rate: Array  # rad/m
    bend: Array  # rad/m^2
    group: IndexArray


def turns_of(wheels: WheelStates, robot: Robot) -> Turns:
    """Of every wheel that is steered and of every [[steering]]."""
    groups = steering_of(robot).groups
    members = np.concatenate(groups)
    return Turns(
        np.hstack([wheels.steering_rate[:, members], wheels.group_rate]),
        np.hstack([wheels.steering_bend[:, members], wheels.group_bend]),
        np.concatenate(
            [np.repeat(np.arange(len(groups)), [len(g) for g in groups]), np.arange(len(groups))]
        ),
    )


def require_robot(name: str, robot: Robot | None) -> Robot:
    """The robot, or ArgumentError: the limit ``name`` cannot be told without one."""
    if robot is None:
        raise ArgumentError(
            "robot", None, f"a robot: the limit '{name}' depends on its wheels or masses"
        )
    return robot
