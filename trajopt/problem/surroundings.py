"""Where the robot drives: ground and obstacles."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from trajopt.schema import Point, Positive, Section, broken_rule
from trajopt.world.obstacles import Circle, Obstacle, Polygon, Step, Wall
from trajopt.world.ramp import Ramp, Ramps
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat


class RampSection(Section):
    """A ramp on the floor."""

    foot: Point = Field(description="a point of the foot line, x, y, m")
    direction: float = Field(description="in which it rises, rad")
    length: Positive = Field(description="along the slope, m")
    height: float = Field(description="m")
    rounding: Positive = Field(description="edges are rounded over this length, m (axle distance)")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not abs(self.height) < self.length:
            raise broken_rule("height", self.height, f"a height below the length {self.length} m")
        return self

    @property
    def ramp(self) -> Ramp:
        run = math.sqrt(self.length**2 - self.height**2)
        return Ramp(self.foot, self.direction, run, self.height, self.rounding)


class GroundSection(Section):
    """The ground: its friction and shape (level where there are no ramps)."""

    friction: Positive = Field(description="coefficient between wheels and ground")
    ramps: tuple[RampSection, ...] = Field((), description="ramps on level ground")
    grade: float | None = Field(
        None, description="steepest slope that the robot climbs, rad; with ramps", gt=0, lt=1.57
    )

    @model_validator(mode="after")
    def _both(self) -> Self:
        if bool(self.ramps) != (self.grade is not None):
            raise broken_rule("grade", self.grade, "ramps and grade both given or both left out")
        return self

    @property
    def shape(self) -> Flat | Ramps:
        if self.grade is None:
            return Flat()
        return Ramps(tuple(ramp.ramp for ramp in self.ramps), self.grade)


class _Standing(Section):
    name: str = Field(min_length=1)
    height: Positive = Field(description="m")


class StepSection(_Standing):
    """A block whose front edge is met."""

    kind: Literal["step"]
    place: Point = Field(description="x, y in the middle of its front edge, m")
    direction: float = Field(description="of the normal of the edge, into the step, rad")
    width: Positive = Field(description="length of the edge, m")
    depth: Positive = Field(description="behind the edge, m")

    @property
    def obstacle(self) -> Step:
        return Step(self.name, self.height, self.place, self.direction, self.width, self.depth)


class WallSection(_Standing):
    """A straight wall."""

    kind: Literal["wall"]
    start: Point = Field(description="x, y of one end, m")
    end: Point = Field(description="x, y of the other, m")
    thickness: Positive = Field(description="m")

    @model_validator(mode="after")
    def _long(self) -> Self:
        if math.dist(self.start, self.end) < 1e-6:
            raise broken_rule("end", list(self.end), "a point different from start")
        return self

    @property
    def obstacle(self) -> Wall:
        return Wall(self.name, self.height, self.start, self.end, self.thickness)


class CircleSection(_Standing):
    """A round post."""

    kind: Literal["circle"]
    centre: Point = Field(description="x, y, m")
    radius: Positive = Field(description="m")

    @property
    def obstacle(self) -> Circle:
        return Circle(self.name, self.height, self.centre, self.radius)


class PolygonSection(_Standing):
    """A prism."""

    kind: Literal["polygon"]
    corners: tuple[Point, ...] = Field(
        description="x, y, m, counter-clockwise, no crossing edges", min_length=3
    )

    @model_validator(mode="after")
    def _simple(self) -> Self:
        from shapely.geometry import Polygon as Shape

        shape = Shape(self.corners)
        if not (shape.is_valid and shape.exterior.is_ccw and shape.area > 0):
            corners = [list(corner) for corner in self.corners]
            raise broken_rule("corners", corners, "counter-clockwise corners, no crossing edges")
        return self

    @property
    def obstacle(self) -> Polygon:
        return Polygon(self.name, self.height, self.corners)


ObstacleSection = Annotated[
    StepSection | WallSection | CircleSection | PolygonSection, Field(discriminator="kind")
]


def scene_of(ground: GroundSection, obstacles: tuple[ObstacleSection, ...]) -> Scene:
    """The scene that physics and checks drive in. Raises ArgumentError for equal names."""
    standing: list[Obstacle] = [section.obstacle for section in obstacles]
    return Scene(ground.friction, ground.shape, tuple(standing))
