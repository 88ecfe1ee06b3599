"""Identification of a robot's friction and centre of gravity ([waheed2006], appendices 2 and 3).

Each function returns the estimate with its standard uncertainty, propagated to first order from
those of the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from trajopt.arrays import require_positive
from trajopt.errors import ArgumentError
from trajopt.robots.robot import STANDARD_GRAVITY

NEWTON_PER_POUND = 4.4482216152605  # N/lbf, exact (international avoirdupois pound)

_STEP = 1e-6  # relative step of central differences; error about 1e-11


class Estimate(NamedTuple):
    """A value and its standard uncertainty, same unit."""

    value: float
    uncertainty: float


class CentreOfGravity(NamedTuple):
    """Distance behind the drive axle and height above the ground, m."""

    behind_drive_axle: Estimate
    height: Estimate


def friction_from_pulls(
    forces: Sequence[float],
    *,
    mass: float,
    cog_to_drive: float,
    cog_to_caster: float,
    pull_height: float,
    mass_uncertainty: float = 0.0,
    force_uncertainty: float = 0.0,
    length_uncertainty: float = 0.0,
) -> Estimate:
    """Static friction of braked drive wheels from horizontal pulls that just move the robot (A:2-1
    to A:2-6).

    ``forces`` (N) are the readings of one or more trials; ``pull_height`` (m) is where the cable
    holds, above the ground. Moments about the caster contacts give the load on the drive wheels,
    N_A = (m g cog_to_caster - F pull_height) / (cog_to_drive + cog_to_caster) for a pull that
    unloads them; a negative ``pull_height`` means that it loads them. The scatter of the trials and
    the given uncertainties of mass (kg), scale (N) and lengths (m) enter. Raises ArgumentError for
    readings that cannot be.
    """
    pulls = np.asarray(forces, dtype=np.float64)
    if pulls.ndim != 1 or not len(pulls) or not np.all(np.isfinite(pulls)) or np.any(pulls <= 0):
        raise ArgumentError("forces", forces, "one or more forces > 0 N")
    for name, value in (
        ("mass", mass),
        ("cog_to_drive", cog_to_drive),
        ("cog_to_caster", cog_to_caster),
    ):
        require_positive(name, value)
    scatter = float(np.std(pulls, ddof=1) / np.sqrt(len(pulls))) if len(pulls) > 1 else 0.0

    def friction(x: Sequence[float]) -> float:
        force, m, front, back, height = x
        load = (m * STANDARD_GRAVITY * back - force * height) / (front + back)
        return force / load

    point = (float(pulls.mean()), mass, cog_to_drive, cog_to_caster, pull_height)
    value = friction(point)
    if not (np.isfinite(value) and value > 0):
        raise ArgumentError(
            "pull_height", pull_height, "a height at which the drive wheels keep their load"
        )
    spread = (
        float(np.hypot(scatter, force_uncertainty)),
        mass_uncertainty,
        length_uncertainty,
        length_uncertainty,
        length_uncertainty,
    )
    return Estimate(value, _propagated(friction, point, spread))


def centre_of_gravity(
    *,
    mass: float,
    wheelbase: float,
    drive_load_level: float,
    drive_load_raised: float,
    rise: float,
    axle_height: float,
    mass_uncertainty: float = 0.0,
    load_uncertainty: float = 0.0,
    length_uncertainty: float = 0.0,
) -> CentreOfGravity:
    """Centre of gravity from the drive wheels' load level and with the casters raised (A:3-1 to
    A:3-10).

    Loads are scale readings in kg, ``rise`` (m) lifts the caster axle, ``wheelbase`` (m) is between
    the axles, ``axle_height`` (m) of the casters above their ground. With tilt t = asin(rise /
    wheelbase), level: x = w N / m from the casters; tilted, the lever shrinks to w cos(t) and N_r/m
    w cos(t) = x cos(t) + h sin(t) with the weight moving towards the drive wheels, so h = (N_r - N)
    w / (m tan(t)) above the axles. Raises ArgumentError for readings that cannot be.
    """
    for name, value in (("mass", mass), ("wheelbase", wheelbase), ("rise", rise)):
        require_positive(name, value)
    if not rise < wheelbase:
        raise ArgumentError("rise", rise, f"a rise below the wheelbase {wheelbase} m")
    for name, value in (
        ("drive_load_level", drive_load_level),
        ("drive_load_raised", drive_load_raised),
    ):
        if not 0 < value < mass:
            raise ArgumentError(name, value, f"a scale reading between 0 and the mass {mass} kg")

    def behind(x: Sequence[float]) -> float:
        m, w, level, _, _, _ = x
        return w * (1 - level / m)

    def height(x: Sequence[float]) -> float:
        m, w, level, raised, up, axle = x
        return float((raised - level) * w / (m * np.tan(np.arcsin(up / w))) + axle)

    point = (mass, wheelbase, drive_load_level, drive_load_raised, rise, axle_height)
    spread = (
        mass_uncertainty,
        length_uncertainty,
        load_uncertainty,
        load_uncertainty,
        length_uncertainty,
        length_uncertainty,
    )
    return CentreOfGravity(
        Estimate(behind(point), _propagated(behind, point, spread)),
        Estimate(height(point), _propagated(height, point, spread)),
    )


def _propagated(
    function: Callable[[Sequence[float]], float], point: Sequence[float], spread: Sequence[float]
) -> float:
    """First-order standard uncertainty of function(point), independent readings."""
    total = 0.0
    for i, sigma in enumerate(spread):
        if sigma < 0:
            raise ArgumentError("uncertainty", sigma, "a value >= 0")
        if sigma == 0:
            continue
        step = _STEP * max(abs(point[i]), 1e-3)
        ends = []
        for sign in (1.0, -1.0):
            moved = list(point)
            moved[i] += sign * step
            ends.append(function(moved))
        total += ((ends[0] - ends[1]) / (2 * step) * sigma) ** 2
    return float(np.sqrt(total))
