"""Robots of the textbook [wheels-lecture], which only their wheels make; sizes are chosen: round
numbers of a small indoor robot."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from trajopt.robots import Robot, robot

LENGTH, WIDTH = 0.6, 0.5  # m, wheelbase and track


def wheel(kind: str, x: float, y: float, **more: Any) -> dict[str, Any]:
    """A wheel of 0.1 m radius; ``more`` are its other keys."""
    size = {"radius": 0.1, "width": 0.04, "mass": 1.0}
    return {"kind": kind, "position": [x, y], **size, **more}


def planar(name: str, *wheels: Mapping[str, Any], **more: Any) -> Robot:
    """A robot of 30 kg on ``wheels``, each driven, steered ones each by itself; its centre of
    gravity lies in the middle of them. ``more`` are other tables."""
    named = [{"name": f"wheel-{i + 1}", **wheel} for i, wheel in enumerate(wheels)]
    x, y = (sum(wheel["position"][i] for wheel in wheels) / len(wheels) for i in (0, 1))
    each = [{"name": wheel["name"], "wheels": [wheel["name"]]} for wheel in named]
    turned = [e for e, w in zip(each, wheels, strict=True) if w["kind"] == "steered"]
    driven = [e for e, w in zip(each, wheels, strict=True) if w["kind"] != "spherical"]
    body = {
        "mass": 30.0,
        "cog": [x, y, 0.15],
        "chassis": [LENGTH, WIDTH, 0.2],
        "chassis_place": [x, y],
        "clearance": 0.1,
    }
    tables = {
        "name": name,
        "body": body,
        "wheels": named,
        "motors": [{**one, "torque": 5.0} for one in driven],
        "steering": turned,
        **more,
    }
    return Robot.of(tables)


def _omni(angle: float) -> dict[str, Any]:
    x, y = 0.3 * math.cos(angle), 0.3 * math.sin(angle)
    rollers = {"count": 12, "angle": 0.0, "radius": 0.02}
    return wheel("swedish", x, y, angle=angle + math.pi / 2, rollers=rollers)


TEXTBOOK: Mapping[str, Robot] = {
    "differential": planar(
        "differential", *(wheel("fixed", 0.0, y) for y in (WIDTH / 2, -WIDTH / 2))
    ),
    "bicycle": planar("bicycle", wheel("fixed", 0.0, 0.0), wheel("steered", LENGTH, 0.0)),
    "tricycle": planar(
        "tricycle",
        *(wheel("fixed", 0.0, y) for y in (WIDTH / 2, -WIDTH / 2)),
        wheel("steered", LENGTH, 0.0),
    ),
    "two-steer": planar(
        "two-steer", *(wheel("steered", x, 0.0) for x in (LENGTH / 2, -LENGTH / 2))
    ),
    "three-omni": planar("three-omni", *(_omni(2 * math.pi * i / 3) for i in range(3))),
    "four-mecanum": robot("loc8"),
    "asoc": robot("asoc-4"),
}
