"""Engines of time scaling by name: one line each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from trajopt.arrays import Array, require_choice
from trajopt.errors import MissingDependencyError
from trajopt.timing.bounds import bounds_profile, only_bounds
from trajopt.timing.compiled import compiled_profile, is_compiled
from trajopt.timing.stages import Stages
from trajopt.timing.toppra import toppra_profile

ENGINES: Mapping[str, Callable[[Stages, float, float], Array]] = MappingProxyType(
    {
        "bounds": bounds_profile,
        "compiled": compiled_profile,
        "toppra": toppra_profile,
    }
)
OTHERS = (
    "auto",
    "linear",
    "segments",
)  # names that choose one of the above, or another way to scale


def is_second_order(name: str) -> bool:
    """Whether it is the core, in which s'' is linear between gridpoints."""
    return name in ("auto", "compiled")


def pick_engine(name: str, stages: Stages) -> str:
    """The engine that ``name`` means for these rows: the fastest that is exact for "auto" and
    "segments"."""
    if name in ENGINES:
        return name
    if only_bounds(stages):
        return "bounds"
    return "compiled" if is_compiled() else "toppra"


def require_engine(name: str) -> None:
    """Raises ArgumentError for an unknown engine, MissingDependencyError for one that is not
    installed."""
    require_choice("engine", name, (*OTHERS, *ENGINES))
    if name == "compiled" and not is_compiled():
        raise MissingDependencyError("numba", "speed", "engine='compiled'")
