"""Manoeuvre problems: an obstacle, a start and a space; the planner decides how to meet the
obstacle.

The table [obstacle] tells these files from other problem files. Lengths are metres, angles radians,
times seconds; axes right-handed, yaw counter-clockwise.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path as FilePath
from typing import Any, Literal, Self

from pydantic import Field, model_validator

from trajopt.problem.search import (
    Limits,
    NonNegative,
    Positive,
    Section,
    Space,
    Start,
    broken_rule,
    read_tables,
    set_key,
    validated,
)
from trajopt.robots.robot import Robot
from trajopt.systems.smdw.climbing import DEFAULT_WHEEL, loc8_smdw
from trajopt.systems.smdw.geometry import DoubleWheel
from trajopt.world.free_ground import FreeGround

Rank = Literal["duration", "margin", "climb_rate"]


class ManeuverRobot(Section):
    """LOC8 on double wheels; the hub sizes may be changed."""

    name: Literal["loc8-smdw"] = Field("loc8-smdw", description="robot of the package")
    minor_radius: Positive = Field(
        DEFAULT_WHEEL.minor_radius, description="half-axis Re of the hubs' ellipse, m"
    )
    hub_depth: Positive = Field(DEFAULT_WHEEL.depth, description="of one hub along the axle, m")
    hub_gap: NonNegative = Field(DEFAULT_WHEEL.gap, description="between the hubs, m")
    torque_limit: Positive = Field(8.0, description="at a wheel, in the physics check, N m")

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if self.minor_radius > DEFAULT_WHEEL.radius:
            raise broken_rule(
                "minor_radius",
                self.minor_radius,
                f"a length up to the radius {DEFAULT_WHEEL.radius} m",
            )
        return self

    @property
    def wheel(self) -> DoubleWheel:
        return DoubleWheel(DEFAULT_WHEEL.radius, self.minor_radius, self.hub_depth, self.hub_gap)


class ObstacleSection(Section):
    """A step across the whole space."""

    height: Positive = Field(description="m")
    place: tuple[float, float] = Field(
        description="x, y on its edge where the leading wheel shall meet it, m"
    )
    direction: float = Field(0.0, description="yaw of its normal, pointing into the step, rad")

    @property
    def normal(self) -> tuple[float, float]:
        return math.cos(self.direction), math.sin(self.direction)


class ApproachSection(Section):
    """How the step is approached, and what makes one plan better than another."""

    gap: NonNegative = Field(
        0.02, description="room between footprint and step at the end of the approach, m"
    )
    rank: Rank = Field(
        "duration", description="duration, margin (of the wheel phase), or climb_rate"
    )


class GroundSection(Section):
    """What the physics check drives on."""

    friction: Positive = Field(0.8, description="friction coefficient between rollers and ground")


class ManeuverProblem(Section):
    """A whole manoeuvre problem. ``source`` is the file it came from; ``replace`` makes changed
    copies."""

    title: str
    robot: ManeuverRobot = ManeuverRobot()  # type: ignore[call-arg]
    start: Start
    obstacle: ObstacleSection
    space: Space
    approach: ApproachSection = ApproachSection()  # type: ignore[call-arg]
    limits: Limits
    ground: GroundSection = GroundSection()  # type: ignore[call-arg]
    source: str = Field("<problem>", exclude=True, repr=False)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        complaint = self.free_ground.complaint(*self.start.pose)
        if complaint:
            raise broken_rule(
                "start.pose",
                list(self.start.pose),
                f"a start inside the space and before the step; here {complaint}",
            )
        if not self.limits.as_limits():
            raise broken_rule("limits", {}, "at least one limit")
        return self

    @property
    def platform(self) -> Robot:
        """The robot's kinematics, body and footprint."""
        return loc8_smdw(self.robot.wheel)

    @property
    def free_ground(self) -> FreeGround:
        """Where the footprint may be."""
        nx, ny = self.obstacle.normal
        distance = nx * self.obstacle.place[0] + ny * self.obstacle.place[1]
        return FreeGround(self.space.x, self.space.y, (nx, ny), distance, self.platform.footprint)

    def replace(self, changes: Mapping[str, Any]) -> ManeuverProblem:
        """Copy with changed dotted keys ({"obstacle.height": 0.035}), checked like a file. Raises
        ProblemError."""
        data = self.model_dump(mode="json", exclude_none=True)
        for key, value in changes.items():
            set_key(data, key.split("."), value, self.source)
        return validated(ManeuverProblem, data, self.source)


def load_maneuver(
    path: str | FilePath, overrides: Mapping[str, Any] | None = None
) -> ManeuverProblem:
    """Manoeuvre problem from a TOML file; ``overrides`` maps dotted keys to values. Raises
    ProblemError."""
    return validated(ManeuverProblem, read_tables(path, overrides), str(path))
