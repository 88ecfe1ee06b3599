"""A robot as its file describes it: body, wheels, pivots, motors, steering.

One description feeds kinematics, limits, physics, outline and pictures. Lengths are m, angles rad,
masses kg. Body frame: x forward, y left, z up, origin on the ground; where the origin lies in the
body is the file's choice (for a car the middle of the fixed axle).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import pairwise
from typing import Literal, Self

from pydantic import Field, model_validator

from trajopt.schema import NonNegative, Point, Point3, Positive, Section, Share, broken_rule

Kind = Literal["fixed", "steered", "castor", "swedish", "spherical"]
Shape = Literal["spheres", "barrel", "ellipsoid", "cylinder", "cone"]
Sharing = Literal["least_norm", "capacity", "load"]  # see limits/slip.py
LARGEST_ROLLER_ANGLE = math.radians(80.0)  # rad, chosen: beyond, a wheel hardly drives


class BodySection(Section):
    """The whole robot as a rigid body, and the box of its chassis."""

    mass: Positive = Field(description="of the whole robot, wheels included, kg")
    cog: Point3 = Field(description="centre of gravity of the whole robot: x, y, height, m")
    yaw_inertia: Positive | None = Field(
        None,
        description="of the whole robot about its centre of gravity, kg m^2; "
        "absent: a plate of the chassis' size and the wheels at their places",
    )
    chassis: Point3 = Field(description="length, width, height of the box that collides, m")
    chassis_place: Point = Field((0.0, 0.0), description="x, y of the box's middle, m")
    clearance: NonNegative = Field(description="from the ground to the box, m")
    footprint: tuple[Point, ...] | None = Field(
        None,
        description="corners of the outline, counter-clockwise, m; absent: the box around chassis "
        "and wheels",
        min_length=3,
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not min(self.chassis) > 0:
            raise broken_rule("chassis", list(self.chassis), "three lengths > 0 m")
        if not self.cog[2] > 0:
            raise broken_rule("cog", list(self.cog), "a height of the centre of gravity > 0 m")
        if self.footprint is not None and not _signed_area(self.footprint) > 0:
            raise broken_rule(
                "footprint",
                [list(p) for p in self.footprint],
                "corners of an outline, counter-clockwise, that do not lie on one line",
            )
        return self


class RollerSection(Section):
    """The passive rollers of a Swedish wheel."""

    count: int = Field(description="around the wheel (double wheel: on a half circle)", ge=2, le=60)
    angle: float = Field(
        description="of the axis of the roller on the ground from the rolling direction, "
        "counter-clockwise, rad: 0 omni wheel, +-pi/4 Mecanum wheel",
        ge=-LARGEST_ROLLER_ANGLE,
        le=LARGEST_ROLLER_ANGLE,
    )
    radius: Positive = Field(description="m")
    shape: Shape = Field("spheres", description="in physics")
    spheres: int = Field(5, description="a roller, of shape spheres", ge=2, le=25)
    mass: float = Field(0.02, description="of one roller, kg", ge=0.01)


class DoubleSection(Section):
    """Two hubs side by side, each a half circle joined to a half ellipse, half a turn apart."""

    minor_radius: Positive = Field(description="half-axis of the ellipse, m")
    depth: Positive = Field(description="of one hub along the axle, m")
    gap: NonNegative = Field(description="between the hubs, m")
    outer: Literal["left", "right"] = Field(
        description="side of the hub whose ellipse is down at wheel angle 0"
    )
    rollers: int = Field(description="on the half ellipse of a hub", ge=2, le=30)
    roller_radius: Positive = Field(description="of those rollers, m")


class WheelSection(Section):
    """A wheel."""

    name: str = Field(min_length=1)
    kind: Kind
    position: Point = Field(description="of its centre (castor: of its pivot), x, y, m")
    angle: float = Field(
        0.0, description="of the rolling direction, rad (steered, castor: at steering angle 0)"
    )
    radius: Positive = Field(description="m")
    width: Positive = Field(description="along the axle, m")
    mass: Positive = Field(description="kg")
    trail: NonNegative = Field(0.0, description="castor: from its pivot back to the axle, m")
    lateral: float = Field(0.0, description="castor: of the wheel to the left of its pivot, m")
    rollers: RollerSection | None = Field(None, description="of a Swedish wheel")
    double: DoubleSection | None = Field(None, description="of a Swedish wheel with two hubs")

    @model_validator(mode="after")
    def _fitting(self) -> Self:
        swedish = self.kind == "swedish"
        if swedish != (self.rollers is not None):
            expected = "rollers with a Swedish wheel, and with no other kind"
            raise broken_rule("rollers", "given" if self.rollers else "missing", expected)
        if self.double is not None and not swedish:
            raise broken_rule("double", "given", "a double hub only with kind 'swedish'")
        if (self.kind == "castor") != (self.trail > 0):
            raise broken_rule("trail", self.trail, "a trail > 0 m with a castor, and with no other")
        if self.kind != "castor" and self.lateral != 0:
            raise broken_rule("lateral", self.lateral, "0 m: only a castor stands beside its pivot")
        if self.double is not None and self.double.minor_radius > self.radius:
            value = self.double.minor_radius
            raise broken_rule("double.minor_radius", value, f"up to the radius {self.radius} m")
        if self.double is not None and self.width + 1e-9 < 2 * self.double.depth + self.double.gap:
            raise broken_rule("width", self.width, "at least twice double.depth, and double.gap")
        return self

    @property
    def contact(self) -> Point:
        """Where it touches the ground in the body frame at steering angle 0, m."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return (
            self.position[0] - self.trail * cos - self.lateral * sin,
            self.position[1] - self.trail * sin + self.lateral * cos,
        )


class PivotSection(Section):
    """A vertical axis that several castor wheels turn about together, sprung or tilting."""

    name: str = Field(min_length=1)
    wheels: tuple[str, ...] = Field(description="castors that share it", min_length=2)
    mass: Positive = Field(description="of the link and axle between pivot and wheels, kg")
    sag: Positive | None = Field(
        None, description="of its spring under the robot's weight, m; absent: no suspension"
    )
    damping_ratio: Positive = Field(0.7, description="of its spring, of critical damping")
    travel: Positive = Field(0.1, description="of its spring, up and down, m")
    tilt: Literal["rigid", "passive", "driven"] = Field(
        "rigid", description="of the axle about the fore-aft axis"
    )
    tilt_range: Positive = Field(0.5, description="either way, rad")


class MotorSection(Section):
    """A motor and the wheels that it drives; a wheel that no motor names rolls freely."""

    name: str = Field(min_length=1)
    wheels: tuple[str, ...] = Field(description="one or several", min_length=1)
    torque: Positive = Field(description="largest, at each wheel, N m")
    speed: Positive | None = Field(None, description="largest, of a wheel, rad/s")
    acceleration: Positive | None = Field(None, description="largest, of a wheel, rad/s^2")
    curve: tuple[Point, ...] | None = Field(
        None,
        description="speed, rad/s, and the most torque there, N m, of the motor's shaft, from "
        "standing still to its fastest; linear in between. A DC motor has two points: stall "
        "torque and free speed",
        min_length=2,
    )
    gear: Positive | None = Field(
        None, description="turns of that shaft a turn of a wheel; absent: 1, the wheel's own"
    )
    braking: Literal["full", "curve"] = Field(
        "full", description="against the motion: full, up to torque; curve, as the curve too"
    )
    regeneration: Share | None = Field(
        None, description="share of the work of braking that comes back; absent: none"
    )

    @model_validator(mode="after")
    def _falling(self) -> Self:
        if self.curve is None:
            if self.gear is not None:
                raise broken_rule("gear", self.gear, "a curve with it")
            if self.braking == "curve":
                raise broken_rule("braking", self.braking, "a curve with it")
            return self
        speeds, torques = zip(*self.curve, strict=True)
        steps = [(b[0] - a[0], b[1] - a[1]) for a, b in pairwise(self.curve)]
        rising = speeds[0] == 0 and all(step[0] > 0 for step in steps)
        if not (rising and torques[0] > 0 and torques[-1] >= 0 and all(s[1] <= 0 for s in steps)):
            expected = "speeds that rise from 0, torques that fall from above 0 to 0 or above"
            raise broken_rule("curve", [list(p) for p in self.curve], expected)
        slopes = [torque / speed for speed, torque in steps]
        level = 1 if slopes[0] == 0 else 0
        down = all(b <= a for a, b in pairwise(slopes))
        if not (down or all(b >= a for a, b in pairwise(slopes[level:]))):
            expected = "torques that fall ever faster, or, after a level start, ever more slowly with speed"
            raise broken_rule("curve", [list(p) for p in self.curve], expected)
        return self


class SteeringSection(Section):
    """What turns one steered wheel or several."""

    name: str = Field(min_length=1)
    wheels: tuple[str, ...] = Field(min_length=1)
    range: Point | None = Field(None, description="from, to, rad; absent: endless")
    rule: Literal["ackermann", "parallel"] = Field(
        "ackermann",
        description="of several wheels: ackermann, each at the angle that its own place needs; "
        "parallel, all at the angle that the place in their middle needs",
    )
    rate: Positive | None = Field(
        None, description="largest, of each of its wheels, rad/s; absent: no limit"
    )
    acceleration: Positive | None = Field(
        None, description="largest, of each of its wheels, rad/s^2; absent: no limit"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.range is not None and not self.range[0] <= 0 <= self.range[1]:
            raise broken_rule("range", list(self.range), "from <= 0 <= to, rad")
        return self


class SkidSection(Section):
    """A robot whose wheels slide sideways when it turns (skid steering)."""

    effective_track: Positive = Field(description="track of the two-wheeled robot like it, m")


class RobotDescription(Section):
    """A whole robot file. ``source`` is the file it came from."""

    name: str = Field(min_length=1)
    about: str = Field("", description="a sentence for people")
    body: BodySection
    wheels: tuple[WheelSection, ...] = Field(min_length=1)
    pivots: tuple[PivotSection, ...] = ()
    motors: tuple[MotorSection, ...] = ()
    steering: tuple[SteeringSection, ...] = ()
    skid: SkidSection | None = None
    sharing: Sharing = Field(
        "least_norm",
        description="of the ground's force by the wheels that hold, for the limit slip: least_norm, "
        "each its part of the smallest forces; capacity, all that they hold together; load, as they "
        "are loaded, without the yaw moment",
    )
    source: str = Field("<robot>", exclude=True, repr=False)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        kinds = {wheel.name: wheel.kind for wheel in self.wheels}
        for array, elements in (
            ("wheels", self.wheels),
            ("pivots", self.pivots),
            ("motors", self.motors),
            ("steering", self.steering),
        ):
            names = [element.name for element in elements]
            if len(set(names)) < len(names):
                raise broken_rule(f"{array}.name", names, "different names")
        _require_wheels("pivots", self.pivots, kinds, ("castor",))
        _require_wheels("motors", self.motors, kinds, ("fixed", "steered", "castor", "swedish"))
        _require_wheels("steering", self.steering, kinds, ("steered",))
        steered = {name for group in self.steering for name in group.wheels}
        for wheel in self.wheels:
            if wheel.kind == "steered" and wheel.name not in steered:
                raise broken_rule("steering", [], f"a [[steering]] that names '{wheel.name}'")
        by_name = {wheel.name: wheel for wheel in self.wheels}
        for pivot in self.pivots:
            if len({by_name[w].position for w in pivot.wheels}) > 1:
                expected = "wheels whose position is the same pivot"
                raise broken_rule("pivots.wheels", list(pivot.wheels), expected)
            sides = [by_name[w].lateral for w in pivot.wheels]
            if pivot.tilt == "passive" and not min(sides) < 0 < max(sides):
                raise broken_rule("pivots.tilt", pivot.tilt, "wheels on either side of the pivot")
        if self.skid is not None and set(kinds.values()) != {"fixed"}:
            raise broken_rule("skid", "given", "skid steering only with fixed wheels")
        parts = sum(w.mass for w in self.wheels) + sum(p.mass for p in self.pivots)
        if not self.body.mass > parts:
            raise broken_rule(
                "body.mass", self.body.mass, f"more than its parts weigh, {parts:g} kg"
            )
        return self


def _require_wheels(
    array: str,
    groups: Sequence[PivotSection | MotorSection | SteeringSection],
    kinds: dict[str, Kind],
    allowed: tuple[Kind, ...],
) -> None:
    """Every named wheel exists, is of an allowed kind, and is named once."""
    seen: set[str] = set()
    right = [name for name, kind in kinds.items() if kind in allowed]
    for group in groups:
        for name in group.wheels:
            if name not in right or name in seen:
                expected = f"wheels among {', '.join(right) or 'none'}, each once"
                raise broken_rule(f"{array}.wheels", list(group.wheels), expected)
            seen.add(name)


def _signed_area(corners: Sequence[Point]) -> float:
    """Signed area of the polygon, m^2: > 0 counter-clockwise."""
    pairs = zip(corners, [*corners[1:], corners[0]], strict=True)
    return sum(a[0] * b[1] - b[0] * a[1] for a, b in pairs) / 2
