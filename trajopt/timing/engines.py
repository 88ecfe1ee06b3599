"""Engines of time scaling by name: one line each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from types import MappingProxyType

from trajopt.arrays import Array, require_choice
from trajopt.timing.compiled import compiled_profile
from trajopt.timing.stages import Stages
from trajopt.timing.toppra import toppra_profile

ENGINES: Mapping[str, Callable[[Stages, float, float], Array]] = MappingProxyType(
    {
        "compiled": compiled_profile,
        "toppra": toppra_profile,
    }
)
OTHERS = ("auto", "linear", "segments")  # the core, and slower motions


def is_second_order(name: str) -> bool:
    """Whether it is the core, in which s'' is linear between gridpoints."""
    return name in ("auto", "compiled")


def require_engine(name: str) -> None:
    """Raises ArgumentError for an unknown engine."""
    require_choice("engine", name, (*OTHERS, *ENGINES))
