"""Platforms of the textbook (lecture 003), with sizes that callers give or leave at chosen
defaults.

Default lengths, masses and heights are chosen: round numbers of a small indoor robot. Platforms
list every wheel that keeps a rolling row, driven or not; free castors that only carry load are left
out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType

import numpy as np

from trajopt.errors import ArgumentError
from trajopt.robots.platform import Body, Platform, differential_platform, mecanum_platform
from trajopt.robots.wheel import Wheel, WheelKind, fixed_wheel
from trajopt.systems.asoc.modules import AsocGeometry, asoc_platform

RADIUS = 0.10  # m, wheels; chosen
HALF_LENGTH = 0.30  # m, half wheelbase; chosen
HALF_WIDTH = 0.25  # m, half track; chosen
MASS = 30.0  # kg; chosen
COG_HEIGHT = 0.15  # m; chosen
OVERHANG = 0.10  # m, footprint beyond the wheels; chosen


def steered_wheel(x: float, y: float, radius: float, angle: float = 0.0) -> Wheel:
    """Steered wheel at (x, y), m, that now rolls along ``angle`` (rad) in the body frame."""
    alpha = float(np.arctan2(y, x))
    return Wheel(WheelKind.STEERED, float(np.hypot(x, y)), alpha, angle + np.pi / 2 - alpha, radius)


def differential(half_track: float = HALF_WIDTH, radius: float = RADIUS) -> Platform:
    """Differential drive: two fixed wheels on the y axis, and a front castor that carries load."""
    contacts = ((0.0, half_track), (0.0, -half_track), (HALF_LENGTH, 0.0))
    body = _body(contacts, driven=(True, True, False))
    return differential_platform(
        "differential", half_track=half_track, radius=radius, body=body, footprint=_box(contacts)
    )


def bicycle(wheelbase: float = 2 * HALF_LENGTH, radius: float = RADIUS) -> Platform:
    """Fixed rear wheel at the origin, steered front wheel ahead of it."""
    return _platform(
        "bicycle", (fixed_wheel(0.0, 0.0, radius), steered_wheel(wheelbase, 0.0, radius))
    )


def tricycle(
    wheelbase: float = 2 * HALF_LENGTH, half_track: float = HALF_WIDTH, radius: float = RADIUS
) -> Platform:
    """Two fixed rear wheels on the y axis, one steered front wheel."""
    return _platform(
        "tricycle",
        (
            fixed_wheel(0.0, half_track, radius),
            fixed_wheel(0.0, -half_track, radius),
            steered_wheel(wheelbase, 0.0, radius),
        ),
    )


def two_steer(wheelbase: float = 2 * HALF_LENGTH, radius: float = RADIUS) -> Platform:
    """Two steered wheels, front and rear."""
    return _platform(
        "two-steer",
        (steered_wheel(wheelbase / 2, 0.0, radius), steered_wheel(-wheelbase / 2, 0.0, radius)),
    )


def three_omni(distance: float = HALF_LENGTH, radius: float = RADIUS) -> Platform:
    """Three 90 degree Swedish wheels at 0, 120 and 240 deg, each rolling around the centre."""
    wheels = tuple(Wheel(WheelKind.SWEDISH, distance, a, 0.0, radius) for a in _spread(3))
    return _platform("three-omni", wheels)


def four_mecanum(
    half_wheelbase: float = HALF_LENGTH, half_track: float = HALF_WIDTH, radius: float = RADIUS
) -> Platform:
    """Four Mecanum wheels with 45 degree rollers."""
    return mecanum_platform(
        "four-mecanum",
        half_wheelbase=half_wheelbase,
        half_track=half_track,
        radius=radius,
        mass=MASS,
        yaw_inertia=_yaw_inertia(),
        cog_height=COG_HEIGHT,
        overhang=OVERHANG,
    )


def asoc(modules: int = 4) -> Platform:
    """Active split offset casters, sizes of thesis 001's simulation (section 4.3)."""
    return asoc_platform(AsocGeometry(modules=modules))


NAMED: Mapping[str, Callable[[], Platform]] = MappingProxyType(
    {
        "differential": differential,
        "bicycle": bicycle,
        "tricycle": tricycle,
        "two-steer": two_steer,
        "three-omni": three_omni,
        "four-mecanum": four_mecanum,
        "asoc": asoc,
    }
)


def platform_named(name: str) -> Platform:
    """The textbook platform called ``name`` with default sizes. Raises ArgumentError for an unknown
    one."""
    if name not in NAMED:
        raise ArgumentError("platform", name, "one of " + ", ".join(NAMED))
    return NAMED[name]()


def _spread(count: int) -> list[float]:
    return [2 * np.pi * i / count for i in range(count)]


def _yaw_inertia() -> float:
    return MASS * ((2 * HALF_LENGTH) ** 2 + (2 * HALF_WIDTH) ** 2) / 12  # uniform plate, chosen


def _body(contacts: Sequence[tuple[float, float]], driven: Sequence[bool]) -> Body:
    middle = np.mean(np.array(contacts), axis=0)
    return Body(
        MASS,
        _yaw_inertia(),
        (float(middle[0]), float(middle[1]), COG_HEIGHT),
        tuple(contacts),
        (float("nan"),) * len(contacts),
        tuple(driven),
    )


def _box(points: Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    low, high = np.min(points, axis=0) - OVERHANG, np.max(points, axis=0) + OVERHANG
    (x0, y0), (x1, y1) = low.tolist(), high.tolist()
    return ((x1, y1), (x0, y1), (x0, y0), (x1, y0))


def _platform(name: str, wheels: tuple[Wheel, ...]) -> Platform:
    contacts = [w.position for w in wheels]
    holonomic = all(
        w.kind in (WheelKind.SWEDISH, WheelKind.CASTOR, WheelKind.SPHERICAL) for w in wheels
    )
    return Platform(
        name, wheels, _body(contacts, [True] * len(wheels)), _box(contacts), holonomic=holonomic
    )
