"""Passive rollers around a rim: pure geometry, and the links of a wheel made of them.

Wheel frame: origin at the wheel centre, x forward, y along the axle to the left, z up, wheel angle
0. A positive wheel angle turns about +y (the top moves forward, the wheel drives forward). A place
on the rim is named by its normal angle ``phi``: the outward normal is ``m(phi) = (-sin phi, 0, -cos
phi)``, so ``phi = 0`` is the ground contact of a wheel at angle 0, and the place ``phi`` reaches
the ground when the wheel has turned by ``-phi``.

The envelope of the rollers must be the rim outline, whose support function (distance of the tangent
line from the axle) is ``h(phi)``. A sphere centred at ``p = c + s a`` on a roller's axis touches
the outline from inside exactly when its radius is ``min over phi of [h(phi) - p . m(phi)]``; the
union of these spheres is the exact barrel. This holds for every inclination of the axis, also for
one along the rim (omni wheels, which then need a single row).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.robots.description import RollerSection, WheelSection
from trajopt.simulate.looks import plate
from trajopt.simulate.model import Joint, Link, Pose, Shape, Vector, cylinder, sphere

Support = Callable[[Array], Array]

# Normal angles on which the inscribed radius is minimised before a parabola refines it [-] (chosen:
# the error is below 1e-8 m for a wheel of 0.1 m).
ENVELOPE_SAMPLES = 1440
# Places on a roller's axis, and their reach either way in wheel radii, among which its stations are
# interpolated (chosen: 1 mm apart on a wheel of 0.1 m; longer than half of any roller).
AXIS_SAMPLES, AXIS_REACH = 241, 1.2
# Points along the axis of a barrel's profile [-] (chosen: sagitta below 0.01 mm on a 40 mm roller).
BARREL_STATIONS = 13
# Corners around a solid of revolution [-]. Measured on a Mecanum robot over 5 m lateral: 24 corners
# lose 3-12 %, 48 lose 1.5-8 %, 96 lose 1-4 % (Bullet the lower, MuJoCo the upper end).
SIDES = 96
# Ratio of the two end radii of a truncated-cone roller [-] (chosen; the thesis prints no sizes).
CONE_RATIO = 0.6
ROLLER_COLOURS = ((0.15, 0.15, 0.15), (0.85, 0.45, 0.1))  # every other: turning shows in pictures
HUB_COLOUR = (0.7, 0.7, 0.72)


@dataclass(frozen=True)
class Roller:
    """One passive roller in the wheel frame: ``centre`` (m), unit ``axis``, ``shapes`` in a frame
    whose z is the axis, and ``radius`` and ``length`` (m) of the cylinder whose inertia it has."""

    centre: Vector
    axis: Vector
    shapes: tuple[Shape, ...]
    radius: float
    length: float


@dataclass(frozen=True)
class Seat:
    """Where one roller sits: it touches the outline at the normal angle ``phi`` and serves
    ``sector`` (low, high, normal angles, rad)."""

    phi: float
    sector: tuple[float, float]


def normals(phi: Array) -> Array:
    """Outward rim normals ``m(phi)``, shape ``(..., 3)``."""
    return np.stack([-np.sin(phi), np.zeros_like(phi), -np.cos(phi)], axis=-1)


def tangents(phi: Array) -> Array:
    """Rim tangents, the forward direction of the hub frame turned to ``phi``, shape ``(...,
    3)``."""
    return np.stack([np.cos(phi), np.zeros_like(phi), -np.sin(phi)], axis=-1)


def inscribed(points: Array, support: Support) -> tuple[Array, Array]:
    """Largest spheres at ``points`` (K, 3) inside the outline: radii (K,) and normal angles touched
    (K,).

    Minimum of ``h(phi) - p . m(phi)`` on a grid, refined by the parabola through its neighbours.
    """
    phi = np.linspace(-math.pi, math.pi, ENVELOPE_SAMPLES, endpoint=False)
    rim = normals(phi)  # no y component; products by hand are faster than a matrix product
    gaps = support(phi) - points[:, :1] * rim[:, 0] - points[:, 2:] * rim[:, 2]
    rows = np.arange(len(points))
    nearest = np.argmin(gaps, axis=1)
    left = gaps[rows, nearest - 1]
    here = gaps[rows, nearest]
    right = gaps[rows, (nearest + 1) % ENVELOPE_SAMPLES]
    bend = np.maximum(left - 2.0 * here + right, 1e-300)
    shift = np.clip(0.5 * (left - right) / bend, -0.5, 0.5)
    radii: Array = here - 0.25 * (left - right) * shift
    touched: Array = phi[nearest] + shift * (2.0 * math.pi / ENVELOPE_SAMPLES)
    return radii, touched


def outline_point(phi: float, support: Support) -> Array:
    """Point (3,) of the outline whose outward normal has the angle ``phi``: ``h m + h' m'``."""
    step = 1e-5  # rad; the error of the central difference is about h * step^2 = 1e-11 m
    around = support(np.array([phi - step, phi, phi + step]))
    slope = (around[2] - around[0]) / (2.0 * step)
    at = np.array(phi)
    point: Array = around[1] * normals(at) - slope * tangents(at)
    return point


def place_roller(seat: Seat, support: Support, section: RollerSection, radius: float) -> Roller:
    """Roller of ``radius`` (m) at ``seat`` whose shape makes the rim envelope (or is the named
    rough one). Raises ArgumentError for a roller that does not fit inside the outline or cannot
    serve its sector."""
    at = np.array(seat.phi)
    centre = outline_point(seat.phi, support) - radius * normals(at)
    axis = math.cos(section.angle) * tangents(at) + np.array([0.0, math.sin(section.angle), 0.0])
    stations = _stations(seat, section.spheres, centre, axis, support, radius)
    ends = (float(stations[0]), float(stations[-1]))
    span = ends[1] - ends[0]
    if section.shape == "spheres":
        middle = stations[1:-1]
        radii, _ = inscribed(centre + middle[:, None] * axis, support)
        shapes = tuple(
            sphere(r, (0.0, 0.0, s)) for s, r in zip(middle.tolist(), radii.tolist(), strict=True)
        )
        radius, span = float(radii.max()), float(middle[-1] - middle[0] + radii.max())
    elif section.shape == "barrel":
        shapes = (_barrel(centre, axis, support, ends),)
    elif section.shape == "ellipsoid":
        half = _ellipsoid(centre, axis, support, radius)
        # an ellipsoid stands for a barrel that is cut off at half its length
        shapes, span = (Shape("ellipsoid", (radius, radius, half)),), half
    elif section.shape == "cylinder":
        shapes = (cylinder(radius, span, Pose((0.0, 0.0, sum(ends) / 2.0))),)
    else:
        # a cone keeps the nominal radius in its middle, where it touches the outline
        thick = 2.0 * radius / (1.0 + CONE_RATIO)
        shapes = (revolve(np.array(ends), np.array([thick, CONE_RATIO * thick])),)
    return Roller(_vector(centre), _vector(axis), shapes, radius, span)


def _stations(
    seat: Seat,
    spheres: int,
    centre: Array,
    axis: Array,
    support: Support,
    radius: float,
) -> Array:
    """Stations (m) on the roller axis whose inscribed spheres touch the outline at the sector's
    end, once a sphere at even spacing, and at the sector's other end."""
    low, high = seat.sector
    inner = high - (np.arange(spheres) + 0.5) / spheres * (high - low)
    aims = np.concatenate([[high], inner, [low]])
    reach = AXIS_REACH * float(support(np.array([0.0, math.pi / 2.0, math.pi])).max())
    grid = np.linspace(-reach, reach, AXIS_SAMPLES)
    radii, touched = inscribed(centre + grid[:, None] * axis, support)
    middle = len(grid) // 2
    outside = np.flatnonzero(radii <= 0.0)
    first = int(outside[outside < middle].max(initial=-1)) + 1
    last = int(outside[outside > middle].min(initial=len(grid)))
    if radii[middle] < radius - 1e-6 or last - first < 3 or radius > reach / AXIS_REACH / 2.0:
        expected = "a radius that fits inside the rim outline, at most half the wheel's"
        raise ArgumentError("radius", radius, expected)
    # m' = -t: the touched normal angle falls along the axis, np.interp wants it rising
    angles = np.unwrap(touched[first:last])
    angles += 2.0 * math.pi * round((seat.phi - float(angles[middle - first])) / (2.0 * math.pi))
    if aims.max() > angles[0] + 1e-6 or aims.min() < angles[-1] - 1e-6:
        raise ArgumentError(
            "count",
            f"a roller for {math.degrees(high - low):.3g} deg",
            "more rollers, or thicker ones: one straight roller cannot serve this sector",
        )
    stations: Array = np.interp(aims, angles[::-1], grid[first:last][::-1])
    return stations


def _barrel(centre: Array, axis: Array, support: Support, ends: tuple[float, float]) -> Shape:
    """Canal surface of the inscribed spheres, touched at ``s - r r'`` with radius ``r sqrt(1 -
    r'^2)``."""
    step = 2e-4  # m; long enough to keep the noise of the minimum out of the derivative
    span = np.linspace(ends[0], ends[1], BARREL_STATIONS)
    before, here, after = (
        inscribed(centre + (span + shift)[:, None] * axis, support)[0]
        for shift in (-step, 0.0, step)
    )
    slope = (after - before) / (2.0 * step)
    return revolve(span - here * slope, here * np.sqrt(1.0 - slope**2))


def _ellipsoid(centre: Array, axis: Array, support: Support, radius: float) -> float:
    """Half length (m) of the longest ellipsoid of revolution that touches the outline at the seat
    and stays inside it.

    Its support function is c . m + sqrt(r^2 + (l^2 - r^2) (a . m)^2) <= h for every normal m. On a
    circle of radius R the bound is tightest beside the seat: l^2 = r^2 + r (R - r)/cos^2(angle),
    from the curvatures.
    """
    phi = np.linspace(-math.pi, math.pi, ENVELOPE_SAMPLES, endpoint=False)
    lean = normals(phi) @ axis
    beside = np.abs(lean) > 0.02  # nearer to the seat the quotient below is 0/0
    room = support(phi[beside]) - normals(phi[beside]) @ centre
    bounds = radius**2 + (room**2 - radius**2) / lean[beside] ** 2
    return math.sqrt(max(float(np.min(bounds)), radius**2))


def revolve(stations: Array, radii: Array, *, sides: int = SIDES) -> Shape:
    """Convex hull of the solid of revolution about z with ``radii`` (m) at ``stations`` (m)."""
    around = np.arange(sides) * (2.0 * math.pi / sides)
    rings = [
        np.column_stack([r * np.cos(around), r * np.sin(around), np.full(sides, s)])
        for s, r in zip(stations, radii, strict=True)
    ]
    return Shape("hull", corners=tuple(_vector(point) for point in np.concatenate(rings)))


def _vector(values: Array) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))


def turned(roller: Roller, phi: float) -> Roller:
    """The same roller, carried around the axle so that its normal angle grows by ``phi`` [rad]."""
    cosine, sine = math.cos(phi), math.sin(phi)

    def turn(v: Vector) -> Vector:
        return (cosine * v[0] + sine * v[2], v[1], -sine * v[0] + cosine * v[2])

    return replace(roller, centre=turn(roller.centre), axis=turn(roller.axis))


def ring(wheel: WheelSection, section: RollerSection) -> tuple[Roller, ...]:
    """Equal rollers around a circular rim. 18 of 9.5 mm with 5 spheres on a wheel of 0.1 m:
    measured settings for pybullet; 12 or more roll smoothly."""

    def circle(phi: Array) -> Array:
        return np.full_like(phi, wheel.radius)

    pitch = 2.0 * math.pi / section.count
    first = place_roller(Seat(0.0, (-pitch / 2.0, pitch / 2.0)), circle, section, section.radius)
    return tuple(turned(first, index * pitch) for index in range(section.count))


def disc_inertia(mass: float, radius: float, length: float) -> tuple[float, float]:
    """Moments of a solid cylinder (about its axis, across it) [kg m^2]."""
    return mass * radius**2 / 2.0, mass * (3.0 * radius**2 + length**2) / 12.0


def roller_wheel(
    wheel: WheelSection,
    section: RollerSection,
    rollers: tuple[Roller, ...],
    spin: Joint,
    parent: int,
    number: int,
) -> list[Link]:
    """Links of a wheel whose ``rollers`` touch the ground: a hub that ``spin`` carries on
    ``parent``, without shapes of its own, and the rollers. ``number``: how many links there are
    already. Raises ArgumentError for rollers that outweigh the wheel."""
    hub_mass = wheel.mass - len(rollers) * section.mass
    if not hub_mass > 0.0:
        raise ArgumentError(
            "rollers.mass", section.mass, f"{len(rollers)} rollers that weigh less than the wheel"
        )
    about, across = disc_inertia(hub_mass, 0.8 * wheel.radius, wheel.width)
    inner = min(math.hypot(roller.centre[0], roller.centre[2]) for roller in rollers)
    links = [
        Link(
            wheel.name, parent, spin, hub_mass, (across, about, across), looks=plate(inner, wheel.width),
            colour=HUB_COLOUR,
        )
    ]  # fmt: skip
    for index, roller in enumerate(rollers):
        about, across = disc_inertia(section.mass, roller.radius, roller.length)
        links.append(
            Link(
                f"{wheel.name}/{index}",
                number,
                Joint("roller", Pose.along(roller.axis, roller.centre)),
                section.mass,
                (across, across, about),
                shapes=roller.shapes,
                looks=roller.shapes,
                colour=ROLLER_COLOURS[index % 2],
            )
        )
    return links
