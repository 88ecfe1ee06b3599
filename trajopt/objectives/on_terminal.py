"""What objectives over a terminal objective's decision variables take from it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from trajopt.arrays import Array
from trajopt.objectives.base import AffinePart
from trajopt.objectives.terminal import TerminalObjective
from trajopt.paths.path import Path


@dataclass(frozen=True)
class OnTerminal:
    """Base of objectives with ``terminal``'s variables and paths and a violation of their own;
    residuals, lattice and Newton see the terminal objective."""

    terminal: TerminalObjective

    @property
    def dimension(self) -> int:
        return self.terminal.dimension

    @property
    def bounds(self) -> Array:
        return self.terminal.bounds

    @property
    def constrained(self) -> bool:
        return True

    def prepare(self) -> None:
        """Compile what evaluations use, which is no part of a search."""
        self.terminal.prepare()

    def impossible(self) -> str:
        """Why no motion reaches the goal pose; empty where that is not proved."""
        return self.terminal.impossible()

    def path(self, candidate: Array) -> Path:
        """The path through the control points of one candidate (d,)."""
        return self.terminal.path(candidate)

    def residuals(self, z: Any, turns: Any, *, exact: bool = False) -> list[Any]:
        return self.terminal.residuals(z, turns, exact=exact)

    def residual_gains(self) -> Array:
        return self.terminal.residual_gains()

    def nearest_turns(self, candidates: Array) -> Array:
        return self.terminal.nearest_turns(candidates)

    def coarse(self) -> TerminalObjective:
        return self.terminal.coarse()

    def affine_part(self) -> AffinePart:
        return self.terminal.affine_part()
