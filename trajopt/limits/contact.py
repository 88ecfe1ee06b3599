"""Contact: no wheel loses its load."""

from __future__ import annotations

from dataclasses import dataclass

from trajopt.arrays import as_numbers
from trajopt.errors import ArgumentError
from trajopt.limits.limit import Limit, Rows, linear_rows, require_robot
from trajopt.limits.loads import contact_loads
from trajopt.paths.samples import PathSamples
from trajopt.robots.robot import STANDARD_GRAVITY, Robot


@dataclass(frozen=True)
class Contact(Limit):
    """The load on every wheel stays >= ``share`` of an even share of the weight, as a suspension of
    equal stiffness everywhere gives it; 0 is where a wheel lifts.

    Stricter than ``Tip`` for four wheels and more: a robot may stand safely on three. One row a
    wheel. Raises ArgumentError unless 0 <= ``share`` < 1, or when there is no robot.
    """

    share: float = 0.0
    name: str = "contact"

    def __post_init__(self) -> None:
        name, expected = f"{self.name}.share", "a share from 0 to below 1"
        if not 0 <= as_numbers(name, self.share, expected, ()) < 1:
            raise ArgumentError(name, self.share, expected)

    def rows(self, path: PathSamples, robot: Robot | None) -> Rows:
        loads = contact_loads(path, require_robot(self.name, robot))
        even = STANDARD_GRAVITY / loads.a.shape[1]
        return linear_rows(self.name, -loads.a, -loads.b, loads.c - self.share * even, even)
