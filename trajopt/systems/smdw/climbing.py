"""LOC8 on semi-circular Mecanum double wheels (SMDW): sizes, and which wheel states can climb a
step.

``alpha`` is the angle from the step's normal to the direction of motion (robot forward, or sideways
in lateral motion), counter-clockwise. It is the alpha of [guzman2015]'s Tables 6.1 and 6.6 (psi
= alpha in forward motion, psi = -90 deg + alpha in lateral motion to the left).

Lateral climbing: the lifted hub goes over the step, then turns like a cam with a flat follower and
lifts the robot. Forward climbing: the lifted hub's underside lands almost level on the step.
Verdicts follow from the outline (smdw_geometry.py); what it cannot tell, friction and rollers, is
measured in physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import Enum
from functools import lru_cache

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.robot import STANDARD_GRAVITY, Robot, robot
from trajopt.systems.smdw.geometry import (
    DoubleWheel,
    Meeting,
    contact_offset,
    meet_step,
    support_down,
)

DEFAULT_WHEEL = DoubleWheel.of(robot("loc8-smdw").description.wheels[0])
# Sizes that give the printed contact offsets, 4.63 cm at 30 deg and 3.49 cm at 60 deg (Figure
# 4.10); fitted.
FITTED_WHEEL = replace(DEFAULT_WHEEL, radius=0.1029, minor_radius=0.0554)

STEEPEST_TANGENT = math.radians(
    10.0
)  # rad, thesis 4.1.5: -10 deg < zeta_m <= 0 lets a hub land on the step
# In forward motion a leading wheel's traction acts along its roller axis, 45 deg off the heading:
# beyond this alpha it has no component towards the step (wheel kinematics).
LARGEST_FORWARD_ALPHA = math.radians(45.0)  # rad
THESIS_FORWARD_ALPHA = (math.radians(-40.0), math.radians(-13.0))  # rad, Figure 4.18
# First phases that climb in lateral motion, per step height (m -> rad): measured in MuJoCo at
# friction >= 0.6 and 8 N m; below them the hub meets the step's face before it is high enough and
# stalls there.
LATERAL_FIRST_PHASE = ((0.035, -1.05), (0.05, -1.2))
_SCAN = np.radians(
    np.arange(-90.0, 90.01, 0.25)
)  # wheel angles (one hub lifted) that windows are read from


class Motion(Enum):
    """How a step is met: driving forward, or sideways to the left or to the right."""

    FORWARD = "forward"
    LEFT = "lateral left"
    RIGHT = "lateral right"

    @property
    def lateral(self) -> bool:
        return self is not Motion.FORWARD


@dataclass(frozen=True)
class Window:
    """Wheel angles that climb, rad, along the commanded rotation, at the moment the wheel meets the
    step."""

    low: float
    high: float

    @property
    def middle(self) -> float:
        return (self.low + self.high) / 2

    @property
    def half_width(self) -> float:
        return (self.high - self.low) / 2


@dataclass(frozen=True)
class Verdict:
    """Whether a wheel state can climb, and why (not); ``torque`` (N m) lifts a quarter of the robot
    from there."""

    climbs: bool
    reason: str
    clearance: float
    offset: float
    arm: float
    tangent: float
    torque: float


@lru_cache(maxsize=64)
def loc8_smdw(wheel: DoubleWheel = DEFAULT_WHEEL) -> Robot:
    """LOC8 on double wheels of these sizes; its outline is the rectangle around them. Raises
    ArgumentError for another rolling radius."""
    if wheel.radius != DEFAULT_WHEEL.radius:
        raise ArgumentError(
            "wheel.radius", wheel.radius, f"LOC8's rolling radius {DEFAULT_WHEEL.radius} m"
        )
    hubs = {name: getattr(wheel, name) for name in ("minor_radius", "depth", "gap")}
    changes = {f"wheels.all.double.{name}": value for name, value in hubs.items()}
    return robot("loc8-smdw", {**changes, "wheels.all.width": wheel.width})


def wheel_yaw(motion: Motion, alpha: float) -> float:
    """``yaw`` of smdw_geometry (rad, in [-pi, 0]) of wheels that meet a step at ``alpha``, mirrored
    if need be."""
    if motion is Motion.FORWARD:
        return -abs(alpha)
    return -math.pi / 2 + (alpha if motion is Motion.LEFT else -alpha)


def meeting(
    wheel: DoubleWheel, theta: float, motion: Motion, alpha: float, height: float
) -> Meeting:
    """The wheel at its collision line; ``theta`` counted along the rotation, facing hub's ellipse
    down at 0."""
    return meet_step(wheel, theta, wheel_yaw(motion, alpha), height)


def verdict(
    wheel: DoubleWheel,
    theta: float,
    motion: Motion,
    alpha: float,
    height: float,
    *,
    load: float | None = None,
) -> Verdict:
    """Whether the geometry lets a wheel climb from this state; ``load`` (N) on the wheel, default a
    quarter robot."""
    found = meeting(wheel, theta, motion, alpha, height)
    weight = robot("loc8-smdw").body.mass * STANDARD_GRAVITY / 4 if load is None else load
    clearance, offset, arm, tangent = (
        float(v) for v in (found.clearance, found.offset, found.arm, found.tangent)
    )
    reason = refusal(wheel, motion, alpha, height) or _state_refusal(
        bool(found.over), clearance, tangent, motion, height
    )
    text = (
        reason
        or f"clears the step by {100 * (clearance - height):.2f} cm, tangent {math.degrees(tangent):.1f} deg"
    )
    return Verdict(not reason, text, clearance, offset, arm, tangent, weight * abs(offset))


def refusal(wheel: DoubleWheel, motion: Motion, alpha: float, height: float) -> str:
    """Why no wheel angle climbs like this; empty when the geometry leaves some."""
    if not 0 < height < math.inf:
        raise ArgumentError("height", height, "a step height > 0 m")
    if height >= wheel.greatest_clearance:
        return (
            f"the step is {100 * height:.2f} cm high, but at most Rc - Re = "
            f"{100 * wheel.greatest_clearance:.2f} cm passes under a lifted hub"
        )
    if motion.lateral and not covers_climb(wheel, alpha, height):
        return (
            f"at alpha = {math.degrees(alpha):.0f} deg the hub's part above the step does not cover the "
            "contact points of the whole climb"
        )
    if not motion.lateral and abs(alpha) > LARGEST_FORWARD_ALPHA + 1e-9:
        return (
            f"at alpha = {math.degrees(alpha):.0f} deg the leading wheel's rollers transmit nothing towards "
            "the step (beyond 45 deg)"
        )
    return ""


def _state_refusal(
    over: bool, clearance: float, tangent: float, motion: Motion, height: float
) -> str:
    if not over:
        return "the lifted hub does not reach over the step before the other one hits it"
    if clearance < height:
        return f"the hub hits the step: it is {100 * clearance:.2f} cm above the ground, the step {100 * height:.2f} cm"
    if not motion.lateral and tangent <= -STEEPEST_TANGENT:
        return f"the hub lands too steeply: tangent {math.degrees(tangent):.1f} deg, wanted above -10 deg"
    return ""


def region_of_contact(wheel: DoubleWheel, start: float = 0.0) -> tuple[float, float]:
    """Least and greatest contact offset (m ahead of the axle) while turning from ``start`` to pi/2
    (Eqn. 4.9)."""
    offsets = contact_offset(wheel, np.linspace(start, math.pi / 2, 721))
    return float(offsets.min()), float(offsets.max())


def covers_climb(wheel: DoubleWheel, alpha: float, height: float) -> bool:
    """Whether the part of the facing hub above the step covers the region of contact, on both
    critical wheels.

    The wheels turn against each other, so the cover must hold for alpha and for -alpha.
    """
    if abs(alpha) < 1e-9:
        return True
    if abs(alpha) >= math.pi / 2:
        return False
    low, high = region_of_contact(wheel)
    reach = math.sqrt(max(wheel.radius**2 - (wheel.radius - height) ** 2, 0.0))
    # Above the step at alpha > 0: x >= reach - (gap + depth) / tan(alpha); mirrored for alpha < 0.
    edge = reach - (wheel.gap + wheel.depth) / math.tan(abs(alpha))
    return edge <= low and edge <= -high


def climb_window(wheel: DoubleWheel, motion: Motion, alpha: float, height: float) -> Window | None:
    """Wheel angles that climb, or None. Forward: from the outline. Lateral: up to where the hub
    still clears the step (outline), from the first phase that climbs in physics."""
    if refusal(wheel, motion, alpha, height):
        return None
    if motion.lateral:
        heights, phases = zip(*LATERAL_FIRST_PHASE, strict=True)
        return Window(float(np.interp(height, heights, phases)), clearing_angle(wheel, height))
    found = meet_step(wheel, _SCAN, wheel_yaw(motion, alpha), height)
    good = found.over & (found.clearance >= height) & (found.tangent > -STEEPEST_TANGENT)
    if not good.any():
        return None
    changes = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    spans = changes.reshape(-1, 2)
    first, last = spans[np.argmax(spans[:, 1] - spans[:, 0])]
    return Window(float(_SCAN[first]), float(_SCAN[last - 1]))


def clearing_angle(wheel: DoubleWheel, height: float) -> float:
    """Largest wheel angle (rad) at which the whole lifted hub is above ``height`` (m): h(theta) =
    Rc - height."""
    square = ((wheel.radius - height) ** 2 - wheel.minor_radius**2) / (
        wheel.radius**2 - wheel.minor_radius**2
    )
    if square < 0:
        raise ArgumentError(
            "height", height, f"a step below Rc - Re = {wheel.greatest_clearance:.4g} m"
        )
    return math.asin(min(1.0, math.sqrt(square)))


def forward_alphas(
    wheel: DoubleWheel, height: float, *, theta: float | None = None
) -> tuple[float, float] | None:
    """Range of |alpha| (rad) in which a step of ``height`` (m) can be climbed forward, or None.

    At wheel angle ``theta`` (Figure 4.18 takes 0), or at any if None.
    """
    alphas = np.radians(np.arange(0.0, math.degrees(LARGEST_FORWARD_ALPHA) + 0.01, 0.2))
    angles = _SCAN[::4] if theta is None else np.array([theta])
    found = meet_step(wheel, angles[:, None], -alphas[None, :], height)
    good = (found.over & (found.clearance >= height) & (found.tangent > -STEEPEST_TANGENT)).any(
        axis=0
    )
    good &= height < wheel.greatest_clearance
    return (float(alphas[good].min()), float(alphas[good].max())) if good.any() else None


def collision_reach(
    wheel: DoubleWheel, theta: float, motion: Motion, alpha: float, height: float
) -> float:
    """How far ahead of its axle (m, along the step's normal) a wheel meets the step.

    Lateral: the outer face, since phases count from there. Forward: the collision line.
    """
    if motion.lateral:
        return wheel.width / 2
    return float(meeting(wheel, theta, motion, alpha, height).line)


def lift(wheel: DoubleWheel, theta: Array) -> Array:
    """Height (m) by which a hub standing on a step of Rc - Re lifts the axle, from wheel angle 0
    on."""
    return np.asarray(support_down(wheel, theta) - wheel.minor_radius)
