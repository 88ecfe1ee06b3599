"""From rigid parts on joints to a robot's description: what is there is read, what is missing is
asked for by name.

The description's origin is the middle of the axle of the fixed wheels, or the middle of all
wheels, on the ground; the axes are those of the file's root.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.formats.asked import require_all, require_radii
from trajopt.formats.tree import Frames, Part, Solid, below, extent, frames, weighed
from trajopt.robots.robot import Robot
from trajopt.schema import changes_of, set_key

_LEVEL = 0.02  # rad that an axle may lean from level, an upright axis from upright; chosen
_ASIDE = 0.02  # of its radius that a steered wheel may stand beside its axis; chosen
_UNEVEN = 0.005  # m by which wheels may differ in where they touch the ground; chosen
_ROUND = 1e-4  # rad, chosen: files round pi / 2; angles this near to such multiples mean them


@dataclass(frozen=True, eq=False)
class _Wheel:
    """A wheel as the file has it: ``table`` without position, ``centre`` and ``pivot`` in the
    root's frame; ``top``: the part that turns with its steering, ``swivels``: it is a castor,
    ``beside``: it is steered and does not stand on its axis."""

    table: dict[str, Any]
    centre: Array
    pivot: Array
    part: int
    top: int
    swivels: bool
    beside: bool = False


def described(
    parts: Sequence[Part], joints: Sequence[str], changes: Mapping[str, Any], file: Path
) -> Robot:
    """The robot whose wheels turn about ``joints``, with changed keys. Raises ProblemError with the
    keys that neither say, ArgumentError for joints that make no wheel."""
    if not joints or len(set(joints)) < len(joints):
        raise ArgumentError(
            "--wheels", list(joints), "the joints that wheels turn about, each once"
        )
    at = frames(parts)
    wheels = [_wheel(parts, at, name) for name in joints]
    tables = _tables(parts, at, wheels, dict(changes), file)
    places = {f"wheels.{w['name']}.position": w.pop("beside", None) for w in tables["wheels"]}
    for key, value in changes_of(changes, str(file)):
        set_key(tables, key, value, str(file))
    require_all(tables, changes, places, file)
    return Robot.of(tables, str(file))


def _wheel(parts: Sequence[Part], at: Frames, joint: str) -> _Wheel:
    numbers = [i for i, part in enumerate(parts) if part.joint == joint]
    if not numbers:
        turning = [part.joint for part in parts if part.moves == "turning"]
        raise ArgumentError("--wheels", joint, "joints among " + (", ".join(turning) or "none"))
    number = numbers[0]
    part, turn = parts[number], at[number][1]
    solid, middle = _round_solid(parts, at, number)
    table: dict[str, Any] = {
        "name": joint,
        "mass": sum(parts[i].mass for i in below(parts, number)),
    }
    if solid is not None and solid.half is not None:
        table["radius"] = float(solid.half[0])
    if part.moves == "fixed":
        if solid is None or solid.kind != "sphere":
            raise ArgumentError("--wheels", joint, "a joint that turns, or one that fixes a ball")
        table |= {"kind": "spherical", "width": 2.0 * table["radius"]}
        return _Wheel(table, middle, middle, number, number, False)
    axis = turn @ part.axis
    if part.moves != "turning" or abs(axis[2]) > _LEVEL:
        raise ArgumentError("--wheels", joint, "a joint that turns about a level axle")
    if solid is not None and solid.kind == "cylinder" and solid.half is not None:
        table["width"] = 2.0 * float(solid.half[2])
    upright = _upright(parts, at, number)
    ahead = math.atan2(-axis[0], axis[1])  # of the axle's axis times up
    if upright is None:
        return _Wheel(
            {**table, "kind": "fixed", "angle": _fold(ahead)}, middle, middle, number, number, False
        )
    pivot = at[upright][0] + at[upright][1] @ parts[upright].anchor
    table["mass"] = sum(parts[i].mass for i in below(parts, upright))
    return _turned(parts[upright], table, ahead, middle, pivot, number, upright)


def _turned(
    steering: Part, table: dict[str, Any], ahead: float, middle: Array, pivot: Array,
    number: int, upright: int,
) -> _Wheel:  # fmt: skip
    """A wheel on an upright axis: a castor where it trails and turns without an end, else steered."""
    away = (middle - pivot)[:2]
    trail = away @ [math.cos(ahead), math.sin(ahead)]
    room = _ASIDE * (table.get("radius") or math.inf)
    if abs(trail) <= room or steering.reach is not None:
        steered = {**table, "kind": "steered", "angle": _fold(ahead)}
        beside = np.hypot(*away) > room
        return _Wheel(steered, middle, middle, number, upright, False, bool(beside))
    if trail > 0:
        ahead += math.pi  # a castor's rolling direction points from the wheel to the pivot
    cos, sin = math.cos(ahead), math.sin(ahead)
    table |= {"kind": "castor", "angle": _neat(math.remainder(ahead, 2 * math.pi))}
    table |= {"trail": float(-away @ [cos, sin]), "lateral": float(away @ [-sin, cos])}
    return _Wheel(table, middle, pivot, number, upright, True)


def _upright(parts: Sequence[Part], at: Frames, number: int) -> int | None:
    """The upright joint between a wheel and the body. Raises ArgumentError where others move."""
    found, above = None, parts[number].parent
    while above >= 0:
        part = parts[above]
        if part.moves != "fixed":
            axis = at[above][1] @ part.axis
            if part.moves != "turning" or math.hypot(*axis[:2]) > _LEVEL or found is not None:
                expected = "fixed between body and wheel, but for one that steers (a suspension is not read)"
                raise ArgumentError("joint", part.joint, expected)
            found = above
        above = part.parent
    return found


def _round_solid(parts: Sequence[Part], at: Frames, number: int) -> tuple[Solid | None, Array]:
    """The largest round solid that turns with a joint about its axis, and its middle in the root's
    frame; without one None and the joint's place."""
    hub = at[number][0] + at[number][1] @ parts[number].anchor
    axis = at[number][1] @ parts[number].axis
    found: list[tuple[float, Solid, Array]] = []
    for i in below(parts, number):
        place, turn = at[i]
        for solid in parts[i].solids:
            along = abs((turn @ solid.turn)[:, 2] @ axis) > math.cos(_LEVEL)
            if solid.half is None or not (
                solid.kind == "sphere" or (solid.kind == "cylinder" and along)
            ):
                continue
            middle, radius = place + turn @ solid.place, float(solid.half[0])
            beside = np.linalg.norm(np.cross(middle - hub, axis))  # so are rollers
            if parts[number].moves == "fixed" or beside <= _ASIDE * radius:
                found.append((radius, solid, middle))
    if not found:
        return None, hub
    _, solid, middle = max(found, key=lambda item: item[0])
    return solid, middle


def _tables(
    parts: Sequence[Part], at: Frames, wheels: Sequence[_Wheel], changes: dict[str, Any], file: Path
) -> dict[str, Any]:
    """The tables of the robot's file, without what the parts do not say."""
    told = {w.table["name"]: _radius(w.table, changes) for w in wheels}
    radii = require_radii(told, file)
    floors = {w.table["name"]: float(w.centre[2]) - radii[w.table["name"]] for w in wheels}
    floor = min(floors.values())
    high = max(floors, key=lambda name: floors[name])
    if floors[high] - floor > _UNEVEN:
        expected = (
            f"wheels that touch one level ground; this one is {floors[high] - floor:.3g} m above it"
        )
        raise ArgumentError("--wheels", high, expected)
    fixed = [w for w in wheels if w.table["kind"] == "fixed"]
    skids = len(fixed) == len(wheels) and not _one_axle(fixed)
    axle = fixed if fixed and not skids else wheels
    x, y = np.mean([w.centre[:2] for w in axle], axis=0).tolist()
    origin = np.array([x, y, floor])
    tables: dict[str, Any] = {
        "name": file.stem,
        "about": f"From {file.name}, its origin at {_numbers(origin)} m of the root's frame.",
        "body": _body(parts, at, wheels, origin),
        "wheels": [
            {**w.table, "beside" if w.beside else "position": _numbers(w.pivot - origin)[:2]}
            for w in wheels
        ],
        "motors": [
            _given(name=w.table["name"], wheels=[w.table["name"]], torque=parts[w.part].effort,
                   speed=parts[w.part].speed)
            for w in wheels if parts[w.part].driven
        ],
        "steering": _steering(parts, at, wheels),
    }  # fmt: skip
    if skids:
        tables["skid"] = {}
    return tables


def _body(
    parts: Sequence[Part], at: Frames, wheels: Sequence[_Wheel], origin: Array
) -> dict[str, Any]:
    swivels = {wheel.top for wheel in wheels if wheel.swivels}
    # castors wherever they point: the mean of both ends is that over all angles
    mass, *moments, turning = (weighed(parts, at) + weighed(parts, frames(parts, swivels))) / 2.0
    body: dict[str, Any] = {}
    if mass > 0:
        cog = np.array(moments) / mass
        body |= {"mass": float(mass), "cog": _numbers(cog - origin)}
        body["yaw_inertia"] = float(turning - mass * (cog[:2] @ cog[:2]))
    others = {i for wheel in wheels for i in below(parts, wheel.top)}
    solids = [
        (solid, *at[i]) for i, part in enumerate(parts) if i not in others for solid in part.solids
    ]
    if solids and all(solid.half is not None for solid, _, _ in solids):
        corners = np.vstack([extent(*solid) for solid in solids]) - origin
        low, high = corners.min(axis=0), corners.max(axis=0)
        body |= {"chassis": _numbers(high - low), "chassis_place": _numbers((low + high) / 2)[:2]}
        if low[2] >= 0:
            body["clearance"] = round(float(low[2]), 6)
    return body


def _steering(parts: Sequence[Part], at: Frames, wheels: Sequence[_Wheel]) -> list[dict[str, Any]]:
    """One group a steering joint."""
    groups: dict[int, list[str]] = {}
    for wheel in wheels:
        if wheel.table["kind"] == "steered":
            groups.setdefault(wheel.top, []).append(wheel.table["name"])
    found = []
    for number, names in groups.items():
        part, reach = parts[number], parts[number].reach
        if reach is not None and (at[number][1] @ part.axis)[2] < 0:
            reach = (-reach[1], -reach[0])  # its axis points down
        found.append(_given(name=part.joint, wheels=names, range=reach, rate=part.speed))
    return found


def _one_axle(wheels: Sequence[_Wheel]) -> bool:
    """Whether fixed wheels stand on one line, across their rolling direction."""
    first = wheels[0]
    ahead = np.array([math.cos(first.table["angle"]), math.sin(first.table["angle"])])
    return all(
        abs((w.centre - first.centre)[:2] @ ahead) < _UNEVEN
        and abs(math.sin(w.table["angle"] - first.table["angle"])) < _LEVEL
        for w in wheels
    )


def _radius(table: Mapping[str, Any], changes: Mapping[str, Any]) -> float | None:
    for name in (table["name"], "all"):
        if isinstance(changes.get(f"wheels.{name}.radius"), (int, float)):
            return float(changes[f"wheels.{name}.radius"])
    return table.get("radius")


def _given(**values: Any) -> dict[str, Any]:
    return {key: value for key, value in values.items() if value is not None}


def _fold(angle: float) -> float:
    """Rolling directions within a quarter turn from ahead: a wheel whose axle points to the right
    is the same wheel."""
    return _neat(math.remainder(angle, math.pi))


def _neat(angle: float) -> float:
    near = round(angle / (math.pi / 12)) * (math.pi / 12)
    return float(near if abs(angle - near) < _ROUND else angle)


def _numbers(values: Array) -> list[float]:
    """Rounded to a micrometre, which files with rounded angles miss."""
    return [round(value, 6) + 0.0 for value in values.tolist()]
