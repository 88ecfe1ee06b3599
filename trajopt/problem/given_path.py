"""Problem files that give the path: knots and directions instead of a search (thesis 004).

The table [path] tells them from other problem files. Lengths are metres, angles radians, times
seconds. The spline runs one unit of its parameter a segment, as the thesis's initial trajectory
runs one second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import cached_property
from pathlib import Path as FilePath
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from trajopt.limits.acceleration import Acceleration
from trajopt.limits.limit import Limit
from trajopt.limits.slip import Slip
from trajopt.limits.speed import Speed
from trajopt.limits.speed_bound import SpeedProfile
from trajopt.limits.tip import Tip
from trajopt.limits.wheel_acceleration import WheelAcceleration
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.limits.yaw_rate import YawRate
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_path
from trajopt.problem.search import (
    NonNegative,
    Positive,
    Section,
    broken_rule,
    read_tables,
    set_key,
    validated,
)
from trajopt.robots.robot import Robot, robot
from trajopt.systems.powerbot.limits import ThesisSlide, ThesisSlip, ThesisTip
from trajopt.world.ramp import Ramp, Ramps, lay_over

Point = tuple[float, float]
_CURVATURE_POINTS = 2001  # where the sharpest bend is looked for


class PathRobot(Section):
    """Which robot moves."""

    name: Literal["powerbot"] = Field("powerbot", description="robot of the package")


class PathSection(Section):
    """Knots of a clamped cubic spline, one unit of its parameter a segment."""

    knots: tuple[Point, ...] = Field(description="x, y, m", min_length=2)
    start_heading: float = Field(description="direction of travel at the first knot, rad")
    goal_heading: float = Field(description="direction of travel at the last knot, rad")
    start_rate: Positive = Field(description="|d position / d parameter| at the first knot, m")
    goal_rate: Positive = Field(description="the same at the last knot, m")

    @model_validator(mode="after")
    def _apart(self) -> Self:
        for i, (a, b) in enumerate(zip(self.knots[:-1], self.knots[1:], strict=True)):
            if math.dist(a, b) < 1e-6:
                raise broken_rule(f"knots[{i + 1}]", list(b), f"a point different from knots[{i}]")
        return self


class RampSection(Section):
    """A ramp on the floor."""

    foot: Point = Field(description="a point of the foot line, x, y, m")
    direction: float = Field(description="in which it rises, rad")
    length: Positive = Field(description="along the slope, m")
    height: float = Field(description="m")
    rounding: Positive = Field(
        0.35, description="edges are rounded over this length, m (axle distance)"
    )

    @model_validator(mode="after")
    def _possible(self) -> Self:
        if not abs(self.height) < self.length:
            raise broken_rule("height", self.height, f"a height below the length {self.length} m")
        return self

    @property
    def ramp(self) -> Ramp:
        run = math.sqrt(self.length**2 - self.height**2)
        return Ramp(self.foot, self.direction, run, self.height, self.rounding)


class PathLimits(Section):
    """Limits of time scaling; leave a key out to leave that limit out."""

    variant: Literal["physical", "thesis"] = Field(
        "physical", description="formulas for slip and tip"
    )
    speed: Positive | None = Field(None, description="of the robot, m/s")
    safety_speed: Positive | None = Field(None, description="to stop for obstacles, m/s")
    acceleration: Positive | None = Field(None, description="of the motors, m/s^2")
    deceleration: Positive | None = Field(None, description="of the motors, m/s^2, positive")
    friction: Positive | None = Field(
        None, description="friction coefficient for slip and sliding out"
    )
    tip: bool = Field(False, description="keep all wheels on the ground")
    yaw_rate: Positive | None = Field(None, description="rad/s")
    wheel_speed: Positive | None = Field(None, description="rad/s")
    wheel_acceleration: Positive | None = Field(None, description="rad/s^2")
    grade: Positive = Field(
        math.radians(8.53), description="steepest slope, rad (default: thesis 004, section 2.3.2.4)"
    )

    @model_validator(mode="after")
    def _both(self) -> Self:
        if (self.acceleration is None) != (self.deceleration is None):
            raise broken_rule(
                "deceleration",
                self.deceleration,
                "acceleration and deceleration both given or both left out",
            )
        return self


class ProfileSection(Section):
    """A speed to follow along the path: linear between places, the last one the end of the path."""

    places: tuple[NonNegative, ...] = Field(
        description="path parameter, m, increasing", min_length=2
    )
    speeds: tuple[NonNegative, ...] = Field(description="m/s, one a place")

    @model_validator(mode="after")
    def _matching(self) -> Self:
        if len(self.places) != len(self.speeds):
            raise broken_rule(
                "speeds", list(self.speeds), f"{len(self.places)} speeds, one a place"
            )
        if any(b <= a for a, b in zip(self.places[:-1], self.places[1:], strict=True)):
            raise broken_rule("places", list(self.places), "increasing path parameters")
        return self


class ObstacleSection(Section):
    """Something that blocks the path for a while (thesis 004, section 4.3)."""

    appears: NonNegative = Field(description="time, s")
    clears_after: Positive = Field(description="how long it stays, s")
    distance: Positive = Field(0.6, description="ahead of the robot's front when it appears, m")


class PrintedSection(Section):
    """What the thesis prints of the planned motion, and how far the knots of this file are from
    it."""

    length: Positive = Field(description="m")
    time: Positive = Field(description="of the scaled motion, s")
    unscaled_speed: Positive | None = Field(None, description="largest, one second a segment, m/s")
    unscaled_acceleration: Positive | None = Field(None, description="largest, m/s^2")
    unscaled_deceleration: Positive | None = Field(None, description="largest, m/s^2, positive")
    sliding_speed: Positive | None = Field(None, description="eq. 2.15, m/s")
    fitted: bool = Field(False, description="the inner knots are fitted, not printed")
    residuals: dict[str, float] = Field({}, description="(this file - print) / print")


class PathProblem(Section):
    """A whole problem with a given path. ``source`` is the file it came from."""

    title: str
    robot: PathRobot = PathRobot()  # type: ignore[call-arg]
    path: PathSection
    ramps: tuple[RampSection, ...] = ()
    limits: PathLimits
    profile: ProfileSection | None = None
    obstacles: tuple[ObstacleSection, ...] = ()
    friction: Annotated[float, Field(gt=0, description="of the floor in the physics check")] = 0.332
    printed: PrintedSection | None = None
    source: str = Field("<problem>", exclude=True, repr=False)

    @cached_property
    def platform(self) -> Robot:
        """The robot."""
        return robot("powerbot")

    @cached_property
    def flat_path(self) -> Path:
        """The path in the plane."""
        section = self.path
        starts, goals = section.start_heading, section.goal_heading
        return Path.through(
            section.knots,
            knots=np.arange(len(section.knots), dtype=np.float64),
            start_direction=[
                section.start_rate * math.cos(starts),
                section.start_rate * math.sin(starts),
            ],
            end_direction=[
                section.goal_rate * math.cos(goals),
                section.goal_rate * math.sin(goals),
            ],
        )

    @cached_property
    def spline(self) -> Path:
        """The path, over the ramps where there are some."""
        return (
            lay_over(self.flat_path, [r.ramp for r in self.ramps]) if self.ramps else self.flat_path
        )

    @cached_property
    def terrain(self) -> Ramps:
        """The ground; its check refuses slopes beyond the robot's grade."""
        return Ramps(tuple(r.ramp for r in self.ramps), self.limits.grade)

    @cached_property
    def largest_curvature(self) -> float:
        """Of the path in the plane, 1/m."""
        path = self.flat_path
        return float(
            np.abs(
                sample_path(path, np.linspace(0, path.length, _CURVATURE_POINTS)).curvature
            ).max()
        )

    def as_limits(
        self, *, variant: Literal["physical", "thesis"] | None = None
    ) -> tuple[Limit, ...]:
        """The limits of the file; ``variant`` overrides its choice of formulas."""
        asked, found = self.limits, list[Limit]()
        if asked.speed is not None:
            found.append(Speed(asked.speed))
        if asked.safety_speed is not None:
            found.append(Speed(asked.safety_speed, name="safety_speed"))
        if asked.acceleration is not None and asked.deceleration is not None:
            found.append(Acceleration(asked.acceleration, asked.deceleration))
        if asked.yaw_rate is not None:
            found.append(YawRate(asked.yaw_rate))
        if asked.wheel_speed is not None:
            found.append(WheelSpeed(asked.wheel_speed))
        if asked.wheel_acceleration is not None:
            found.append(WheelAcceleration(asked.wheel_acceleration))
        return (*found, *self._force_limits(asked.variant if variant is None else variant))

    def _force_limits(self, variant: str) -> list[Limit]:
        asked, found = self.limits, list[Limit]()
        if asked.friction is not None and variant == "physical":
            found.append(Slip(asked.friction))
        elif asked.friction is not None:
            found.append(ThesisSlip(asked.friction))
            if self.largest_curvature > 1e-9:
                found.append(ThesisSlide(asked.friction, self.largest_curvature))
        if asked.tip:
            found.append(Tip() if variant == "physical" else ThesisTip())
        return found

    def speed_profile(self) -> SpeedProfile | None:
        """The speed to follow, as a bound along the path."""
        return (
            None if self.profile is None else SpeedProfile(self.profile.places, self.profile.speeds)
        )

    def replace(self, changes: Mapping[str, Any] | None = None, /, **sections: Any) -> PathProblem:
        """Copy with changes, checked like a file.

        ``changes`` maps dotted keys to values ({"limits.friction": 0.5}); keyword arguments name
        whole sections or parts of them (limits={"friction": 0.5}). None takes a key out. Raises
        ProblemError.
        """
        data = self.model_dump(mode="json", exclude_none=True)
        for key, value in {
            **(changes or {}),
            **{k: v for k, v in sections.items() if "." in k},
        }.items():
            set_key(data, key.split("."), value, self.source)
        for name, value in sections.items():
            if isinstance(value, Mapping) and isinstance(data.get(name), dict):
                data[name].update(value)
            elif "." not in name:
                data[name] = value
        return validated(PathProblem, data, self.source)


def load_path_problem(
    path: str | FilePath, overrides: Mapping[str, Any] | None = None
) -> PathProblem:
    """Path problem from a TOML file; ``overrides`` maps dotted keys to values. Raises ProblemError
    in one line."""
    return validated(PathProblem, read_tables(path, overrides), str(path))
