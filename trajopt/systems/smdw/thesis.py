"""How [guzman2015] searches: through drives, in nominal durations. Its problem files leave both
out, as motions are time-scaled where drives follow."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

from trajopt.errors import ArgumentError
from trajopt.problem import Problem

DRIVES = MappingProxyType({"saturation": 30.0, "dead_zone": 2.3})  # rad/s, chosen
DURATIONS = MappingProxyType(  # s, by the name of the file
    {
        "table_5_3": 5.0,  # Table 5.2
        "table_5_3_1s": 1.0,  # Table 5.6
        "scenario_1_forward35": 3.5,  # Table 5.7
        "scenario_1_forward45": 3.5,
        "scenario_1_lateral": 3.5,
        "scenario_2_forward35": 2.5,
        "scenario_2_forward45": 2.5,
        "scenario_2_lateral": 2.5,
    }
)


def through_drives(problem: Problem, changes: Mapping[str, Any] | None = None) -> Problem:
    """The problem as the thesis searches it, with further changed keys. Raises ArgumentError for a
    problem of another file."""
    name = Path(problem.source).stem
    if name not in DURATIONS:
        raise ArgumentError("problem", problem.source, "one of " + ", ".join(DURATIONS))
    section = {"duration": DURATIONS[name], **DRIVES}
    return problem.replace({"actuator": section, **(changes or {})})
