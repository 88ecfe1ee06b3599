"""Keeping a robot's footprint on free ground along the whole path, as a violation.

The violation is the depth (m) by which it leaves that ground at the worst place; searches see it on
a coarse grid with a small reserve, ``score`` recomputes it without one on a grid ten times finer.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.base import Capability, Evaluation, SymbolicProblem
from trajopt.objectives.duration import DurationObjective
from trajopt.objectives.on_terminal import OnTerminal
from trajopt.objectives.rollout import step_grid
from trajopt.objectives.terminal import TerminalObjective
from trajopt.world.crossing import Standing
from trajopt.world.free_ground import FreeGround, path_margin

SEARCH_STEPS = 36  # steps along the path in a search, chosen: 6 cm on a 2 m path
RESERVE = (
    0.002  # m, chosen: more than a corner strays between two search steps (its sagitta, about 1 mm)
)


@dataclass(frozen=True)
class ClearObjective(OnTerminal):
    """An objective whose violation also says how far the footprint leaves its free ground (m): the
    terminal one, or ``duration``."""

    ground: FreeGround | Standing
    steps: int = SEARCH_STEPS
    duration: DurationObjective | None = None

    @property
    def inner(self) -> TerminalObjective | DurationObjective:
        """What costs."""
        return self.terminal if self.duration is None else self.duration

    @property
    def provides(self) -> frozenset[Capability]:
        return self.inner.provides - {Capability.GRADIENT}

    @cached_property
    def _values(self) -> Array:
        return step_grid(self.terminal.basis, self.steps).node_value

    def rooms(self, candidates: Array) -> Array:
        """(n, k): least distance (m) of each corner from each border (of the footprint from the
        obstacles) along the path of each candidate (n, d), search grid."""
        points = self.terminal.control_points(np.asarray(candidates, dtype=np.float64).T)
        poses = (self._values @ points.x, self._values @ points.y, self._values @ points.yaw)
        rooms = self.ground.rooms(*poses) or [self.ground.margin(*poses)]
        return np.stack([room.min(axis=0) for room in rooms], axis=1)

    def margins(self, candidates: Array) -> Array:
        """(n,): the least of all ``rooms``."""
        return np.asarray(self.rooms(candidates).min(axis=1))

    def evaluate(self, candidates: Array) -> Evaluation:
        inner, rooms = self.inner.evaluate(candidates), self.rooms(candidates)
        violation = inner.violation + np.maximum(RESERVE - rooms.min(axis=1), 0.0)
        rows = np.column_stack([rooms, -inner.violation])
        low = np.append(np.full(rooms.shape[1], RESERVE), 0.0)
        return Evaluation(inner.cost, violation, rows, np.stack([low, np.full(len(low), np.inf)]))

    def score(self, candidate: Array) -> Evaluation:
        inner = self.inner.score(candidate)
        depth = max(0.0, -path_margin(self.path(candidate), self.ground))
        return Evaluation(inner.cost, inner.violation + depth)

    def terms(self, candidate: Array) -> dict[str, float]:
        """Named cost terms of one candidate (d,)."""
        return self.inner.terms(candidate)

    # -- what the lattice, Newton and IPOPT ask for: the terminal objective's own
    # ------------------------

    def effort(self, candidates: Array) -> Array:
        """(n,): the inner objective's; candidates that leave the free ground come after all that
        stay inside."""
        effort = self.inner.effort(candidates)
        outside = np.maximum(RESERVE - self.margins(candidates), 0.0)
        return np.where(outside > 0, effort.max(initial=0.0) + 1.0 + outside, effort)

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:
        """The terminal program with one row more for every room of the ground (corner and border)
        and search step: room >= reserve. Obstacles have none: only scores see them."""
        inner = self.terminal.symbolic(z, parameters)
        points = self.terminal.control_points(z[: self.dimension])
        rooms = self.ground.rooms(
            self._values @ points.x, self._values @ points.y, self._values @ points.yaw
        )
        count = len(rooms) * (self.steps + 1)
        return SymbolicProblem(
            inner.cost,
            np.vstack([inner.constraints, *rooms]),
            np.concatenate([inner.lower, np.full(count, RESERVE)]),
            np.concatenate([inner.upper, np.full(count, np.inf)]),
        )

    def parameters_at(self, start: Array) -> Array:
        return self.terminal.parameters_at(start)

    def slacks_at(self, start: Array) -> Array:
        return self.terminal.slacks_at(start)
