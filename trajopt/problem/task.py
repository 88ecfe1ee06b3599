"""What is asked: start, goal, the room for it, the spline that is searched and its objective."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Literal, Self

from pydantic import Field, model_validator

from trajopt.problem.surroundings import polygon
from trajopt.robots.actuator import Actuator
from trajopt.schema import NonNegative, Point, Point3, Positive, Section, broken_rule

if TYPE_CHECKING:
    import shapely

FreeVariable = Literal["p1", "p2", "heading", "duration"]


class Start(Section):
    """Where the motion starts, at rest."""

    pose: Point3 | None = Field(
        None, description="x, y, yaw: m, m, rad; a given path has its own, so not with [path]"
    )
    wheels: tuple[float, ...] | None = Field(
        None, description="wheel angles, one a wheel that rolls, rad; absent: zeros"
    )
    steering: dict[str, float] | None = Field(
        None,
        description="steering and castor angles by wheel, rad; absent: castors as the robot's file "
        "draws them, steered wheels as the path begins",
    )


class Goal(Section):
    """Where it ends; the final angles of the critical wheels count."""

    pose: Point3 = Field(description="x, y, yaw: m, m, rad")
    wheels: tuple[float, ...] | None = Field(
        None, description="wanted wheel angles, one a wheel that rolls, rad"
    )
    critical: tuple[str, ...] | None = Field(
        None,
        description="names of the wheels whose final angle counts; with wheels, else neither",
        min_length=1,
    )

    @model_validator(mode="after")
    def _both_or_none(self) -> Self:
        if (self.wheels is None) != (self.critical is None):
            missing = "wheels" if self.wheels is None else "critical"
            raise broken_rule(missing, None, "wheels and critical both given or both left out")
        if self.critical is not None and len(set(self.critical)) < len(self.critical):
            raise broken_rule("critical", list(self.critical), "each wheel once")
        return self


class Space(Section):
    """A rectangle: searched control points stay inside; so does the outline where a step is climbed.
    On a route, or along a given path, the outline stays inside, and it may be a polygon."""

    x_range: Point | None = Field(None, alias="x", description="from, to, m")
    y_range: Point | None = Field(None, alias="y", description="from, to, m")
    corners: tuple[Point, ...] | None = Field(
        None, description="instead of x and y: x, y, m, counter-clockwise", min_length=3
    )
    holes: tuple[tuple[Point, ...], ...] = Field(
        (), description="polygons inside that outlines keep out of, with corners"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        given = self.x_range is not None, self.y_range is not None
        if self.corners is not None:
            if any(given):
                expected = "corners, or x and y, not both"
                raise broken_rule("x" if given[0] else "y", "given", expected)
            _ = polygon("corners", self.corners, self.holes)
            return self
        for axis, there in zip(("x", "y"), given, strict=True):
            if not there:
                raise broken_rule(axis, "missing", "an interval [from, to], or corners instead")
            low, high = getattr(self, axis)
            if not low < high:
                raise broken_rule(axis, [low, high], "an interval [from, to] with from < to")
        if self.holes:
            raise broken_rule("holes", "given", "corners with them")
        return self

    @property
    def x(self) -> Point:
        """From, to, m; of a polygon, as far as it reaches."""
        if self.x_range is not None:
            return self.x_range
        low, _, high, _ = self.area.bounds
        return low, high

    @property
    def y(self) -> Point:
        """As ``x``."""
        if self.y_range is not None:
            return self.y_range
        _, low, _, high = self.area.bounds
        return low, high

    @property
    def area(self) -> shapely.Polygon:
        """The polygon, or the rectangle as one."""
        if self.corners is not None:
            return polygon("corners", self.corners, self.holes)
        from shapely.geometry import box

        return box(self.x[0], self.y[0], self.x[1], self.y[1])

    def contains(self, x: float, y: float) -> bool:
        return self.x[0] <= x <= self.x[1] and self.y[0] <= y <= self.y[1]


class Spline(Section):
    """Natural cubic spline through start, P1, P2, goal; which of its control values are
    searched."""

    free: tuple[FreeVariable, ...] = Field(min_length=1, description="searched control values")

    @model_validator(mode="after")
    def _once(self) -> Self:
        if len(set(self.free)) != len(self.free):
            raise broken_rule("free", list(self.free), "each name once")
        if set(self.free) == {"duration"}:
            raise broken_rule("free", list(self.free), "at least one of p1, p2, heading")
        return self


class ObjectiveSection(Section):
    """Terminal cost of [guzman2015], Table 4.4, or duration (s) or energy (J, of the motors) of the
    fastest motion along the path; of a route, its duration, or its length (m) with little
    bending."""

    kind: Literal["terminal", "duration", "energy", "length"] = "terminal"
    pose_gains: tuple[NonNegative, NonNegative, NonNegative] = Field(
        (3.0, 0.125, 2.5), description="on |dx|, |dy| (1/m), |dyaw| (1/rad): Table 5.8"
    )
    wheel_gain: NonNegative = Field(
        12.5, description="on each critical wheel's deviation, 1/rad: Table 5.8"
    )
    wheel_period: Literal["2pi", "pi"] = Field(
        "2pi", description="2pi: the tables; pi: hubs half a turn apart"
    )
    wheel_tolerance: Positive = Field(1e-3, description="rad; a solution holds within it; chosen")
    pose_tolerance: Positive = Field(
        1e-3, description="m and rad; a solution holds within it; chosen"
    )

    @property
    def unit(self) -> str:
        """Of the cost, with a space before it; "" for the terminal one, which has none."""
        return {"terminal": "", "duration": " s", "energy": " J", "length": " m"}[self.kind]

    @property
    def period(self) -> float:
        """Period of the wheel angle, rad."""
        return 2 * math.pi if self.wheel_period == "2pi" else math.pi


class ActuatorSection(Section):
    """Drives that saturate and have a dead zone: the search predicts through them, at uniform
    spline speed in a nominal duration. Without this section drives follow and motions are
    time-scaled."""

    duration: Positive = Field(description="nominal, of the motion, s")
    saturation: Positive = Field(description="rad/s")
    dead_zone: NonNegative = Field(description="rad/s")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.dead_zone >= self.saturation:
            raise broken_rule(
                "dead_zone", self.dead_zone, f"a speed below saturation = {self.saturation} rad/s"
            )
        return self

    @property
    def drive(self) -> Actuator:
        return Actuator(self.saturation, self.dead_zone)
