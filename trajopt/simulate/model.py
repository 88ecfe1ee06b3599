"""A robot as rigid links and joints, before any physics engine: what every engine builds from.

Frames: each link has its own, in which its shapes, centre of gravity and joint axis are given. The
root's frame is the robot's: x forward, y left, z up, origin on the ground. At joint angle 0 a
link stands in its parent's frame as its joint's ``pose`` says. Lengths m, masses kg, angles rad.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from trajopt.arrays import Array, BoolArray, IntArray

Vector = tuple[float, float, float]
Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Pose:
    """``place`` (m) and attitude: turned by ``pitch`` about y, then by ``yaw`` about z (rad)."""

    place: Vector = (0.0, 0.0, 0.0)
    pitch: float = 0.0
    yaw: float = 0.0

    @classmethod
    def along(cls, axis: Vector, place: Vector = (0.0, 0.0, 0.0)) -> Pose:
        """The pose whose z axis points along ``axis``."""
        x, y, z = axis
        return cls(place, math.atan2(math.hypot(x, y), z), math.atan2(y, x))

    @property
    def quaternion(self) -> tuple[float, float, float, float]:
        """Attitude as (w, x, y, z)."""
        cy, sy = math.cos(self.yaw / 2.0), math.sin(self.yaw / 2.0)
        cp, sp = math.cos(self.pitch / 2.0), math.sin(self.pitch / 2.0)
        return (cy * cp, -sy * sp, cy * sp, sy * cp)

    @property
    def rotation(self) -> Array:
        """(3, 3): columns are the axes of the turned frame."""
        cy, sy = math.cos(self.yaw), math.sin(self.yaw)
        cp, sp = math.cos(self.pitch), math.sin(self.pitch)
        return np.array([[cy * cp, -sy, cy * sp], [sy * cp, cy, sy * sp], [-sp, 0.0, cp]])


@dataclass(frozen=True)
class Shape:
    """A convex solid: ``size`` holds half its extents along its own axes (a sphere's three radii, a
    cylinder's radius twice and half its length along z); a hull has ``corners`` instead. A disc is
    a wheel that touches with its rim: what of these sizes does that best is the engine's choice."""

    kind: Literal["sphere", "cylinder", "disc", "box", "ellipsoid", "hull"]
    size: Vector = (0.0, 0.0, 0.0)
    pose: Pose = Pose()
    corners: tuple[Vector, ...] = ()


def quaternion_of(rotation: Array) -> tuple[float, float, float, float]:
    """(w, x, y, z) of a rotation matrix (3, 3) by less than half a turn."""
    w = math.sqrt(max(1.0 + float(np.trace(rotation)), 0.0)) / 2.0
    if w > 0.1:
        x, y, z = (float(rotation[i, j] - rotation[j, i]) for i, j in ((2, 1), (0, 2), (1, 0)))
        return w, x / (4.0 * w), y / (4.0 * w), z / (4.0 * w)
    k = int(np.argmax(np.diag(rotation)))  # nearly half a turn about an axis near this one
    i, j = (k + 1) % 3, (k + 2) % 3
    part = math.sqrt(1.0 + float(rotation[k, k] - rotation[i, i] - rotation[j, j])) / 2.0
    found = [0.0, 0.0, 0.0]
    found[k], found[i] = part, float(rotation[i, k] + rotation[k, i]) / (4.0 * part)
    found[j] = float(rotation[j, k] + rotation[k, j]) / (4.0 * part)
    return float(rotation[j, i] - rotation[i, j]) / (4.0 * part), *found  # type: ignore[return-value]


def cross(a: Array, b: Array) -> Array:
    """Vector products (n, 3); numpy's own takes ten times as long on a few rows."""
    (ax, ay, az), (bx, by, bz) = a.T, b.T
    return np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)


def sphere(radius: float, place: Vector = (0.0, 0.0, 0.0)) -> Shape:
    return Shape("sphere", (radius, radius, radius), Pose(place))


def cylinder(radius: float, length: float, pose: Pose) -> Shape:
    """``length`` along the z axis of ``pose``."""
    return Shape("cylinder", (radius, radius, length / 2.0), pose)


def prisms(corners: Sequence[tuple[float, float]], low: float, high: float) -> tuple[Shape, ...]:
    """Convex hulls that fill the prism over ``corners`` (x, y, counter-clockwise, no crossing
    edges) from height ``low`` to ``high``."""
    return tuple(
        Shape("hull", corners=tuple((x, y, z) for z in (low, high) for x, y in piece))
        for piece in convex_pieces(corners)
    )


def convex_pieces(corners: Sequence[tuple[float, float]]) -> list[list[tuple[float, float]]]:
    """The polygon itself where it is convex, else triangles that fill it (ears cut off one by
    one)."""
    rest = list(corners)

    def turn(i: int) -> float:
        (ax, ay), (bx, by), (cx, cy) = (rest[(i + k) % len(rest)] for k in (-1, 0, 1))
        return (bx - ax) * (cy - by) - (by - ay) * (cx - bx)

    def is_ear(i: int) -> bool:
        triangle = np.array([rest[(i + k) % len(rest)] for k in (-1, 0, 1)])
        edge = np.roll(triangle, -1, axis=0) - triangle
        away = np.array([p for p in rest if not (triangle == p).all(axis=1).any()])
        rel = away.reshape(-1, 1, 2) - triangle
        inside = (edge[:, 0] * rel[..., 1] - edge[:, 1] * rel[..., 0] >= 0.0).all(axis=1)
        return turn(i) > 0.0 and not inside.any()

    pieces = []
    while len(rest) > 3 and min(turn(i) for i in range(len(rest))) < 0.0:
        ear = next((i for i in range(len(rest)) if is_ear(i)), None)
        if ear is None:
            break  # only slivers are left
        pieces.append([rest[(ear + k) % len(rest)] for k in (-1, 0, 1)])
        del rest[ear]
    return [*pieces, rest]


Role = Literal["fixed", "spin", "steer", "swivel", "roller", "spring", "tilt"]


@dataclass(frozen=True)
class Joint:
    """How a link hangs on its parent: ``pose`` of its frame there, ``axis`` in its own frame.

    Roles: "spin" of a wheel, "steer", "swivel" of a castor, "roller", "spring" (a vertical slide),
    "tilt" of an axle, "fixed". ``drive``: a servo of speed or of position, or a spring towards
    ``rest`` (spring) or a commanded angle (tilt), of ``stiffness`` (N/m, N m/rad); at most
    ``effort`` (N, N m). ``damping`` N s/m or N m s/rad. ``reach``: from, to (m, rad). ``curve``: of a
    wheel's motor, speed (rad/s) and the most torque there (N m) where it drives, and where it
    ``brakes`` too.
    """

    role: Role
    pose: Pose
    axis: Vector = (0.0, 0.0, 1.0)
    drive: Literal["velocity", "position", "spring"] | None = None
    effort: float = math.inf
    stiffness: float = 0.0
    rest: float = 0.0
    damping: float = 0.0
    reach: tuple[float, float] | None = None
    curve: tuple[tuple[float, float], ...] = ()
    brakes: bool = False


@dataclass(frozen=True)
class Link:
    """A rigid body on its ``parent`` (index; -1: the root). ``inertia`` are the principal moments
    (kg m^2) about ``cog``, along the link's axes.

    ``shapes`` meet the ground and steps (``meets`` "ground") or what stands on it ("obstacles");
    pictures show ``looks``. ``grip``: share of the scene's friction. ``wheel``: which wheel of the
    robot's file it belongs to, -1: none.
    """

    name: str
    parent: int
    joint: Joint
    mass: float
    inertia: Vector
    cog: Vector = (0.0, 0.0, 0.0)
    shapes: tuple[Shape, ...] = ()
    meets: Literal["ground", "obstacles"] = "ground"
    looks: tuple[Shape, ...] = ()
    colour: Colour = (0.15, 0.15, 0.15)
    grip: float = 1.0
    wheel: int = -1


@dataclass(frozen=True)
class Model:
    """``links``, root first and parents before children. ``feet``: for each wheel of the file the
    link that turns with it. ``spins`` (W links): the wheels of per-wheel arrays, of which
    ``driven`` have a motor that turns at most at ``top_speed`` (W,), rad/s."""

    name: str
    links: tuple[Link, ...]
    feet: tuple[int, ...]
    spins: tuple[int, ...]
    driven: tuple[bool, ...]
    top_speed: tuple[float, ...]

    def _having(self, *choices: tuple[Role, str | None]) -> tuple[int, ...]:
        return tuple(
            i for i, link in enumerate(self.links) if (link.joint.role, link.joint.drive) in choices
        )

    @cached_property
    def targets(self) -> tuple[int, ...]:
        """Links that follow a commanded angle: steered wheels, then driven axles, each in the
        order of the file."""
        return self._having(("steer", "position")) + self._having(("tilt", "spring"))

    @property
    def target_reach(self) -> list[tuple[float, float]]:
        """From, to (rad) of each of ``targets``."""
        return [self.links[i].joint.reach or (-math.inf, math.inf) for i in self.targets]

    @cached_property
    def swivels(self) -> tuple[int, ...]:
        """Links that turn freely about a vertical axis: castors and pivots."""
        return self._having(("swivel", None))

    @cached_property
    def springs(self) -> tuple[int, ...]:
        """Links on a spring with a fixed rest."""
        return self._having(("spring", "spring"))

    @cached_property
    def suspension(self) -> tuple[int, ...]:
        """Links that give under load: on springs, and axles that tilt."""
        return tuple(i for i, k in enumerate(self.links) if k.joint.role in ("spring", "tilt"))

    @cached_property
    def is_roller(self) -> BoolArray:
        """(links,)."""
        return np.array([link.joint.role == "roller" for link in self.links])

    @cached_property
    def parents(self) -> IntArray:
        """(links,)."""
        return np.array([link.parent for link in self.links])

    @cached_property
    def wheel_of(self) -> IntArray:
        """(links,): the wheel of the file that a link belongs to, -1: none."""
        return np.array([link.wheel for link in self.links])

    @cached_property
    def frames(self) -> tuple[tuple[Array, Array], ...]:
        """Place (3,) and rotation (3, 3) of each link in the robot's frame at joint angles 0."""
        found: list[tuple[Array, Array]] = []
        for link in self.links:
            place, turn = np.array(link.joint.pose.place), link.joint.pose.rotation
            if link.parent >= 0:
                base, frame = found[link.parent]
                place, turn = base + frame @ place, frame @ turn
            found.append((place, turn))
        return tuple(found)

    @cached_property
    def spin_feet(self) -> list[int]:
        """Where in ``feet`` each of ``spins`` is."""
        return [self.feet.index(spin) for spin in self.spins]

    def above(self, link: int) -> list[int]:
        """The links that carry a link, nearest first, the root left out."""
        found, parent = [], self.links[link].parent
        while parent > 0:
            found.append(parent)
            parent = self.links[parent].parent
        return found

    @cached_property
    def _turned(self) -> tuple[tuple[int, ...], IntArray]:
        """Links that turn about a vertical axis, ``targets`` and ``swivels`` in turn, and the link
        among them that each wheel of the file hangs on (A,), -1: none."""
        links = self.targets + self.swivels
        roles = ("steer", "swivel")
        turning = [
            [k for k in self.above(f) if self.links[k].joint.role in roles] for f in self.feet
        ]
        return links, np.array([links.index(found[0]) if found else -1 for found in turning])

    def steering(self, angles: Array, swivels: Array) -> Array:
        """(..., A): steering angle (rad) of each wheel of the file at angles (..., S) of
        ``targets`` and (..., C) of ``swivels``."""
        joints = np.concatenate([angles, swivels, np.zeros((*np.shape(angles)[:-1], 1))], axis=-1)
        return np.asarray(joints[..., self._turned[1]])

    def joints_at(self, steering: Array) -> tuple[Array, Array]:
        """Angles (..., S) of ``targets`` and (..., C) of ``swivels`` at which the file's wheels have
        these ``steering`` angles (..., A); axles that tilt stay level."""
        links, on = self._turned
        found = np.zeros((*np.shape(steering)[:-1], len(links)))
        found[..., on[on >= 0]] = steering[..., on >= 0]
        return found[..., : len(self.targets)], found[..., len(self.targets) :]

    @property
    def mass(self) -> float:
        return sum(link.mass for link in self.links)


def weigh(links: Sequence[Link], frames: Sequence[tuple[Array, Array]]) -> Array:
    """(5,): mass (kg), centre of gravity (m) and moment of inertia about the vertical through it
    (kg m^2) of links that stand at ``frames``."""
    mass = np.array([link.mass for link in links])
    cogs = np.array(
        [at + turn @ np.array(link.cog) for link, (at, turn) in zip(links, frames, strict=True)]
    ).reshape(-1, 3)
    own = [turn[2] ** 2 @ np.array(k.inertia) for k, (_, turn) in zip(links, frames, strict=True)]
    total = max(float(mass.sum()), 1e-300)
    middle = mass @ cogs / total
    apart = np.sum((cogs - middle)[:, :2] ** 2, axis=1)
    return np.array([mass.sum(), *middle, sum(own) + float(mass @ apart)])
