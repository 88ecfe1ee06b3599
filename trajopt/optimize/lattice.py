"""Exact terminal wheel angles in closed form: the lattice of whole turns.

With a prescribed heading and ideal actuators the critical wheel angles are affine in the control
points, so every exact solution is matrix^-1 (period * turns - offset) for whole numbers of turns
(for free P1 and P2: the one nearest to the default control points). Those inside the bounds are
ranked by the peak wheel rate. Where actuators limit the wheels or the heading is free, each lattice
point starts a Newton solve.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, cast

import numpy as np
from numpy.random import Generator

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.objectives.base import AffinePart, Capability, LatticeObjective
from trajopt.optimize.base import FEASIBLE, Status, best_index
from trajopt.optimize.newton import solve_residuals
from trajopt.optimize.run import Run

EXACT = 1e-9  # cost, or wheel error in rad, up to which a solution counts as exact
_NO_INFLUENCE = (
    1e-6  # rad/m; a control point that turns no wheel by more has no influence (wheels turn 1/R)
)
_MOST_TURNS = 200  # of one wheel that are looked at, chosen: 40,000 combinations of two wheels
_BATCH = 100  # candidates evaluated at once, chosen


@dataclass(frozen=True)
class Lattice:
    """Closed form over whole turns, then damped minimum-norm Newton where actuators limit the
    wheels.

    ``rounds``: how often Newton may go through all lattice points; from the second time on they are
    those nearest to a random base point.
    """

    name: ClassVar[str] = "lattice"
    needs: ClassVar[frozenset[Capability]] = frozenset({Capability.RESIDUALS})
    stochastic: ClassVar[bool] = False

    rounds: int = 5  # chosen

    def search(self, run: Run, x0: Array | None, rng: Generator) -> tuple[Status, str]:  # noqa: ARG002
        """Solve. ``x0`` is not used: the method needs no start. ``rng`` draws base points for later
        rounds.

        Raises ArgumentError for an objective without an affine part, or one whose wheel angles no
        free variable changes.
        """
        if not hasattr(run.objective, "affine_part"):
            raise ArgumentError(
                "optimizer",
                self.name,
                "an objective with affine wheel angles (the terminal "
                "objective); take pso or differential-evolution here",
            )
        run.constructed()
        return self._search(run, cast(LatticeObjective, run.objective), rng)

    def _search(self, run: Run, objective: LatticeObjective, rng: Generator) -> tuple[Status, str]:
        part = objective.affine_part()
        if Capability.AFFINE not in objective.provides and not has_influence(part):
            return self._through_actuators(run, objective, part, part.base[None], rng)
        box = run.bounds[part.variables]
        points, turns = lattice_points(part, box)
        if len(points) == 0:
            return self._nearest(run, objective, part, box)
        every = np.tile(part.base, (len(points), 1))
        every[:, part.variables] = points
        candidates = every[: run.remaining()]
        cost, violation = _evaluated(run, candidates)
        # Where the cost is no deviation (duration), it ranks exact solutions itself.
        by_cost = Capability.SYMBOLIC not in objective.provides
        order = np.lexsort((cost if by_cost else objective.effort(candidates), violation))
        candidates, turns = candidates[order], turns[: len(candidates)][order]
        if Capability.AFFINE not in objective.provides:
            return self._through_actuators(run, objective, part, candidates, rng, turns)
        run.nit = 1
        run.propose(candidates[0])
        misses = candidates[:, part.variables] @ part.matrix.T + part.offset - part.period * turns
        if np.max(np.abs(misses[0])) > EXACT:
            return Status.NO_EXACT, "the critical wheels over-determine the control points"
        compared = "" if len(candidates) == len(every) else f", {len(candidates)} of them compared"
        taken = "the fastest" if by_cost else "the one with the least effort"
        return (
            Status.CONVERGED,
            f"{len(every)} exact solutions found inside the bounds{compared}, {taken} taken",
        )

    def _through_actuators(
        self,
        run: Run,
        objective: LatticeObjective,
        part: AffinePart,
        candidates: Array,
        rng: Generator,
        turns: Array | None = None,
    ) -> tuple[Status, str]:
        """Newton from each lattice point, then from lattice points of other base points.

        A base point without lattice points is a start itself, as are ``candidates`` without
        ``turns``.
        """
        for _ in range(self.rounds):
            if turns is None:
                run.evaluate(candidates)
                turns = objective.nearest_turns(candidates)
            for x, k in zip(candidates, turns, strict=True):
                run.nit += 1
                outcome = solve_residuals(run, objective, x, k)
                run.propose(outcome.x)
                judged = run.evaluate(outcome.x[None])
                if outcome.solved and judged.violation[0] <= FEASIBLE:
                    return Status.CONVERGED, f"exact after {run.nit} Newton solves"
            width = run.bounds[:, 1] - run.bounds[:, 0]
            base = run.bounds.mean(axis=1) + 0.8 * width * (rng.random(len(width)) - 0.5)
            point = np.isin(np.arange(len(base)), part.variables)
            base = np.where(
                point, base, 0.75 * part.base + 0.25 * base
            )  # heading stays near the linear one
            candidates, turns = base[None], None
            if has_influence(part):
                points, found = lattice_points(replace(part, base=base), run.bounds[part.variables])
                if len(points):
                    candidates, turns = np.tile(base, (len(points), 1)), found
                    candidates[:, part.variables] = points
        return Status.NO_EXACT, f"Newton solved none of {run.nit} starts"

    def _nearest(
        self, run: Run, objective: LatticeObjective, part: AffinePart, box: Array
    ) -> tuple[Status, str]:
        """No lattice point inside: the best of the places where single wheels are exact, or of the
        corners."""
        corners = _arrangement_vertices(part, box)
        candidates = np.tile(part.base, (len(corners), 1))
        candidates[:, part.variables] = corners
        run.nit = 1
        found = run.evaluate(candidates)
        best = candidates[best_index(found.cost, found.violation)]
        if Capability.AFFINE not in objective.provides:
            outcome = solve_residuals(run, objective, best, objective.nearest_turns(best[None])[0])
            run.propose(outcome.x)
            found = run.evaluate(outcome.x[None])
            if outcome.solved and found.violation[0] <= FEASIBLE:
                return (
                    Status.CONVERGED,
                    "exact through the actuators, though no lattice point is inside the bounds",
                )
        return Status.NO_EXACT, "no lattice point lies inside the bounds"


def _evaluated(run: Run, candidates: Array) -> tuple[Array, Array]:
    """Costs and violations (n,), in batches small enough to keep to a budget in seconds."""
    parts = [run.evaluate(candidates[i : i + _BATCH]) for i in range(0, len(candidates), _BATCH)]
    cost, violation = ([getattr(part, name) for part in parts] for name in ("cost", "violation"))
    return np.concatenate(cost), np.concatenate(violation)


def has_influence(part: AffinePart) -> bool:
    """Whether the wheel angles depend on the variables at all (not where start and goal heading are
    the same)."""
    return part.matrix.size > 0 and bool(np.linalg.matrix_rank(part.matrix, tol=_NO_INFLUENCE) > 0)


def lattice_points(part: AffinePart, box: Array) -> tuple[Array, Array]:
    """All exact solutions (n, k) inside ``box`` (k, 2), and their whole turns (n, c).

    With as many variables as critical wheels these are all there are; with more, for each set of
    turns the solution nearest to the base point (scaled by the box) is taken. In a space so large
    that a wheel could end at more than _MOST_TURNS turns, only the turns nearest to those of the
    base point are looked at. Raises ArgumentError where the wheel angles do not depend on the
    variables.
    """
    rows = _independent_rows(part.matrix)
    matrix, offset = part.matrix[rows], part.offset[rows]
    centre, half = box.mean(axis=1), (box[:, 1] - box[:, 0]) / 2
    middle, reach = matrix @ centre + offset, np.abs(matrix) @ half
    at_base = (matrix @ part.base[part.variables] + offset) / part.period
    spans = [
        np.arange(
            np.ceil(max((m - r) / part.period, b - _MOST_TURNS / 2)),
            np.floor(min((m + r) / part.period, b + _MOST_TURNS / 2)) + 1,
        )
        for m, r, b in zip(middle, reach, at_base, strict=True)
    ]
    turns = np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, len(spans))
    if len(turns) == 0:
        return np.zeros((0, len(box))), np.zeros((0, len(part.offset)))
    points = _least_change(matrix, part.period * turns - offset, part.base[part.variables], box)
    found = np.isfinite(points).all(axis=1)
    points, turns = points[found], turns[found]
    exact = (
        np.max(np.abs(points @ matrix.T + offset - part.period * turns), axis=1, initial=0.0)
        < 1e-11
    )
    points = points[exact]
    every = np.round((points @ part.matrix.T + part.offset) / part.period)
    return points, every


def _independent_rows(matrix: Array) -> list[int]:
    """Rows that span the row space (critical wheels can depend on each other)."""
    rows: list[int] = []
    for i in range(len(matrix)):
        if np.linalg.matrix_rank(matrix[[*rows, i]], tol=_NO_INFLUENCE) == len(rows) + 1:
            rows.append(i)
    if not rows:
        raise ArgumentError(
            "goal.pose",
            "no turn between start and goal",
            "a change of heading: without one "
            "the final wheel angles do not depend on the control points",
        )
    return rows


def _least_change(matrix: Array, targets: Array, base: Array, box: Array) -> Array:
    """(n, k): for each target (n, c), the solution of matrix @ z = target nearest to ``base``.

    Rows without a solution inside the box are inf. Only where no target has its nearest solution
    inside, variables that fall outside are held at the border and the others solved again.
    """
    width = box[:, 1] - box[:, 0]
    points = base + (targets - matrix @ base) @ np.linalg.pinv(matrix * width).T * width
    inside = np.all((points >= box[:, 0]) & (points <= box[:, 1]), axis=1)
    if matrix.shape[1] == matrix.shape[0] or inside.any():
        return np.where(inside[:, None], points, np.inf)
    for i in np.flatnonzero(~inside):
        points[i] = _held_inside(matrix, targets[i], points[i], box, width)
    return points


def _held_inside(matrix: Array, target: Array, point: Array, box: Array, width: Array) -> Array:
    free = np.ones(len(point), dtype=bool)
    z = point.copy()
    while free.sum() > matrix.shape[0]:
        beyond = np.maximum(box[:, 0] - z, z - box[:, 1]) / width
        beyond[~free] = -np.inf
        worst = int(np.argmax(beyond))
        if beyond[worst] <= 0:
            break
        z[worst] = np.clip(z[worst], *box[worst])
        free[worst] = False
        rest = target - matrix[:, ~free] @ z[~free] - matrix[:, free] @ z[free]
        z[free] += width[free] * (np.linalg.pinv(matrix[:, free] * width[free]) @ rest)
    inside = np.all((z >= box[:, 0] - 1e-12) & (z <= box[:, 1] + 1e-12))
    return np.clip(z, box[:, 0], box[:, 1]) if inside else np.full(len(z), np.inf)


def _arrangement_vertices(part: AffinePart, box: Array) -> Array:
    """(n, k): corners of the box and, on each of its edges, the points where one critical wheel is
    exact.

    Without lattice points inside a two-variable box, the piecewise linear cost has its minimum at
    one of these; with more variables they are good starts.
    """
    k = len(box)
    corners = np.stack(np.meshgrid(*box, indexing="ij"), axis=-1).reshape(-1, k)
    found = [corners]
    for axis in range(k):
        ends = corners[corners[:, axis] == box[axis, 0]]
        for row, offset in zip(part.matrix, part.offset, strict=True):
            if abs(row[axis]) < 1e-12:
                continue
            low = ends @ row + offset
            high = low + row[axis] * (box[axis, 1] - box[axis, 0])
            for end, a, b in zip(ends, low, high, strict=True):
                first, last = np.ceil(min(a, b) / part.period), np.floor(max(a, b) / part.period)
                some = (first + last) / 2 + np.array([-0.5, 0.5]) * _MOST_TURNS
                turns = np.arange(max(first, np.ceil(some[0])), min(last, some[1]) + 1)
                points = np.tile(end, (len(turns), 1))
                points[:, axis] += (turns * part.period - a) / row[axis]
                found.append(points)
    return np.asarray(np.clip(np.concatenate(found), box[:, 0], box[:, 1]))
