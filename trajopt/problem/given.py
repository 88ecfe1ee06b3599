"""A given path, of one piece or several, and a speed profile to follow along it."""

from __future__ import annotations

import itertools
import math
from pathlib import Path as FilePath
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.files import read_table
from trajopt.limits.speed_bound import SpeedProfile
from trajopt.paths.path import Path
from trajopt.paths.race_line import read_race_line
from trajopt.paths.segments import Arc, Clothoid, Segment, Straight
from trajopt.schema import NonNegative, Point, Point3, Positive, Section, broken_rule


class StraightSection(Section):
    """A straight line."""

    kind: Literal["straight"]
    length: Positive = Field(description="m")

    @property
    def segment(self) -> Segment:
        return Straight(self.length)


class ArcSection(Section):
    """An arc of a circle."""

    kind: Literal["arc"]
    radius: Positive = Field(description="m")
    angle: float = Field(description="by which it turns, rad, positive to the left; not 0")

    @property
    def segment(self) -> Segment:
        return Arc(self.radius, self.angle)


class ClothoidSection(Section):
    """Curvature that goes evenly from one value to another."""

    kind: Literal["clothoid"]
    length: Positive = Field(description="m")
    start: float = Field(description="curvature at its start, 1/m, positive to the left")
    end: float = Field(description="curvature at its end, 1/m")

    @property
    def segment(self) -> Segment:
        return Clothoid(self.length, self.start, self.end)


SegmentSection = Annotated[
    StraightSection | ArcSection | ClothoidSection, Field(discriminator="kind")
]


class PieceSection(Section):
    """A cubic spline through points, given here or in a CSV file; or straight lines, arcs and
    clothoids."""

    points: tuple[Point, ...] | None = Field(None, description="x, y, m", min_length=2)
    file: str | None = Field(
        None,
        description="CSV with columns x, y (m), and yaw (rad) where the heading is free; or a race "
        "line of the TUM's planner (s_m; x_m; ...), of which points and heading are taken",
    )
    segments: tuple[SegmentSection, ...] | None = Field(
        None, description="one after the other from start", min_length=1
    )
    start: Point3 | None = Field(
        None,
        description="x, y (m) and direction of travel (rad) where segments begin; in a piece absent: "
        "where the piece before ends",
    )
    drive: Literal["forward", "backward"] = Field(
        "forward", description="backward: the robot faces against the direction of travel"
    )
    heading: Literal["along", "free"] = Field(
        "along", description="along: the direction of travel; free: as headings say"
    )
    headings: tuple[float, ...] | None = Field(
        None, description="yaw at the points, rad, with a free heading"
    )
    spacing: Literal["chord", "uniform"] = Field(
        "chord", description="of the points in the spline's parameter: chord lengths, or 1 each"
    )
    start_heading: float | None = Field(
        None, description="direction of travel at the first point, rad; absent: a natural end"
    )
    start_rate: Positive | None = Field(
        None, description="|d position / d parameter| there, m a unit of the parameter"
    )
    goal_heading: float | None = Field(None, description="the same at the last point, rad")
    goal_rate: Positive | None = Field(None, description="the same at the last point, m a unit")

    _one_of: ClassVar[tuple[str, ...]] = ("points", "file", "segments")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = [key for key in self._one_of if getattr(self, key) is not None]
        if len(given) != 1:
            key = given[1] if given else "points"
            expected = f"{', '.join(self._one_of[:-1])} or {self._one_of[-1]}, one of them"
            raise broken_rule(key, "given" if given else None, expected)
        self._refuse_unused(given[0])
        for end in ("start", "goal"):
            if (getattr(self, f"{end}_heading") is None) != (getattr(self, f"{end}_rate") is None):
                value = getattr(self, f"{end}_rate")
                expected = f"{end}_heading and {end}_rate both given or both left out"
                raise broken_rule(f"{end}_rate", value, expected)
        if self.heading == "free" and self.drive == "backward":
            expected = '"forward" with heading = "free": headings say which way the robot faces'
            raise broken_rule("drive", self.drive, expected)
        if self.headings is not None and self.heading == "along":
            raise broken_rule("headings", list(self.headings), 'none, or heading = "free"')
        if self.points is None and self.headings is not None:
            raise broken_rule("headings", list(self.headings), "none: the file has a yaw")
        if self.points is not None:
            if self.heading == "free" and self.headings is None:
                raise broken_rule("headings", None, "one yaw a point, as heading is free")
            _require_apart("points", self.points)
            if self.headings is not None and len(self.headings) != len(self.points):
                expected = f"{len(self.points)} angles, one a point"
                raise broken_rule("headings", list(self.headings), expected)
        return self

    def _refuse_unused(self, by: str) -> None:
        """Keys that act only on another kind of path than ``by``."""
        uses = {"segments": {"segments", "start", "drive"}, "pieces": {"pieces", "stops"}}
        for key, info in type(self).model_fields.items():
            used = key in uses[by] if by in uses else key not in ("start", "segments", "pieces")
            if not (used or key == "stops") and getattr(self, key) != info.default:
                raise broken_rule(key, getattr(self, key), f"none with {by}")

    def path(self, folder: FilePath, turning_length: float, before: Path | None = None) -> Path:
        """The path in the plane; a file is looked for in ``folder``. ``before``: the piece that ends
        where this one begins. Raises ArgumentError."""
        found = self._curve(folder, turning_length, before)
        return found.backward() if self.drive == "backward" else found

    def _curve(self, folder: FilePath, turning_length: float, before: Path | None) -> Path:
        if self.segments is not None:
            start = self.start
            if start is None:
                if before is None:
                    raise ArgumentError("start", None, "x, y, direction of travel")
                x, y, _ = before.position([before.end])[0].tolist()
                turn = math.pi if self.drive == "backward" else 0.0
                start = x, y, float(before.yaw([before.end])[0]) + turn
            segments = []
            for n, section in enumerate(self.segments):
                try:
                    segments.append(section.segment)
                except ArgumentError as error:
                    key = f"segments[{n}].{error.argument}"
                    raise ArgumentError(key, error.value, error.expected) from None
            return Path.segments(segments, start=start)
        points, headings = self.points, self.headings
        if self.file is not None:
            points, headings = read_points(folder / self.file, self.heading == "free")
        assert points is not None  # one of them is given
        count = len(points)
        return Path.through(
            points,
            heading=headings,
            knots=np.arange(count, dtype=np.float64) if self.spacing == "uniform" else None,
            start_direction=_direction(self.start_heading, self.start_rate),
            end_direction=_direction(self.goal_heading, self.goal_rate),
            turning_length=turning_length,
        )


class PathSection(PieceSection):
    """A path: one piece, or several with a stop where they meet."""

    pieces: tuple[PieceSection, ...] | None = Field(
        None,
        description="one after the other; the robot rests where they meet, and may turn back there",
        min_length=1,
    )
    stops: tuple[Positive, ...] = Field(
        (),
        description="path parameters, m, increasing, where the robot comes to rest on the way; "
        "steered wheels may turn there",
    )

    _one_of: ClassVar[tuple[str, ...]] = ("points", "file", "segments", "pieces")

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if any(b <= a for a, b in itertools.pairwise(self.stops)):
            raise broken_rule("stops", list(self.stops), "increasing path parameters, m")
        return self

    @property
    def free(self) -> bool:
        """Whether a heading of its own is given anywhere."""
        return "free" in (part.heading for part in (self, *(self.pieces or ())))

    def path(self, folder: FilePath, turning_length: float, before: Path | None = None) -> Path:
        if self.pieces is None:
            return super().path(folder, turning_length, before)
        found = list[Path]()
        for n, piece in enumerate(self.pieces):
            try:
                found.append(piece.path(folder, turning_length, found[-1] if found else None))
            except ArgumentError as error:
                key = f"pieces[{n}].{error.argument}"
                raise ArgumentError(key, error.value, error.expected) from None
        return Path.join(found)


def read_points(
    file: FilePath, with_yaw: bool
) -> tuple[tuple[Point, ...], tuple[float, ...] | None]:
    """Points and yaws of a CSV file. Raises the broken rule of ``file``."""
    names = ("x", "y", "yaw") if with_yaw else ("x", "y")
    try:
        table = _race_line(file, with_yaw)
        if table is None:
            table = np.column_stack(list(read_table(file, names).values()))
    except ArgumentError as error:
        expected = f"a CSV file with columns {', '.join(names)} ({error})"
        raise broken_rule("path.file", str(file), expected) from None
    if len(table) < 2:
        raise broken_rule("path.file", str(file), "a CSV file of two rows or more")
    points = tuple((float(x), float(y)) for x, y in table[:, :2])
    _require_apart("path.file", points)
    return points, tuple(table[:, 2].tolist()) if with_yaw else None


def _race_line(file: FilePath, with_yaw: bool) -> Array | None:
    """(N, 2) or (N, 3): x, y (m) and yaw (rad) of a race line; None of what is none."""
    try:
        line = read_race_line(file)
    except (OSError, ValueError) as error:
        if isinstance(error, ArgumentError):
            raise
        return None  # ``read_table`` says why
    if line is None:
        return None
    return np.column_stack([line.points, line.heading]) if with_yaw else line.points


def _require_apart(key: str, points: tuple[Point, ...]) -> None:
    for i, (a, b) in enumerate(itertools.pairwise(points)):
        if math.dist(a, b) < 1e-6:
            raise broken_rule(f"{key}[{i + 1}]", list(b), f"a point different from {key}[{i}]")


def _direction(heading: float | None, rate: float | None) -> list[float] | None:
    if heading is None or rate is None:
        return None
    return [rate * math.cos(heading), rate * math.sin(heading)]


class ProfileSection(Section):
    """A speed to follow along the path: linear between places, constant before and after them."""

    places: tuple[NonNegative, ...] = Field(
        description="path parameter, m, increasing, up to the path's length", min_length=1
    )
    speeds: tuple[NonNegative, ...] = Field(description="m/s, one a place")
    manner: Literal["below", "least_squares"] = Field(
        "below", description="nowhere faster; or closest in the least-squares sense"
    )

    @model_validator(mode="after")
    def _matching(self) -> Self:
        try:
            SpeedProfile(self.places, self.speeds)
        except ArgumentError as error:
            raise broken_rule(error.argument.split(".")[-1], error.value, error.expected) from None
        return self

    @property
    def bound(self) -> SpeedProfile:
        return SpeedProfile(self.places, self.speeds)


def inlined(path: PieceSection, folder: FilePath) -> dict[str, Any]:
    """Tables of the section with what its files hold, so that they stand alone."""
    tables = path.model_dump(mode="json", exclude_none=True)
    if path.file is not None:
        points, headings = read_points(folder / path.file, path.heading == "free")
        del tables["file"]
        tables["points"] = [list(p) for p in points]
        if headings is not None:
            tables["headings"] = list(headings)
    if isinstance(path, PathSection) and path.pieces is not None:
        tables["pieces"] = [inlined(piece, folder) for piece in path.pieces]
    return tables
