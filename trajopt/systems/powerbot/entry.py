"""What only [waheed2006]'s problems have: [printed], [[encounters]], limits.variant = "thesis".

Encounters are driven by the replanner along the solved path: the motion slows down, stops and
resumes as the obstacles appear and go, seen by the robot's sonar.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import Field

from trajopt.control.encounter import Course, Visitor, course, visited_world
from trajopt.control.encounter_run import Run, run_encounter
from trajopt.control.replan import TIME_STEP, Sensor
from trajopt.limits.limit import Limit
from trajopt.paths.samples import sample_path
from trajopt.schema import NonNegative, Positive, Section, broken_rule
from trajopt.systems.powerbot.constants import REACTION_TIME, SCAN_TIME, SONAR_RANGE
from trajopt.systems.powerbot.limits import ThesisSlide, ThesisSlip, ThesisTip

if TYPE_CHECKING:
    from trajopt.problem.model import Problem
    from trajopt.solution import Solution

_CURVATURE_POINTS = 2001  # where the sharpest bend is looked for
_LONGEST = 10.0  # times the plan's duration, after which an encounter is given up; chosen
SONAR = Sensor(SONAR_RANGE, SCAN_TIME, REACTION_TIME)


class EncounterSection(Section):
    """Something that blocks the path for a while (section 4.3)."""

    appears: NonNegative = Field(description="time, s")
    clears_after: Positive = Field(description="how long it stays, s")
    distance: Positive = Field(description="ahead of the robot's front when it appears, m")


class PrintedSection(Section):
    """What the thesis prints of the planned motion, and how far the points of this file are from
    it."""

    length: Positive = Field(description="m")
    time: Positive = Field(description="of the scaled motion, s")
    unscaled_speed: Positive | None = Field(None, description="largest, one second a segment, m/s")
    unscaled_acceleration: Positive | None = Field(None, description="largest, m/s^2")
    unscaled_deceleration: Positive | None = Field(None, description="largest, m/s^2, positive")
    sliding_speed: Positive | None = Field(None, description="eq. 2.15, m/s")
    fitted: bool = Field(False, description="the inner points are fitted, not printed")
    residuals: dict[str, float] = Field({}, description="(this file - print) / print")


SCHEMAS = {"encounters": EncounterSection, "printed": PrintedSection}


def variant_limits(problem: Problem) -> tuple[Limit, ...]:
    """Slip and tip as the thesis writes them."""
    if problem.job.name != "path":
        raise broken_rule("limits.variant", "thesis", "none: its slip limit is of a given [path]")
    asked, found = problem.limits_section, list[Limit]()
    if asked.slip:
        friction = asked.share * problem.scene.friction
        found.append(ThesisSlip(friction))
        largest = largest_curvature(problem)
        if largest > 1e-9:
            found.append(ThesisSlide(friction, largest))
    if asked.tip:
        found.append(ThesisTip())
    return tuple(found)


def largest_curvature(problem: Problem) -> float:
    """Of the given path in the plane, 1/m."""
    path = problem.flat_path
    places = np.linspace(0, path.length, _CURVATURE_POINTS)
    return float(np.abs(sample_path(path, places).curvature).max())


@dataclass(frozen=True, eq=False)
class Details:
    """The encounters as they are driven along ``solution``, and the print beside it."""

    solution: Solution

    @cached_property
    def course(self) -> Course | None:
        """What the replanner knows of the plan; None without encounters or a plan."""
        trajectory = self.solution.trajectory
        if not self.solution.problem.encounters or trajectory is None:
            return None
        return course(trajectory, self.solution.problem.robot)

    @cached_property
    def run(self) -> Run | None:
        """The motion with its stops; None where there is no course."""
        where = self.course
        if where is None:
            return None
        visitors = [
            Visitor(thing.appears, thing.clears_after, thing.distance)
            for thing in self.solution.problem.encounters
        ]
        longest = _LONGEST * self.solution.duration + sum(v.appears + v.stays for v in visitors)
        return run_encounter(where, SONAR, visited_world(visitors, where.outline), longest=longest)

    @property
    def faults(self) -> tuple[str, ...]:
        run = self.run
        if run is None:
            return ()
        found = []
        if run.hit:
            found.append("an obstacle of [[encounters]] is hit while the robot moves")
        if not run.arrived:
            found.append(
                f"the motion with [[encounters]] has not arrived after {run.times[-1]:.1f} s"
            )
        return tuple(found)

    @property
    def notes(self) -> dict[str, Any]:
        found: dict[str, Any] = {}
        run, printed = self.run, self.solution.problem.printed
        if run is not None:
            standing = (run.v == 0) & (run.s > 0) & (run.s < run.s[-1])
            found["with_encounters"] = {
                "duration_s": float(run.times[-1]),
                "standing_s": float(standing.sum()) * TIME_STEP,
                "arrived": run.arrived,
                "hit": run.hit,
                "stopping_distance_kept": run.kept,
            }
        if printed is not None and self.solution.path is not None:
            ours = {"length": self.solution.path.length, "time": self.solution.duration}
            shown = printed.model_dump(exclude_none=True)
            found["printed"] = {**shown, "ours": ours}
        return found

    def save(self, folder: FilePath, *, pictures: str | None) -> None:
        run, where = self.run, self.course
        if run is None or where is None:
            return
        from trajopt.report.files import write_table

        names = ("t_s", "s_m", "s_dot_m_s", "x_m", "y_m", "yaw_rad", "gap_m")
        columns = (run.times, run.s, run.v, *run.pose.T, run.gap)
        write_table(folder / "with_encounters.csv", dict(zip(names, columns, strict=True)))
        if pictures:
            from trajopt.report.style import in_style, save_figure
            from trajopt.systems.powerbot.pictures import replan_figure

            with in_style():
                save_figure(replan_figure(run, where), folder / f"with_encounters.{pictures}")


def details(solution: Solution) -> Details:
    """What the sections of this module add to a solution."""
    return Details(solution)
