"""Rigid parts on joints, as URDF and MJCF describe robots: what both readers make.

Each part has a frame, in which its joint's axis, centre of gravity and solids are given. Lengths m,
masses kg, angles rad.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from trajopt.arrays import Array


@dataclass(frozen=True, eq=False)
class Solid:
    """``half``: half extents along its own axes (a cylinder's and a sphere's radius twice; a
    cylinder lies along z); None for a mesh that was not read."""

    kind: Literal["sphere", "cylinder", "box", "mesh"]
    half: Array | None
    place: Array  # (3,)
    turn: Array  # (3, 3)


@dataclass(frozen=True, eq=False)
class Part:
    """A link and the joint that hangs it on its ``parent`` (index, -1: the root).

    At joint angle 0 it stands at ``place``, turned by ``turn``, in the parent's frame. ``reach``:
    from, to, None without an end. ``driven``: something moves the joint, with at most ``effort``
    (N m) and ``speed`` (rad/s); None: not said.
    """

    name: str
    parent: int
    joint: str
    moves: Literal["fixed", "turning", "sliding"]
    place: Array
    turn: Array
    axis: Array  # (3,), in its own frame
    anchor: Array  # (3,), a point on the axis
    reach: tuple[float, float] | None
    driven: bool
    effort: float | None
    speed: float | None
    mass: float
    cog: Array  # (3,)
    inertia: Array  # (3, 3) about cog, along the frame's axes
    solids: tuple[Solid, ...]


Frames = list[
    tuple[Array, Array]
]  # place (3,) and rotation (3, 3) of each part in the root's frame


def frames(parts: Sequence[Part], turned: Collection[int] = ()) -> Frames:
    """Frames at joint angles 0, but for ``turned`` joints, which are at half a turn."""
    found: Frames = []
    for i, part in enumerate(parts):
        place, turn = part.place, part.turn
        if part.parent >= 0:
            base, frame = found[part.parent]
            place, turn = base + frame @ place, frame @ turn
        if i in turned:
            half = turn @ (2.0 * np.outer(part.axis, part.axis) - np.eye(3))
            place = place + turn @ part.anchor - half @ part.anchor
            turn = half
        found.append((place, turn))
    return found


def weighed(parts: Sequence[Part], at: Frames) -> Array:
    """(5,): mass (kg), mass times centre of gravity (kg m), and moment of inertia about the root's
    z axis (kg m^2)."""
    total = np.zeros(5)
    for part, (place, turn) in zip(parts, at, strict=True):
        cog = place + turn @ part.cog
        own = float(turn[2] @ part.inertia @ turn[2])
        total += [part.mass, *(part.mass * cog), own + part.mass * float(cog[:2] @ cog[:2])]
    return total


def extent(solid: Solid, place: Array, turn: Array) -> Array:
    """(2, 3): corners of the box around a solid on a part that stands there."""
    assert solid.half is not None
    middle, axes = place + turn @ solid.place, turn @ solid.turn
    if solid.kind == "sphere":
        reach = solid.half
    elif solid.kind == "cylinder":
        reach = solid.half[0] * np.hypot(axes[:, 0], axes[:, 1]) + solid.half[2] * abs(axes[:, 2])
    else:
        reach = np.abs(axes) @ solid.half
    return np.array([middle - reach, middle + reach])


def below(parts: Sequence[Part], top: int) -> list[int]:
    """A part and all that hang on it."""
    found = [top]
    for i, part in enumerate(parts):
        if part.parent in found:
            found.append(i)
    return found
