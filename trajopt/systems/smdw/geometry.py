"""Outline of the semi-circular Mecanum double wheel (SMDW) at a step, in closed form and as a point
cloud.

[guzman2015], section 4.1: each hub's outline is a half circle (Rc) joined to a half ellipse (Rc,
Re); the two hubs sit side by side on one axle, half a turn apart, so that one half circle always
carries.

Wheel frame: x forward, y along the axle towards the step, z up, origin at the axle, whose height
over the ground is Rc. The *facing* hub is the one on the side of the step. ``theta`` is the wheel
angle counted from where the facing hub has its ellipse down, positive forward (about +y). ``yaw``
in [-pi, 0] is the direction of the wheel's x axis seen from the step's normal: -pi/2 puts the
wheel's face parallel to the step (lateral motion), 0 is square on. Wheels that meet the step with
their right side are mirror images.

The step may come as near as the *collision line*: where the hub that carries the load would touch
the step's face. What the lifted hub then has above the step decides. The outline is convex, so
everything follows from its support function and its intersection with straight lines.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray, require_positive
from trajopt.errors import ArgumentError
from trajopt.robots.description import WheelSection
from trajopt.simulate.double import hub_support


@dataclass(frozen=True)
class DoubleWheel:
    """Sizes of the two hubs, m: Rc ``radius``, Re ``minor_radius``, hub ``depth`` along the axle,
    ``gap`` between.

    Raises ArgumentError for sizes that make no double wheel.
    """

    radius: float
    minor_radius: float
    depth: float
    gap: float

    def __post_init__(self) -> None:
        require_positive("radius", self.radius, "m")
        if not 0 < self.minor_radius <= self.radius:
            raise ArgumentError(
                "minor_radius", self.minor_radius, f"a length in (0, {self.radius:g}] m"
            )
        if not (0 < self.depth < math.inf and 0 <= self.gap < math.inf):
            raise ArgumentError(
                "depth, gap", (self.depth, self.gap), "a depth > 0 m and a gap >= 0 m"
            )

    @classmethod
    def of(cls, wheel: WheelSection) -> DoubleWheel:
        """The described wheel. Raises ArgumentError for one without a double hub."""
        if wheel.double is None:
            raise ArgumentError("wheel.double", None, "a double wheel")
        double = wheel.double
        return cls(wheel.radius, double.minor_radius, double.depth, double.gap)

    @property
    def greatest_clearance(self) -> float:
        """Rc - Re, m: no step above this passes under the lifted hub."""
        return self.radius - self.minor_radius

    @property
    def width(self) -> float:
        """Extent along the axle, m."""
        return self.gap + 2 * self.depth


@dataclass(frozen=True, eq=False)
class Meeting:
    """Wheel at its collision line in front of a step; arrays of the broadcast shape of (theta,
    yaw).

    ``over``: whether the lifted hub has any part above the step (without one ``clearance`` is inf,
    the rest 0). ``clearance`` (m): its lowest point there, above the ground. ``offset`` (m): x of
    that point, ahead of the axle. ``arm`` (m): its distance from the axle. ``tangent`` (rad, <= 0):
    angle of the outline there, negative where it rises towards the step (zeta_m of Eqn. 4.13).
    ``line`` (m): distance of the collision line from the axle along the step's normal.
    """

    over: BoolArray
    clearance: Array
    offset: Array
    arm: Array
    tangent: Array
    line: Array


def support_down(wheel: DoubleWheel, angle: ArrayLike) -> Array:
    """Distance (m) from the axle down to the lowest point of a hub turned by ``angle`` from
    ellipse-down."""
    return hub_support(wheel.radius, wheel.minor_radius, angle)


def contact_offset(wheel: DoubleWheel, angle: ArrayLike) -> Array:
    """x (m) of a hub's lowest point ahead of the axle: the flat-faced cam's contact (Figure
    4.10)."""
    a = np.asarray(angle, dtype=np.float64)
    excess = (wheel.radius**2 - wheel.minor_radius**2) * np.sin(a) * np.cos(a)
    return np.where(np.cos(a) >= 0, excess / support_down(wheel, a), 0.0)


def meet_step(wheel: DoubleWheel, theta: ArrayLike, yaw: ArrayLike, height: float) -> Meeting:
    """Closed form of the wheel at its collision line before a step of ``height`` (m); broadcasts
    theta and yaw.

    Raises ArgumentError for a height outside (0, Rc) or a yaw outside [-pi, 0].
    """
    theta, yaw, nx, ny, facing_lifted, carrying, lifted = roles(wheel, theta, yaw, height)
    near, far = faces(wheel, facing_lifted)
    line = (
        nx * _reach(wheel, carrying, height - wheel.radius, np.where(nx >= 0, 1.0, -1.0))
        + ny * near
    )
    low_x, low_z = contact_offset(wheel, lifted), -support_down(wheel, lifted)
    free = nx * low_x + ny * far >= line
    steep = np.where(np.abs(nx) > 1e-12, nx, 1.0)
    cut = np.clip((line - ny * far) / steep, -2 * wheel.radius, 2 * wheel.radius)
    cut_z, slope, inside = _lower_boundary(wheel, lifted, cut)
    over = free | (inside & (np.abs(nx) > 1e-12))
    x, z = np.where(free, low_x, cut), np.where(free, low_z, cut_z)
    rise = np.where(free, 0.0, np.sign(nx) * slope)
    return Meeting(
        over,
        np.where(over, wheel.radius + z, np.inf),
        np.where(over, x, 0.0),
        np.where(over, np.hypot(x, z), 0.0),
        np.where(over, -np.arctan(np.maximum(rise, 0.0)), 0.0),
        line,
    )


def roles(
    wheel: DoubleWheel, theta: ArrayLike, yaw: ArrayLike, height: float
) -> tuple[Array, Array, Array, Array, BoolArray, Array, Array]:
    """Broadcast angles, the step's normal in the wheel frame, and which hub carries, with both
    hubs' angles."""
    if not 0 < height < wheel.radius:
        raise ArgumentError(
            "height", height, f"a step between 0 and the wheel radius {wheel.radius:g} m"
        )
    t, y = np.broadcast_arrays(
        np.asarray(theta, dtype=np.float64), np.asarray(yaw, dtype=np.float64)
    )
    if not (np.all(np.isfinite(t)) and np.all((y >= -np.pi - 1e-12) & (y <= 1e-12))):
        raise ArgumentError("theta, yaw", (theta, yaw), "finite angles, yaw in [-pi, 0] rad")
    facing_lifted = np.cos(t) >= 0
    return (
        t,
        y,
        np.cos(y),
        -np.sin(y),
        facing_lifted,
        np.where(facing_lifted, t + np.pi, t),
        np.where(facing_lifted, t, t + np.pi),
    )


def faces(wheel: DoubleWheel, facing_lifted: BoolArray) -> tuple[Array, Array]:
    """y (m) of the face nearest to the step: of the carrying hub and of the lifted one."""
    outside, inside = wheel.gap / 2 + wheel.depth, -wheel.gap / 2
    return np.where(facing_lifted, inside, outside), np.where(facing_lifted, outside, inside)


def _reach(wheel: DoubleWheel, angle: Array, level: float, side: Array) -> Array:
    """x (m) farthest to ``side`` (+1 front, -1 rear) of a hub's outline at or below ``level`` (m
    over the axle)."""
    a = side * angle  # the rear of a hub is the front of its mirror image
    s, c = np.sin(a), np.cos(a)
    on_circle = s >= 0
    h = np.hypot(wheel.radius * c, wheel.minor_radius * s)
    tip = np.where(on_circle, wheel.radius, h)
    tip_z = np.where(on_circle, 0.0, -(wheel.radius**2 - wheel.minor_radius**2) * s * c / h)
    circle = math.sqrt(wheel.radius**2 - level**2)
    qa, qb, _ = _quadric(wheel, a)
    root = np.sqrt(np.maximum(qa - level**2 / (wheel.radius * wheel.minor_radius) ** 2, 0.0))
    at_level = np.where(circle * s + level * c >= 0, circle, (-qb * level + root) / qa)
    return np.asarray(side * np.where(tip_z <= level, tip, at_level))


def _lower_boundary(wheel: DoubleWheel, angle: Array, x: Array) -> tuple[Array, Array, BoolArray]:
    """z (m over the axle) and slope of a hub's lower boundary at ``x`` (m), and whether it reaches
    that far."""
    s, c = np.sin(angle), np.cos(angle)
    under = np.sqrt(np.maximum(wheel.radius**2 - x**2, 1e-300))
    on_circle = (x * s - under * c >= 0) & (np.abs(x) <= wheel.radius)
    qa, qb, qc = _quadric(wheel, angle)
    inner = qc - x**2 / (wheel.radius * wheel.minor_radius) ** 2
    root = np.sqrt(np.maximum(inner, 1e-300))
    on_ellipse = (-qb * x - root) / qc
    z = np.where(on_circle, -under, on_ellipse)
    slope = np.where(on_circle, x / under, (qa * x + qb * on_ellipse) / root)
    return z, slope, on_circle | (inner > 0)


def _quadric(wheel: DoubleWheel, angle: Array) -> tuple[Array, Array, Array]:
    """A, B, C of the turned ellipse A x^2 + 2 B x z + C z^2 = 1 (Eqn. 4.11, forward angles
    positive)."""
    s, c = np.sin(angle), np.cos(angle)
    a, b = 1 / wheel.radius**2, 1 / wheel.minor_radius**2
    return c * c * a + s * s * b, s * c * (b - a), s * s * a + c * c * b
