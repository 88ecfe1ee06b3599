"""Units of a sweep's columns: of keys of problem files as the schema says, and of what ``run_case`` tells."""

from __future__ import annotations

import json
from functools import cache
from typing import Any

from trajopt.problem import problem_schema

_UNITS = ("m", "m/s", "m/s^2", "rad", "rad/s", "rad/s^2", "s", "kg", "N m", "W", "J", "1/rad")
_OUTCOMES = {
    "duration": "s", "energy": "J", "seconds": "s", "driven.along": "m", "driven.across": "m", "driven.yaw": "rad",
    "driven.wheel_error": "rad", "driven.path_rms": "m", "driven.path_max": "m", "wheel_error": "rad",
}  # fmt: skip


def with_unit(column: str) -> str:
    """A column's name with its unit in brackets."""
    return f"{column} ({unit_of(column)})"


def unit_of(column: str) -> str:
    """Unit of a column, "–" where it has none, "as stored" where only its maker knows."""
    words = [word for word in column.split(".") if not word.isdigit()]
    if ".".join(words) in _OUTCOMES:
        return _OUTCOMES[".".join(words)]
    if words[-1] == "friction":
        return "–"
    found = _of_keys().get(words[-1], set()) if len(words) > 1 else set()
    return found.copy().pop() if len(found) == 1 else "as stored"


@cache
def _of_keys() -> dict[str, set[str]]:
    """Units that descriptions of a key name, whatever section it is of."""
    found: dict[str, set[str]] = {}
    definitions: dict[str, Any] = json.loads(problem_schema())["$defs"]
    for definition in definitions.values():
        for key, facts in definition.get("properties", {}).items():
            texts = facts.get("description", "").replace(";", ",").split(",")
            found.setdefault(key, set()).update(
                unit for unit in map(str.strip, texts) if unit in _UNITS
            )
    return found
