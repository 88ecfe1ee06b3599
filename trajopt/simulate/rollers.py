"""Wheels as lists of rollers: pure geometry that every physics engine builds from.

Wheel frame: origin at the wheel centre, x forward, y along the axle to the left, z up, wheel angle
0. A positive wheel angle turns about +y (the top moves forward, the wheel drives forward). A place
on the rim is named by its normal angle ``phi``: the outward normal is ``m(phi) = (-sin phi, 0, -cos
phi)``, so ``phi = 0`` is the ground contact of a wheel at angle 0, and the place ``phi`` reaches
the ground when the wheel has turned by ``-phi``.

The envelope of the rollers must be the rim outline, whose support function (distance of the tangent
line from the axle) is ``h(phi)``. A sphere centred at ``p = c + s a`` on a roller's axis touches
the outline from inside exactly when its radius is ``min over phi of [h(phi) - p . m(phi)]``; the
union of these spheres is the exact barrel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError

Vector = tuple[float, float, float]
Support = Callable[[Array], Array]
Shape = Literal["spheres", "barrel", "ellipsoid", "cylinder", "cone"]
SHAPES: tuple[Shape, ...] = get_args(Shape)

# Normal angles on which the inscribed radius is minimised before a parabola refines it [-] (chosen:
# the error is below 1e-8 m for a wheel of 0.1 m).
ENVELOPE_SAMPLES = 1440
# Places on a roller's axis, and their reach either way [m], among which its stations are
# interpolated (chosen: 1 mm apart; the reach exceeds half of any usual roller of a wheel below 0.25
# m radius).
AXIS_SAMPLES, AXIS_REACH = 241, 0.12
# Points along the axis of a barrel's profile [-] (chosen: sagitta below 0.01 mm on a 40 mm roller).
BARREL_STATIONS = 13
# Corners around a solid of revolution [-]. Measured on the LOC8 over 5 m lateral: 24 corners lose
# 3-12 %, 48 lose 1.5-8 %, 96 lose 1-4 % (Bullet the lower, MuJoCo the upper end).
SIDES = 96
# Ratio of the two end radii of a truncated-cone roller [-] (chosen; the thesis prints no sizes).
CONE_RATIO = 0.6
# Mass of one roller [kg] (chosen: below 10 g the contact solver of Bullet loses accuracy).
ROLLER_MASS = 0.02


@dataclass(frozen=True)
class SphereChain:
    """Spheres of ``radii`` [m] centred on the roller axis at ``stations`` [m] from its centre."""

    stations: tuple[float, ...]
    radii: tuple[float, ...]


@dataclass(frozen=True)
class Revolved:
    """A convex solid of revolution: ``radii`` [m] at ``stations`` [m], straight lines in
    between."""

    stations: tuple[float, ...]
    radii: tuple[float, ...]


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid of revolution with equatorial ``radius`` and ``half_length`` along the axis
    [m]."""

    radius: float
    half_length: float


def is_cylinder(profile: Revolved) -> bool:
    """Whether engines may use their own cylinder."""
    return len(profile.radii) == 2 and profile.radii[0] == profile.radii[1]


Profile = SphereChain | Revolved | Ellipsoid


@dataclass(frozen=True)
class Roller:
    """One passive roller in the wheel frame: ``centre`` [m], unit ``axis``, and its ``profile``."""

    centre: Vector
    axis: Vector
    profile: Profile


@dataclass(frozen=True)
class RollerWheel:
    """A wheel made of passive rollers on a hub.

    ``radius`` [m] is the rolling radius on flat ground, ``width`` [m] the extent along the axle,
    ``angle`` [rad] the direction of the roller axis that touches the ground, measured from x
    towards y. ``hub_mass`` [kg] excludes the rollers, ``roller_mass`` [kg] is that of one roller.
    """

    radius: float
    width: float
    angle: float
    rollers: tuple[Roller, ...]
    hub_mass: float
    roller_mass: float

    @property
    def mass(self) -> float:
        """Mass of hub and rollers [kg]."""
        return self.hub_mass + len(self.rollers) * self.roller_mass


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
    rim = normals(
        phi
    )  # without a y component; products by hand are faster here than a matrix product
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


@dataclass(frozen=True)
class Seat:
    """Where one roller sits: it touches the outline at the normal angle ``phi`` and serves
    ``sector``.

    ``sector`` (low, high) holds normal angles [rad], ``radius`` [m] the roller radius at ``phi``,
    ``angle`` [rad] the inclination of the axis to the direction of travel, ``offset`` [m] the place
    of the roller's centre along the axle.
    """

    phi: float
    sector: tuple[float, float]
    radius: float
    angle: float
    offset: float = 0.0


def place_roller(
    seat: Seat, support: Support, *, shape: Shape = "spheres", spheres: int = 7
) -> Roller:
    """Roller at ``seat`` with the profile that makes the rim envelope (or the named rough shape).

    ``spheres`` is the number of spheres of a chain. Raises ArgumentError for an unknown shape, for
    fewer than one sphere and for a roller that does not fit inside the outline.
    """
    if shape not in SHAPES:
        raise ArgumentError("shape", shape, "one of " + ", ".join(SHAPES))
    if spheres < 1:
        raise ArgumentError("spheres", spheres, "at least 1 sphere a roller")
    at = np.array(seat.phi)
    centre = outline_point(seat.phi, support) - seat.radius * normals(at)
    axis = math.cos(seat.angle) * tangents(at) + np.array([0.0, math.sin(seat.angle), 0.0])
    stations = _stations_for(_aims(seat, spheres), centre, axis, seat, support)
    profile: Profile
    if shape == "spheres":
        middle = stations[1:-1]
        radii, _ = inscribed(centre + middle[:, None] * axis, support)
        profile = SphereChain(_floats(middle), _floats(radii))
    elif shape == "barrel":
        profile = _barrel(centre, axis, support, (float(stations[0]), float(stations[-1])))
    elif shape == "ellipsoid":
        profile = _ellipsoid(centre, axis, seat, support)
    else:
        # a cone keeps the nominal radius in its middle, where it touches the outline
        ratio = CONE_RATIO if shape == "cone" else 1.0
        thick = 2.0 * seat.radius / (1.0 + ratio)
        profile = Revolved((float(stations[0]), float(stations[-1])), (thick, ratio * thick))
    return Roller(_vector(centre + np.array([0.0, seat.offset, 0.0])), _vector(axis), profile)


def _aims(seat: Seat, spheres: int) -> Array:
    """Normal angles that stations must touch: sector end, one a sphere at even spacing, sector
    end."""
    low, high = seat.sector
    inner = high - (np.arange(spheres) + 0.5) / spheres * (high - low)
    return np.concatenate([[high], inner, [low]])


def _stations_for(aims: Array, centre: Array, axis: Array, seat: Seat, support: Support) -> Array:
    """Stations [m] on the roller axis whose inscribed spheres touch the outline at normal angles
    ``aims``."""
    grid = np.linspace(-AXIS_REACH, AXIS_REACH, AXIS_SAMPLES)
    radii, touched = inscribed(centre + grid[:, None] * axis, support)
    middle = len(grid) // 2
    outside = np.flatnonzero(radii <= 0.0)
    low = int(outside[outside < middle].max(initial=-1)) + 1
    high = int(outside[outside > middle].min(initial=len(grid)))
    if radii[middle] < seat.radius - 1e-6 or high - low < 3:
        raise ArgumentError(
            "roller_radius", seat.radius, "a radius that fits inside the rim outline"
        )
    # m' = -t: the touched normal angle falls along the axis, np.interp wants it rising
    angles = np.unwrap(touched[low:high])
    angles += 2.0 * math.pi * round((seat.phi - float(angles[middle - low])) / (2.0 * math.pi))
    if aims.max() > angles[0] + 1e-6 or aims.min() < angles[-1] - 1e-6:
        raise ArgumentError(
            "rollers", seat.sector, "more rollers: one straight roller cannot serve this sector"
        )
    stations: Array = np.interp(aims, angles[::-1], grid[low:high][::-1])
    return stations


def _barrel(centre: Array, axis: Array, support: Support, ends: tuple[float, float]) -> Revolved:
    """Canal surface of the inscribed spheres, touched at ``s - r r'`` with radius ``r sqrt(1 -
    r'^2)``."""
    step = 2e-4  # m; long enough to keep the noise of the minimum out of the derivative
    span = np.linspace(ends[0], ends[1], BARREL_STATIONS)
    before, here, after = (
        inscribed(centre + (span + shift)[:, None] * axis, support)[0]
        for shift in (-step, 0.0, step)
    )
    slope = (after - before) / (2.0 * step)
    return Revolved(_floats(span - here * slope), _floats(here * np.sqrt(1.0 - slope**2)))


def _ellipsoid(centre: Array, axis: Array, seat: Seat, support: Support) -> Ellipsoid:
    """Longest ellipsoid of revolution that touches the outline at ``seat.phi`` and stays inside it.

    Its support function is c . m + sqrt(r^2 + (l^2 - r^2) (a . m)^2) <= h for every normal m. On a
    circle of radius R the bound is tightest beside the seat: l^2 = r^2 + r (R - r)/cos^2(angle),
    from the curvatures.
    """
    phi = np.linspace(-math.pi, math.pi, ENVELOPE_SAMPLES, endpoint=False)
    lean = normals(phi) @ axis
    beside = np.abs(lean) > 0.02  # nearer to the seat the quotient below is 0/0
    room = support(phi[beside]) - normals(phi[beside]) @ centre
    bounds = seat.radius**2 + (room**2 - seat.radius**2) / lean[beside] ** 2
    return Ellipsoid(seat.radius, math.sqrt(max(float(np.min(bounds)), seat.radius**2)))


def _floats(values: Array) -> tuple[float, ...]:
    return tuple(float(value) for value in values)


def _vector(values: Array) -> Vector:
    return (float(values[0]), float(values[1]), float(values[2]))


def mecanum_wheel(
    radius: float,
    *,
    rollers: int = 18,
    roller_radius: float = 0.0095,
    angle: float = math.radians(-45.0),
    shape: Shape = "spheres",
    spheres: int = 5,
    mass: float = 1.44,
    roller_mass: float = ROLLER_MASS,
) -> RollerWheel:
    """Mecanum wheel: ``rollers`` equal rollers around a circular rim of ``radius`` [m].

    ``angle`` [rad] is the axis of the roller on the ground, from x towards y: -45 deg at front-left
    and rear-right, +45 deg at the others. ``mass`` [kg] is that of the whole wheel. 18 rollers of
    9.5 mm and 5 spheres: measured settings for pybullet. Raises ArgumentError naming the size that
    cannot be built.
    """
    require_wheel(radius, roller_radius, angle, mass - rollers * roller_mass, roller_mass)
    if rollers < 3:
        raise ArgumentError(
            "rollers", rollers, "at least 3 rollers a wheel (12 or more roll smoothly)"
        )

    def circle(phi: Array) -> Array:
        return np.full_like(phi, radius)

    pitch = 2.0 * math.pi / rollers
    first = Seat(0.0, (-pitch / 2.0, pitch / 2.0), roller_radius, angle)
    model = place_roller(first, circle, shape=shape, spheres=spheres)
    placed = tuple(turned(model, index * pitch) for index in range(rollers))
    width = 2.0 * (reach_along_axle(placed))
    return RollerWheel(radius, width, angle, placed, mass - rollers * roller_mass, roller_mass)


def require_wheel(
    radius: float, roller_radius: float, angle: float, hub_mass: float, roller_mass: float
) -> None:
    """Raise ArgumentError for sizes that make no wheel (all lengths in m, masses in kg, angle in
    rad)."""
    if not (math.isfinite(radius) and 0.0 < radius < 0.25):
        raise ArgumentError("radius", radius, "a wheel radius between 0 and 0.25 m")
    if not (math.isfinite(roller_radius) and 0.0 < roller_radius < radius / 2.0):
        raise ArgumentError(
            "roller_radius", roller_radius, "a radius from 0 to half the wheel radius, in m"
        )
    if not (math.isfinite(angle) and 0.0 < abs(angle) < math.radians(80.0)):
        raise ArgumentError(
            "angle", angle, "a roller inclination between 0 and 80 deg either way, in rad"
        )
    if not (math.isfinite(roller_mass) and roller_mass >= 0.01):
        raise ArgumentError(
            "roller_mass", roller_mass, "at least 0.01 kg (lighter ones upset contact solvers)"
        )
    if not (math.isfinite(hub_mass) and hub_mass > 0.0):
        raise ArgumentError(
            "mass", hub_mass, "a wheel heavier than its rollers, in kg (the rest is the hub)"
        )


def turned(roller: Roller, phi: float) -> Roller:
    """The same roller, carried around the axle so that its normal angle grows by ``phi`` [rad]."""
    cosine, sine = math.cos(phi), math.sin(phi)

    def turn(v: Vector) -> Vector:
        return (cosine * v[0] + sine * v[2], v[1], -sine * v[0] + cosine * v[2])

    return Roller(turn(roller.centre), turn(roller.axis), roller.profile)


def reach_along_axle(rollers: tuple[Roller, ...]) -> float:
    """Largest distance [m] of any roller from the wheel's middle plane."""
    return max(max(abs(low), abs(high)) for low, high in map(_extent_along_axle, rollers))


def _extent_along_axle(roller: Roller) -> tuple[float, float]:
    lean = roller.axis[1]
    profile = roller.profile
    if isinstance(profile, Ellipsoid):
        half = math.hypot(profile.half_length * lean, profile.radius * math.sqrt(1.0 - lean**2))
        return roller.centre[1] - half, roller.centre[1] + half
    upright = 1.0 if isinstance(profile, SphereChain) else math.sqrt(1.0 - lean**2)
    pairs = list(zip(profile.stations, profile.radii, strict=True))
    low = min(station * lean - radius * upright for station, radius in pairs)
    high = max(station * lean + radius * upright for station, radius in pairs)
    return roller.centre[1] + low, roller.centre[1] + high


def support_height(wheel: RollerWheel, phi: Array) -> Array:
    """Distance [m] from the axle down to the lowest point of the rollers when the place ``phi`` is
    down.

    ``phi`` (K,) -> (K,): the support function of what was built, to be compared with the outline's.
    """
    down = normals(phi)
    best = np.full(phi.shape, -np.inf)
    for roller in wheel.rollers:
        centre = down @ np.array(roller.centre)
        lean = down @ np.array(roller.axis)
        profile = roller.profile
        if isinstance(profile, Ellipsoid):
            swell = np.sqrt(profile.radius**2 * (1.0 - lean**2) + (profile.half_length * lean) ** 2)
            best = np.maximum(best, centre + swell)
            continue
        upright = np.ones_like(lean) if isinstance(profile, SphereChain) else np.sqrt(1.0 - lean**2)
        for station, radius in zip(profile.stations, profile.radii, strict=True):
            best = np.maximum(best, centre + station * lean + radius * upright)
    return best


def revolve(profile: Revolved, *, sides: int = SIDES, shrink: float = 0.0) -> Array:
    """Vertices (V, 3) of the solid of revolution about z; ``shrink`` [m] is taken off all round.

    Engines that add a margin to convex hulls get their nominal surface back by shrinking first.
    """
    around = np.arange(sides) * (2.0 * math.pi / sides)
    rings = []
    last = len(profile.stations) - 1
    for index, (station, radius) in enumerate(zip(profile.stations, profile.radii, strict=True)):
        along = station + (shrink if index == 0 else -shrink if index == last else 0.0)
        slim = max(radius - shrink, 1e-5)
        rings.append(
            np.stack([slim * np.cos(around), slim * np.sin(around), np.full(sides, along)], axis=1)
        )
    return np.concatenate(rings)


def disc_inertia(mass: float, radius: float, length: float) -> tuple[float, float]:
    """Moments of a solid cylinder (about its axis, across it) [kg m^2]."""
    return mass * radius**2 / 2.0, mass * (3.0 * radius**2 + length**2) / 12.0


def hub_drum(wheel: RollerWheel) -> Revolved:
    """What pictures show of a hub: a drum about the axle, slim enough for the ellipse of an SMDW
    hub."""
    half = 0.4 * wheel.width
    return Revolved((-half, half), (0.35 * wheel.radius, 0.35 * wheel.radius))


def roller_size(roller: Roller) -> tuple[float, float]:
    """Radius and length [m] of the cylinder whose inertia the roller gets."""
    profile = roller.profile
    if isinstance(profile, Ellipsoid):
        # an ellipsoid stands for a barrel that is cut off at half its length
        return profile.radius, profile.half_length
    return max(profile.radii), max(profile.stations) - min(profile.stations) + max(profile.radii)
