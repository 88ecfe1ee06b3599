"""Which sections make which job."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass

from trajopt.schema import broken_rule

ALWAYS = frozenset({"title", "robot", "limits", "ground", "obstacles", "infeasible"})


@dataclass(frozen=True)
class Job:
    """What ``solve`` does with a problem, the sections it needs and those it can use."""

    name: str
    about: str
    needs: frozenset[str]
    uses: frozenset[str] = frozenset()

    def missing(self, given: Set[str]) -> list[str]:
        return sorted(self.needs - given)

    def unused(self, given: Set[str]) -> list[str]:
        return sorted(given - self.needs - self.uses - ALWAYS)


JOBS = (
    Job(
        "search",
        "searches control points of a spline",
        frozenset({"start", "goal", "spline", "space"}),
        frozenset({"objective", "actuator"}),
    ),
    Job(
        "path",
        "times a given path",
        frozenset({"path"}),
        frozenset({"start", "profile", "encounters", "printed", "map", "space"}),
    ),
    Job(
        "route",
        "finds a way from start to goal among what stands there",
        frozenset({"start", "goal"}),
        frozenset({"map", "space", "objective"}),
    ),
    Job("climb", "plans how to get over a step", frozenset({"start", "climb", "space"})),
)


def job_of(given: Set[str]) -> Job:
    """The job of a problem with these sections. Raises the broken rule, naming the nearest job and
    what to add or to take out."""

    def distance(job: Job) -> int:
        return len(job.missing(given)) + len(job.unused(given))

    nearest = min(JOBS, key=distance)
    if distance(nearest) == 0:
        return nearest
    advice = [f"add [{name}]" for name in nearest.missing(given)]
    advice += [f"take out [{name}]" for name in nearest.unused(given)]
    key = (nearest.unused(given) or nearest.missing(given))[0]
    sections = sorted(given - ALWAYS)
    raise broken_rule(
        key,
        "given with " + ", ".join(sections) if key in given else "missing",
        f"sections of one job; the nearest is '{nearest.name}', which {nearest.about}: "
        + ", ".join(advice),
    )
