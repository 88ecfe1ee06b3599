"""Every key of a robot file that physics uses changes what is built, or is refused by name."""

from __future__ import annotations

from typing import Any

import pytest

from trajopt.errors import ArgumentError
from trajopt.robots import robot
from trajopt.robots.description import (
    BodySection,
    DoubleSection,
    MotorSection,
    PivotSection,
    RollerSection,
    SteeringSection,
    WheelSection,
)
from trajopt.simulate.build import build

# robot, key, value that differs from the file's, and a part of the model that must differ, or the
# words of a refusal
Links = str
ROWS: list[tuple[str, str, Any, Links]] = [
    ("loc8", "body.mass", 30.0, "mass"),
    ("loc8", "body.cog", [0.02, 0.0, 0.12], "cog"),
    ("loc8", "body.yaw_inertia", 3.0, "inertia"),
    ("loc8", "body.chassis", [0.5, 0.4, 0.1], "shapes"),
    ("loc8", "body.chassis_place", [0.05, 0.0], "shapes"),
    ("loc8", "body.clearance", 0.05, "shapes"),
    ("loc8", "body.footprint", [[0.6, 0.4], [-0.6, 0.4], [-0.6, -0.4], [0.6, -0.4]], "shapes"),
    ("loc8", "wheels.front-left.name", "other", "refused: motors"),
    ("loc8", "wheels.front-left.kind", "fixed", "refused: rollers"),
    ("powerbot", "wheels.left.position", [0.0, 0.3], "joint"),
    ("omni-3", "wheels.wheel-1.angle", 1.0, "joint"),
    ("powerbot", "wheels.left.radius", 0.1, "shapes"),
    ("loc8", "wheels.front-left.radius", 0.1, "joint"),
    ("powerbot", "wheels.left.width", 0.1, "inertia"),
    ("loc8", "wheels.front-left.width", 0.06, "inertia"),
    ("powerbot", "wheels.left.mass", 5.0, "mass"),
    ("loc8", "wheels.front-left.mass", 2.0, "mass"),
    ("powerbot", "wheels.castor-left.trail", 0.06, "joint"),
    ("asoc-4", "wheels.all.trail", 0.08, "joint"),
    ("asoc-4", "wheels.module-1-left.lateral", 0.12, "joint"),
    ("loc8", "wheels.front-left.rollers.count", 16, "count"),
    ("loc8", "wheels.front-left.rollers.angle", 0.6, "joint"),
    ("loc8", "wheels.front-left.rollers.radius", 0.011, "joint"),
    ("loc8", "wheels.front-left.rollers.shape", "barrel", "shapes"),
    ("loc8", "wheels.front-left.rollers.spheres", 7, "shapes"),
    ("loc8", "wheels.front-left.rollers.mass", 0.03, "mass"),
    ("loc8-smdw", "wheels.front-left.double.minor_radius", 0.05, "joint"),
    ("loc8-smdw", "wheels.front-left.double.depth", 0.04, "joint"),
    ("loc8-smdw", "wheels.front-left.double.gap", 0.02, "joint"),
    ("loc8-smdw", "wheels.front-left.double.outer", "right", "joint"),
    ("loc8-smdw", "wheels.front-left.double.rollers", 5, "count"),
    ("loc8-smdw", "wheels.front-left.double.roller_radius", 0.0115, "joint"),
    ("asoc-4", "pivots.module-1.name", "other", "name"),
    ("asoc-4", "pivots.module-1.wheels", ["module-1-right"], "refused: pivots"),
    ("asoc-4", "pivots.module-1.mass", 4.0, "mass"),
    ("asoc-4", "pivots.module-1.sag", 0.05, "joint"),
    ("asoc-4", "pivots.module-1.damping_ratio", 1.0, "joint"),
    ("asoc-4", "pivots.module-1.travel", 0.05, "joint"),
    ("asoc-4", "pivots.module-1.tilt", "driven", "joint"),
    ("asoc-4", "pivots.module-1.tilt", "rigid", "joint"),
    ("asoc-4", "pivots.module-1.tilt_range", 0.3, "joint"),
    ("loc8", "motors.front-left.wheels", ["front-right"], "refused: motors"),
    ("car", "motors.drive.wheels", ["rear-left"], "driven"),
    ("loc8", "motors.front-left.torque", 4.0, "joint"),
    ("loc8", "motors.front-left.speed", 12.0, "top_speed"),
    ("car", "steering.front.wheels", ["front-left"], "refused: steering"),
    ("car", "steering.front.range", [-0.2, 0.2], "joint"),
]
SECTIONS = {
    "body": BodySection, "wheels": WheelSection, "rollers": RollerSection,
    "double": DoubleSection, "pivots": PivotSection, "motors": MotorSection,
    "steering": SteeringSection,
}  # fmt: skip
# names of groups, and what bounds plans: physics follows them and limits speed and torque alone
ELSEWHERE = {
    *(
        (("motors", key))
        for key in ["name", "acceleration", "curve", "gear", "braking", "regeneration"]
    ),
    *((("steering", key)) for key in ["name", "rule", "rate", "acceleration"]),
}


@pytest.mark.parametrize(
    ("name", "key", "value", "part"), ROWS, ids=[f"{r[1]}={r[2]}" for r in ROWS]
)
def test_key_acts_or_is_refused(name: str, key: str, value: Any, part: str) -> None:
    before = build(robot(name))
    if part.startswith("refused: "):
        with pytest.raises(ValueError, match=part.removeprefix("refused: ")):
            build(robot(name, {key: value}))
        return
    after = build(robot(name, {key: value}))
    if part == "count":
        assert len(after.links) != len(before.links)
    elif part in ("driven", "top_speed"):
        assert getattr(after, part) != getattr(before, part)
    else:
        pairs = zip(before.links, after.links, strict=False)
        assert any(getattr(a, part) != getattr(b, part) for a, b in pairs)


def test_every_key_has_a_row() -> None:
    rows = set()
    for _, key, _, _ in ROWS:
        path = [part for part in key.split(".") if part in SECTIONS]
        rows.add((path[-1], key.rsplit(".", 1)[-1]))
    keys = {
        (section, key)
        for section, model in SECTIONS.items()
        for key in model.model_fields
        if key not in SECTIONS
    }
    assert keys - rows == ELSEWHERE


def test_what_the_engine_cannot_build_is_named() -> None:
    with pytest.raises(ArgumentError, match=r"wheels\.front-left\.rollers\.count"):
        build(robot("loc8", {"wheels.front-left.rollers.count": 3}))
