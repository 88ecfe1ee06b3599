"""Suspension travel of an ASOC module on a four-bar linkage ([udengaard2008], sections 3.1.3 and
3.4), and the point design of section 3.5.

Side view of a parallelogram: two parallel bars of one length between body and module, pivots one
``spacing`` above the other, so the module axis stays vertical. Bar angle theta > 0 lifts the
module. Three designs: straight bars; both bars bent upwards by ``arch`` near the wheels; bent bars
whose upper one is split in two halves that pass beside the lower one. Two things end the travel:
the lower bar on the wheels (at any alpha, so at the rim of the workspace circle), and bar on bar.
The thesis draws the designs without sizes: the model is ours, and the default sizes are chosen for
the point design.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

import numpy as np

from trajopt.arrays import require_positive
from trajopt.errors import ArgumentError
from trajopt.systems.asoc.modules import AsocGeometry, workspace_radius

STEP_SHARE = 2.0 / 3.0  # share of the wheel diameter that should rise above a step (section 3.1.3)
POINT_TRAVEL = 0.33  # m, [udengaard2008] section 3.5
POINT_DESIGN = AsocGeometry(
    modules=4, split=0.21, offset=0.10, wheel_radius=0.163, wheel_width=0.03
)
LARGEST_ANGLE = np.radians(60.0)  # rad, stop of the bars' joints; chosen


class Linkage(Enum):
    """The three linkages of Figures 19 and 20."""

    STRAIGHT = "straight"
    SHAPED = "shaped"
    SHAPED_SPLIT = "shaped-split"


@dataclass(frozen=True)
class FourBar:
    """Sizes of the linkage, m. ``length`` of the bars, ``spacing`` of their pivots, bar
    ``thickness``, ``arch`` by which shaped bars rise beside the module, ``clearance`` from the
    highest point of a wheel to the middle of the lower bar at theta = 0."""

    length: float = 0.40  # chosen
    spacing: float = 0.10  # chosen
    thickness: float = 0.02  # chosen
    arch: float = 0.06  # chosen
    clearance: float = 0.04  # chosen

    def __post_init__(self) -> None:
        for name in ("length", "spacing", "thickness", "clearance"):
            require_positive(name, getattr(self, name), "m")
        if not 0 <= self.arch < np.inf:
            raise ArgumentError("arch", self.arch, "a finite length >= 0 m")
        if self.spacing <= self.thickness:
            raise ArgumentError(
                "spacing", self.spacing, f"more than the bar thickness, {self.thickness} m"
            )


@dataclass(frozen=True)
class Travel:
    """Module travel from theta = 0, m, and what ends it: "wheel", "bars" or "stop"."""

    up: float
    down: float
    up_end: str
    down_end: str

    @property
    def total(self) -> float:
        return self.up + self.down


def suspension_travel(linkage: Linkage, bars: FourBar, geometry: AsocGeometry) -> Travel:
    """Largest travel up and down without interference at any module angle alpha."""
    up, up_end = _limit(linkage, bars, geometry, 1.0)
    down, down_end = _limit(linkage, bars, geometry, -1.0)
    return Travel(
        float(bars.length * np.sin(up)), float(bars.length * np.sin(down)), up_end, down_end
    )


def step_travel(step: float, wheel_radius: float) -> float:
    """Suspension travel (m) that lifts a wheel onto a step: two thirds of the wheel's diameter
    above it."""
    if not (step >= 0 and wheel_radius > 0):
        raise ArgumentError("step", (step, wheel_radius), "a height >= 0 m and a radius > 0 m")
    return max(step - (1 - STEP_SHARE) * 2 * wheel_radius, 0.0)


def _limit(
    linkage: Linkage, bars: FourBar, geometry: AsocGeometry, sign: float
) -> tuple[float, str]:
    """Largest |theta| in one direction and what ends it."""
    arch = 0.0 if linkage is Linkage.STRAIGHT else bars.arch
    reach = min(workspace_radius(geometry), bars.length)

    def wheel(theta: float) -> float:
        """Gap between wheel and lower bar at the rim of the workspace; raising the module lowers
        the bar."""
        drop = reach * np.tan(sign * theta)
        return float(
            bars.clearance + arch * np.cos(theta) - drop - bars.thickness / 2 / np.cos(theta)
        )

    def bar(theta: float) -> float:
        """Gap between the bars: their distance shrinks by cos(theta); a bent lower bar takes its
        arch off where the upper one is straight across it."""
        return float(bars.spacing * np.cos(theta) - arch - bars.thickness)

    ends: list[tuple[float, str]] = [(LARGEST_ANGLE, "stop"), (_first(wheel), "wheel")]
    if linkage is not Linkage.SHAPED_SPLIT:
        ends.append((_first(bar), "bars"))
    return min(ends)


def _first(gap: Callable[[float], float]) -> float:
    """Smallest theta in [0, LARGEST_ANGLE] where a gap that shrinks with theta closes; inf where it
    never does, 0 where it is closed from the start."""
    if gap(0.0) < 0:
        return 0.0
    if gap(LARGEST_ANGLE) >= 0:
        return float("inf")
    low, high = 0.0, LARGEST_ANGLE
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if gap(middle) >= 0 else (low, middle)
    return low
