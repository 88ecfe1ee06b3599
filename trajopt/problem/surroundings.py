"""What stands on the ground."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Annotated, Literal, Self

from pydantic import Field, model_validator

from trajopt.errors import ArgumentError
from trajopt.schema import Point, Positive, Section, broken_rule
from trajopt.world.obstacles import Circle, Obstacle, Polygon, Step, Wall
from trajopt.world.occupancy import OccupancyMap, load_map

if TYPE_CHECKING:
    import shapely

MAPS = (".yaml", ".yml")  # names of map_server files end so
Corners = tuple[Point, ...]


class _Standing(Section):
    name: str = Field(min_length=1)
    height: Positive = Field(description="m")

    def obstacles(self, folder: FilePath) -> tuple[Obstacle, ...]:  # noqa: ARG002
        """What stands there, in convex or simple parts; files are looked for in ``folder``."""
        return (self.obstacle,)

    @property
    def obstacle(self) -> Obstacle:
        raise NotImplementedError


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


class DoorSection(_Standing):
    """A door's leaf on its hinge, as far open as ``angle`` says."""

    kind: Literal["door"]
    hinge: Point = Field(description="x, y, m")
    direction: float = Field(description="from the hinge along the closed leaf, rad")
    angle: float = Field(description="how far it is open, counter-clockwise, rad")
    width: Positive = Field(description="of the leaf, m")
    thickness: Positive = Field(description="m")

    @property
    def obstacle(self) -> Wall:
        turn = self.direction + self.angle
        x, y = self.hinge
        end = (x + self.width * math.cos(turn), y + self.width * math.sin(turn))
        return Wall(self.name, self.height, self.hinge, end, self.thickness)


class PolygonSection(_Standing):
    """A prism, or one for every polygon of a file."""

    kind: Literal["polygon"]
    corners: Corners | None = Field(
        None, description="x, y, m, counter-clockwise, no crossing edges", min_length=3
    )
    holes: tuple[Corners, ...] = Field(
        (), description="polygons inside that are free, with corners"
    )
    file: str | None = Field(
        None,
        description="instead of corners: GeoJSON, or CSV with columns polygon, x, y (m); from the "
        "problem file's folder",
    )

    @model_validator(mode="after")
    def _simple(self) -> Self:
        if (self.corners is None) == (self.file is None):
            raise broken_rule("corners", self.corners, "corners or file, one of them")
        if self.holes and self.corners is None:
            raise broken_rule("holes", "given", "none: a file has its own")
        if self.corners is not None:
            polygon("corners", self.corners, self.holes)
        return self

    def obstacles(self, folder: FilePath) -> tuple[Obstacle, ...]:
        shapes = list(self.shapes(folder))
        if len(shapes) == 1 and not self.holes:
            return (Polygon(self.name, self.height, _ring(shapes[0])),)
        return tuple(
            Polygon(f"{self.name}/{k}", self.height, _ring(shape)) for k, shape in enumerate(shapes)
        )

    def shapes(self, folder: FilePath) -> Iterator[shapely.Polygon]:
        """Its polygons, cut where they have holes. Raises the broken rule of ``file``."""
        from trajopt.world.keep_out import without_holes

        if self.corners is not None:
            whole: tuple[shapely.Polygon, ...] = (polygon("corners", self.corners, self.holes),)
        else:
            whole = _polygons(f"obstacles.{self.name}.file", folder / str(self.file))
        for shape in whole:
            yield from without_holes(shape)


class MapSection(Section):
    """A map of what is free."""

    file: str = Field(
        description="ROS map_server .yaml with its picture beside it; or .geojson or .csv: the "
        "polygon, with holes, that outlines stay in. From the problem file's folder"
    )
    unknown: Literal["occupied", "free"] | None = Field(
        None, description="what unknown cells of a .yaml map count as; absent: occupied"
    )

    @model_validator(mode="after")
    def _cells(self) -> Self:
        if self.unknown is not None and not self.cells:
            raise broken_rule("unknown", self.unknown, "none: only a .yaml map has unknown cells")
        return self

    @property
    def cells(self) -> bool:
        """Whether it is a grid of cells."""
        return FilePath(self.file).suffix.lower() in MAPS

    def occupancy(self, folder: FilePath) -> OccupancyMap:
        """The grid. Raises the broken rule of ``map.file``."""
        try:
            return load_map(folder / self.file, unknown=self.unknown or "occupied")
        except ArgumentError as error:
            raise broken_rule("map.file", self.file, str(error)) from None

    def area(self, folder: FilePath) -> shapely.Polygon:
        """The one polygon. Raises the broken rule of ``map.file``."""
        found = _polygons("map.file", folder / self.file)
        if len(found) != 1:
            raise broken_rule("map.file", self.file, f"one polygon, not {len(found)}")
        return found[0]


def polygon(key: str, corners: Corners, holes: tuple[Corners, ...]) -> shapely.Polygon:
    """The polygon of a table. Raises the broken rule of its ``key``."""
    from shapely.geometry import Polygon as Shape

    outer = Shape(corners)
    if not (outer.is_valid and outer.exterior.is_ccw and outer.area > 0):
        expected = "counter-clockwise corners, no crossing edges"
        raise broken_rule(key, [list(corner) for corner in corners], expected)
    whole = Shape(corners, holes)
    if holes and not (whole.is_valid and all(len(hole) >= 3 for hole in holes)):
        expected = "holes of three corners or more inside the corners, apart from each other"
        raise broken_rule("holes", [list(map(list, hole)) for hole in holes], expected)
    return whole


def _polygons(key: str, file: FilePath) -> tuple[shapely.Polygon, ...]:
    from trajopt.world.shape_files import load_polygons

    try:
        return load_polygons(file)
    except ArgumentError as error:
        raise broken_rule(key, str(file), str(error)) from None


def _ring(shape: shapely.Polygon) -> Corners:
    from shapely.geometry.polygon import orient

    return tuple((x, y) for x, y in orient(shape).exterior.coords[:-1])


ObstacleSection = Annotated[
    StepSection | WallSection | DoorSection | CircleSection | PolygonSection,
    Field(discriminator="kind"),
]
