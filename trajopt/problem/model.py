"""A problem: robot, scene and task in one file, read strictly.

Lengths are metres, angles radians, times seconds; axes are right-handed (x forward, y left, yaw
counter-clockwise). Per-wheel arrays are over ``robot.wheel_names``.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.limits.friction import Friction
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.problem.checks import check
from trajopt.problem.extensions import Climb, Encounters, Printed, variant_entry
from trajopt.problem.given import PathSection, ProfileSection, inlined
from trajopt.problem.ground import GroundSection, least
from trajopt.problem.jobs import Job, job_of
from trajopt.problem.limits import LimitsSection
from trajopt.problem.robot import RobotSection, robot_of, robot_tables
from trajopt.problem.surroundings import MapSection, ObstacleSection, PolygonSection
from trajopt.problem.task import ActuatorSection, Goal, ObjectiveSection, Space, Spline, Start
from trajopt.robots.robot import Robot
from trajopt.schema import (
    Point3,
    Section,
    as_problem_error,
    broken_rule,
    changes_of,
    set_key,
    validated,
)
from trajopt.shown import Shown
from trajopt.world.laid import lay
from trajopt.world.scene import Scene

if TYPE_CHECKING:
    import shapely

Aim = Literal["duration", "length"]


@dataclass(frozen=True, eq=False)
class Search:
    """What the control points of a path are searched for: ``start`` and ``goal`` (x, y, yaw),
    ``wheels`` (W,) wanted at the end (those that count are ``critical``, by position), ``free``
    control values inside ``space``."""

    start: Point3
    goal: Point3
    wheels: Array
    critical: tuple[int, ...]
    free: tuple[str, ...]
    space: Space


class Problem(Section, Shown):
    """A whole problem: which sections are there decides what ``solve`` does (``job``).

    ``source`` is the file it came from; ``replace`` makes changed copies.
    """

    title: str = Field(min_length=1)
    infeasible: str | None = Field(
        None, description="why no solution holds, where that is known", min_length=1
    )
    robot_section: RobotSection = Field(alias="robot")
    ground: GroundSection
    obstacles: tuple[ObstacleSection, ...] = ()
    map: MapSection | None = None
    limits_section: LimitsSection = Field(alias="limits")
    start: Start | None = None
    goal: Goal | None = None
    space: Space | None = None
    spline: Spline | None = None
    objective: ObjectiveSection = ObjectiveSection()  # type: ignore[call-arg]
    actuator: ActuatorSection | None = None
    path_section: PathSection | None = Field(None, alias="path")
    profile: ProfileSection | None = None
    climb: Climb = None
    encounters: Encounters = None
    printed: Printed = None
    source: str = Field("<problem>", exclude=True, repr=False)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        _ = self.job, self.robot, self.scene
        check(self)
        return self

    def __eq__(self, other: object) -> bool:
        """Whether the files say the same: what follows from them is not compared."""
        if not isinstance(other, Problem):
            return NotImplemented
        return self.tables() == other.tables()

    # -- what the sections say -------------------------------------------------------------------

    def __repr__(self) -> str:
        return f"Problem({self.title!r}, {self.job.name}, {self.robot_section.name or self.robot_section.file})"

    @property
    def given(self) -> set[str]:
        """Names of the sections that the file has."""
        fields = type(self).model_fields
        found = {fields[name].alias or name for name in self.model_fields_set - {"source"}}
        return {name for name in found if self._value(name) not in (None, ())}

    def _value(self, section: str) -> Any:
        own = ("robot", "limits", "path")
        return getattr(self, f"{section}_section" if section in own else section)

    @cached_property
    def job(self) -> Job:
        """What ``solve`` does with it."""
        return job_of(self.given)

    @property
    def folder(self) -> FilePath:
        """Where files that the problem names are looked for."""
        return FilePath(self.source).parent

    @cached_property
    def robot(self) -> Robot:
        """The robot that moves."""
        return robot_of(self.robot_section.model_dump(mode="json"), self.folder)

    @cached_property
    def scene(self) -> Scene:
        """Where it moves."""
        standing = tuple(o for part in self.obstacles for o in part.obstacles(self.folder))
        friction, ground = self.friction, self.ground.shape(self.folder)
        cells = None
        if self.map is not None and self.map.cells:
            cells = self.map.occupancy(self.folder)
        try:
            return Scene(
                least(friction), ground, standing, not isinstance(friction, float), cells, self.area
            )
        except ArgumentError as error:
            raise broken_rule("obstacles.name", error.value, error.expected) from None

    @cached_property
    def area(self) -> shapely.Polygon | None:
        """Where the outline stays on a route or a given path; None where nothing says so."""
        if self.job.name not in ("route", "path"):
            return None
        found = None if self.space is None else self.space.area
        if self.map is None or self.map.cells:
            return found
        area = self.map.area(self.folder)
        if found is None:
            return area
        both = area.intersection(found)
        if both.geom_type != "Polygon" or both.is_empty:
            expected = "one polygon in common with [map]"
            raise broken_rule("space", f"a {both.geom_type} in common", expected)
        return both

    @cached_property
    def aim(self) -> Aim:
        """What a route is chosen by."""
        return "length" if self.objective.kind == "length" else "duration"

    @cached_property
    def friction(self) -> Friction:
        """Between wheels and ground."""
        return self.ground.coefficient(self.folder)

    @cached_property
    def limits(self) -> tuple[Limit, ...]:
        """What it keeps, the motors' limits included."""
        asked = self.limits_section
        found = asked.limits(self.robot, self.friction)
        if asked.variant is not None:
            found += tuple(variant_entry(asked.variant).variant_limits(self))
        return found

    @cached_property
    def flat_path(self) -> Path:
        """The given path in the plane. Raises ArgumentError where none is given."""
        if self.path_section is None:
            raise ArgumentError("problem", self.title, "a problem with a given path, [path]")
        return self.path_section.path(self.folder, self.robot.turning_length)

    @cached_property
    def path(self) -> Path:
        """The given path, laid on the ground. Raises InfeasibleError where it cannot be driven
        there."""
        ground = self.scene.ground
        return self.flat_path if ground.level else lay(self.flat_path, ground)

    @cached_property
    def search(self) -> Search:
        """What is searched for. Raises ArgumentError where nothing is."""
        start, goal, spline, space = self.start, self.goal, self.spline, self.space
        if start is None or start.pose is None or goal is None or spline is None or space is None:
            raise ArgumentError(
                "problem", self.title, "a problem whose control points are searched"
            )
        wheels = np.zeros(len(self.robot.wheels)) if goal.wheels is None else np.array(goal.wheels)
        return Search(start.pose, goal.pose, wheels, self.critical_indices, spline.free, space)

    @property
    def start_wheels(self) -> Array:
        """(W,): wheel angles at the start, rad."""
        wheels = None if self.start is None else self.start.wheels
        return np.zeros(len(self.robot.wheels)) if wheels is None else np.array(wheels)

    @property
    def start_steering(self) -> dict[str, float]:
        """Steering and castor angles at the start that are given, rad, by wheel."""
        return {} if self.start is None or self.start.steering is None else self.start.steering

    @property
    def critical(self) -> tuple[str, ...]:
        """Names of the wheels whose final angle counts."""
        return () if self.goal is None or self.goal.critical is None else self.goal.critical

    @property
    def critical_indices(self) -> tuple[int, ...]:
        """Their positions in per-wheel arrays."""
        return tuple(self.robot.wheel_names.index(name) for name in self.critical)

    # -- copies ------------------------------------------------------------------------------------

    def tables(self) -> dict[str, Any]:
        """The tables of its file."""
        tables = self.model_dump(mode="json", exclude_none=True, by_alias=True)
        if "objective" not in self.model_fields_set:
            del tables["objective"]
        return tables

    @property
    def files(self) -> dict[str, FilePath]:
        """Files that it names, but for those of robot and path, by the dotted key of their table."""
        found = {f"ground.{key}": file for key, file in self.ground.files.items()}
        found |= {"map": self.map.file} if self.map is not None else {}
        for i, section in enumerate(self.obstacles):
            if isinstance(section, PolygonSection) and section.file is not None:
                found[f"obstacles.{i}"] = section.file
        return {key: self.folder / file for key, file in found.items()}

    def standalone(self, names: Mapping[str, str] | None = None) -> dict[str, Any]:
        """The tables of a file that needs no other file of the user's, but for ``files``: ``names``
        are new ones of these, by the key of their table."""
        tables = self.tables()
        for key, file in (names or {}).items():
            set_key(tables, f"{key}.file", file, self.source)
        if self.robot_section.file is not None:
            tables["robot"] = robot_tables(tables["robot"], self.folder)
        if self.path_section is not None:
            tables["path"] = inlined(self.path_section, self.folder)
        return tables

    def replace(self, changes: Mapping[str, Any] | None = None, /, **sections: Any) -> Problem:
        """Copy with changes, checked like a file.

        ``changes`` maps dotted keys to values ({"goal.wheels": [0, 0, 0, 0]}), None takes a key
        out; keyword arguments name whole sections or parts of them (limits={"speed": 1.0}). Raises
        ProblemError.
        """
        data = self.tables()
        for key, value in changes_of(changes, self.source):
            change_key(data, key, value, self.source)
        for name, value in sections.items():
            if isinstance(value, Mapping) and isinstance(data.get(name), dict):
                for key, part in value.items():
                    change_key(data, f"{name}.{key}", part, self.source)
            else:
                change_key(data, name, value, self.source)
        return validated(Problem, data, self.source)


def change_key(data: dict[str, Any], dotted: str, value: Any, file: str) -> None:
    """``set_key`` in the tables of a problem; a key of the robot that is taken out is one of its
    own file, so the whole robot then stands in the tables."""
    section = data.get("robot")
    deep = dotted.startswith("robot.") and dotted.count(".") > 1
    if value is None and deep and isinstance(section, dict):
        try:
            data["robot"] = robot_tables(section, FilePath(file).parent)
        except PydanticCustomError as error:
            raise as_problem_error(error, file) from None
    set_key(data, dotted, value, file)
