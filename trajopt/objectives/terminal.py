"""Terminal cost of a spline motion: final pose and final wheel angles ([guzman2015], Table 4.4).

    S = gains . |pose error| + wheel_gain * sum over critical wheels of |folded wheel deviation|

The wheel deviation is the circular distance modulo the period, folded to [0, period/2]; with the
period 2 pi and the gains of Table 5.8 this recomputes Tables 5.5 and 5.6.
"""

from __future__ import annotations

import importlib.util
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from trajopt.arrays import Array, fold
from trajopt.errors import ArgumentError
from trajopt.objectives.base import AffinePart, Capability, Evaluation, SymbolicProblem
from trajopt.objectives.exact import exact_terminal
from trajopt.objectives.reach import impossible
from trajopt.objectives.rollout import Kinematics, Terminal, roll_out, step_grid, wheel_travel
from trajopt.objectives.variables import TerminalVariables
from trajopt.problem import Problem
from trajopt.robots.actuator import Actuator

SEARCH_STEPS = 252  # 84 steps a spline segment, 14 to 20 ms on the problems at hand; chosen
COARSE_STEPS = 84  # steps for Newton steps, chosen


@dataclass(frozen=True)
class TerminalObjective(TerminalVariables):
    """Table 4.4 over the free control values of ``problem``."""

    steps: int = SEARCH_STEPS
    kinematics: Kinematics | None = None  # None: the robot's own; given only to compare conventions

    def __post_init__(self) -> None:
        # raises for steps that do not fit, even where no grid is used later
        step_grid(self.basis, self.steps)

    @cached_property
    def model(self) -> Kinematics:
        return self.kinematics or Kinematics(self.robot.inverse, self.robot.forward)

    @cached_property
    def actuator(self) -> Actuator:
        section = self.problem.actuator
        return Actuator() if section is None else section.drive

    @property
    def is_affine(self) -> bool:
        """Whether the critical wheel angles are affine in the decision variables (modulo the
        period)."""
        return self.actuator.is_ideal and set(self.problem.search.free) <= {"p1", "p2"}

    @property
    def provides(self) -> frozenset[Capability]:
        some = {Capability.AFFINE, Capability.GRADIENT} if self.is_affine else set()
        return frozenset({Capability.BATCH, Capability.RESIDUALS, Capability.SYMBOLIC} | some)

    @property
    def constrained(self) -> bool:
        return False

    def impossible(self) -> str:
        """Why no motion reaches the goal pose, and what would do; empty where none is proved."""
        return impossible(self)

    # -- cost --------------------------------------------------------------------------------------

    def predict(self, z: Any) -> Terminal:
        """Final state on the search grid, for decision variables (d, n), arrays or symbols;
        compiled where that is possible."""
        if isinstance(z, np.ndarray) and self._compiled is not None and self._compiled[0].fits(z.T):
            end = self._compiled[0].predict(z.T)
            return Terminal(
                end[0:1], end[1:2], end[2:3], tuple(end[i : i + 1] for i in range(3, 7))
            )
        return self.predict_readable(z)

    def predict_readable(self, z: Any) -> Terminal:
        """The same by ``roll_out``: what the compiled prediction is tested against."""
        p, grid = self.control_points(z), step_grid(self.basis, self.steps)
        return roll_out(grid, self.model, self.actuator, p.x, p.y, p.yaw, p.duration)

    def predict_exactly(self, candidate: Array) -> Terminal:
        """Final state of one candidate (d,), free of grid error."""
        points = self.control_points(np.asarray(candidate, dtype=np.float64)[:, None])
        return exact_terminal(self.basis, self.model, self.actuator, *points.first)

    def wheel_errors(self, final: Terminal) -> list[Any]:
        """Critical wheel angle minus wanted angle, unfolded, rad, one entry a critical wheel."""
        start, task = self.problem.start_wheels.tolist(), self.problem.search
        wanted = task.wheels.tolist()
        return [final.wheels[i] + (start[i] - wanted[i]) for i in task.critical]

    def pose_errors(self, final: Terminal) -> tuple[Any, Any, Any]:
        """Final minus wanted x, y (m), yaw (rad)."""
        x, y, yaw = self.problem.search.goal
        return final.x - x, final.y - y, final.yaw - yaw

    def named_terms(self, final: Terminal) -> dict[str, Any]:
        """The terms of Table 4.4 by name; they sum to the cost."""
        section = self.problem.objective
        pose = zip(("x", "y", "yaw"), section.pose_gains, self.pose_errors(final), strict=True)
        terms = {name: gain * np.abs(error) for name, gain, error in pose}
        for name, error in zip(self.problem.critical, self.wheel_errors(final), strict=True):
            terms[f"wheel {name}"] = section.wheel_gain * np.abs(fold(error, section.period))
        return terms

    @cached_property
    def _affine_errors(self) -> tuple[Array, Array]:
        return self.affine()

    @cached_property
    def _compiled(self) -> Any:
        """The compiled swarm (``objectives.swarm``, or ``heading_swarm`` where the heading is free)
        and what it compares with; None where it does not apply."""
        if (
            self.actuator.is_ideal
            or self.model.inverse.shape != (4, 3)
            or swarm_engine() != "numba"
        ):
            return None
        from trajopt.objectives import heading_swarm, swarm

        heading = ("p1.yaw_rad", "p2.yaw_rad") if "heading" in self.problem.search.free else ()
        rows = [
            self.names.index(name) if name in self.names else -1
            for name in ("p1.x_m", "p1.y_m", "p2.x_m", "p2.y_m", *heading, "duration_s")
        ]
        prepared = heading_swarm.prepared if heading else swarm.prepared
        plan = prepared(
            step_grid(self.basis, self.steps),
            self.model,
            self.actuator,
            *self.control_points(self.default[:, None]).first,
            np.array(rows),
        )
        section, task = self.problem.objective, self.problem.search
        wheel_gains = np.zeros(4)
        wheel_gains[list(task.critical)] = section.wheel_gain
        travel = task.wheels - self.problem.start_wheels
        return plan, swarm.Goal(
            np.array(task.goal), np.array(section.pose_gains), travel, wheel_gains, section.period
        )

    def evaluate(self, candidates: Array) -> Evaluation:
        candidates = np.asarray(candidates, dtype=np.float64)
        if self.is_affine:
            matrix, offset = self._affine_errors
            section = self.problem.objective
            deviation = fold(candidates @ matrix.T + offset, section.period)
            cost = section.wheel_gain * np.abs(deviation).sum(axis=1)
            return Evaluation(cost, np.zeros(len(candidates)))
        if self._compiled is not None and self._compiled[0].fits(candidates):
            plan, goal = self._compiled
            return Evaluation(plan.cost(candidates, goal), np.zeros(len(candidates)))
        return self.evaluate_readable(candidates)

    def prepare(self) -> None:
        """Compile what ``evaluate`` and ``score`` use, which is no part of a search."""
        self.evaluate(self.default[None])
        self.score(self.default)

    def evaluate_readable(self, candidates: Array) -> Evaluation:
        """The same from the named terms: what compiled and affine short cuts are tested against."""
        z = np.asarray(candidates, dtype=np.float64).T
        terms = self.named_terms(self.predict_readable(z))
        cost = np.sum([np.broadcast_to(t, (1, len(candidates)))[0] for t in terms.values()], axis=0)
        return Evaluation(cost, np.zeros(len(candidates)))

    def terms(self, candidate: Array) -> dict[str, float]:
        """Named cost terms of one candidate (d,), without grid error."""
        named = self.named_terms(self.predict_exactly(candidate))
        return {name: float(np.squeeze(value)) for name, value in named.items()}

    def score(self, candidate: Array) -> Evaluation:
        return Evaluation(np.array([sum(self.terms(candidate).values())]), np.zeros(1))

    # -- residuals ---------------------------------------------------------------------------------

    def nearest_turns(self, candidates: Array) -> Array:
        """(n, c): for each critical wheel, the whole number of periods nearest to the predicted
        angle."""
        errors = self.wheel_errors(self.predict(np.asarray(candidates, dtype=np.float64).T))
        return np.stack(
            [np.round(np.asarray(e)[0] / self.problem.objective.period) for e in errors], axis=1
        )

    def residuals(self, z: Any, turns: Any, *, exact: bool = False) -> list[Any]:
        """Pose errors, then critical wheel errors less ``turns`` (c,) periods; zero at an exact
        solution.

        ``z`` is (d, n), or (d,) with ``exact``. Without actuator limits pose errors are zero
        identically and are left out.
        """
        final = self.predict_exactly(z) if exact else self.predict(z)
        period = self.problem.objective.period
        wheels = [e - period * k for e, k in zip(self.wheel_errors(final), turns, strict=True)]
        return wheels if self.actuator.is_ideal else [*self.pose_errors(final), *wheels]

    def residual_gains(self) -> Array:
        """(m,): the cost's gain on the magnitude of each residual."""
        section = self.problem.objective
        wheels = [section.wheel_gain] * len(self.problem.critical)
        return np.array(wheels if self.actuator.is_ideal else [*section.pose_gains, *wheels])

    def affine(self) -> tuple[Array, Array]:
        """(c, d) matrix M and (c,) offset: critical wheel errors = M z + offset, without actuator
        limits.

        Exact because a prescribed heading makes every wheel's travel linear in the control points.
        Raises ArgumentError when heading or duration are free or an actuator is switched on.
        """
        if not self.is_affine:
            raise ArgumentError(
                "spline.free",
                list(self.problem.search.free),
                "p1 and p2 only, and no actuator, for affine wheel angles",
            )
        part = self.affine_part()
        return part.matrix, part.offset

    def affine_part(self) -> AffinePart:
        """The affine residuals of p1 and p2 with ideal actuators, everything else at its default.

        Without p1 and p2 among the free values its matrix has no columns. Raises ArgumentError
        where no wheel is critical.
        """
        if not self.problem.critical:
            raise ArgumentError("goal.critical", None, "critical wheels, for exact wheel angles")
        variables = np.array(
            [i for i, name in enumerate(self.names) if name.endswith(("x_m", "y_m"))], dtype=np.intp
        )
        probes = np.tile(self.default[:, None], variables.size + 1)
        probes[variables, 0] = 0.0
        probes[variables[:, None], np.arange(1, variables.size + 1)] = np.eye(variables.size)
        points = self.control_points(probes)
        travel = wheel_travel(step_grid(self.basis, 48), self.model, points.x, points.y, points.yaw)
        ends = Terminal(
            points.x[-1:],
            points.y[-1:],
            points.yaw[-1:],
            tuple(q.sum(axis=0, keepdims=True) for q in travel),
        )
        errors = np.vstack([np.asarray(e) for e in self.wheel_errors(ends)])
        return AffinePart(
            errors[:, 1:] - errors[:, :1],
            errors[:, 0],
            self.problem.objective.period,
            variables,
            self.default,
        )

    def gradient(self, candidate: Array) -> Array:
        """(d,): gradient of the cost where affine (a subgradient at its kinks)."""
        matrix, offset = self._affine_errors
        deviation = fold(matrix @ candidate + offset, self.problem.objective.period)
        return np.asarray(self.problem.objective.wheel_gain * np.sign(deviation) @ matrix)

    def coarse(self) -> TerminalObjective:
        """The same objective on a third of the grid, for Newton steps that are made exact
        afterwards."""
        return self._coarse

    @cached_property
    def _coarse(self) -> TerminalObjective:
        return replace(self, steps=COARSE_STEPS)

    def effort(self, candidates: Array) -> Array:
        """(n,): the fastest wheel's peak rate per unit of spline parameter; ranks exact
        solutions."""
        points = self.control_points(np.asarray(candidates, dtype=np.float64).T)
        grid = step_grid(self.basis, 24)
        travel = wheel_travel(grid, self.model, points.x, points.y, points.yaw)
        return np.asarray(np.max(np.abs(travel), axis=(0, 1)) / grid.width)

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:
        """Table 4.4 as a smooth program, whole turns fixed by ``parameters`` (c, 1).

        ``z`` (d + m, 1) holds the decision variables and one slack a residual: minimise gains .
        slack subject to slack - r >= 0 and slack + r >= 0, so that slack = |r| at the optimum.
        """
        turns = [parameters[i : i + 1] for i in range(len(self.problem.critical))]
        r = self.residuals(z[: self.dimension], turns)
        slack = [z[self.dimension + i : self.dimension + i + 1] for i in range(len(r))]
        cost: Any = 0.0
        for gain, value in zip(self.residual_gains().tolist(), slack, strict=True):
            cost = cost + gain * value
        pairs = zip(slack, r, strict=True)
        rows = [row for value, error in pairs for row in (value - error, value + error)]
        count = len(rows)
        return SymbolicProblem(cost, np.vstack(rows), np.zeros(count), np.full(count, np.inf))

    def parameters_at(self, start: Array) -> Array:
        return np.asarray(self.nearest_turns(start[None])[0])

    def slacks_at(self, start: Array) -> Array:
        residuals = self.residuals(start[:, None], self.parameters_at(start))
        return np.array([float(np.abs(np.squeeze(v))) for v in residuals])


@lru_cache(maxsize=1)
def swarm_engine() -> str:
    """What predicts swarms through actuators: "numba", or "numpy" where numba is not installed."""
    return "numba" if importlib.util.find_spec("numba") else "numpy"


def terminal_objective(problem: Problem, *, steps: int = SEARCH_STEPS) -> TerminalObjective:
    """The terminal objective of a problem on its own robot."""
    return TerminalObjective(problem, problem.robot, steps)


def with_free(problem: Problem, *free: str) -> Problem:
    """The same problem with other free control values."""
    return problem.replace({"spline.free": list(free)})
