"""What stands on the ground."""

from __future__ import annotations

import math
from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from trajopt.schema import Point, Positive, Section, broken_rule
from trajopt.world.obstacles import Circle, Polygon, Step, Wall


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
