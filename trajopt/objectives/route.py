"""Routes of a robot that drives along its heading: free knots, static round obstacles, straight
walls.

The cost is the length of the route, or the least duration under limits such as slip. The violation
is how deep the robot, seen as a disc that covers its outline, is inside an obstacle or a wall at
the worst place. Searches see both on a coarse grid, for whole swarms at once; ``score`` recomputes
them from the path itself.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Literal

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.objectives.base import Capability, Evaluation, SymbolicProblem
from trajopt.paths.path import Path
from trajopt.paths.samples import along_tangent
from trajopt.paths.spline import SplineBasis
from trajopt.robots.robot import Robot
from trajopt.timing.compiled import fastest_profiles
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import assemble

SEARCH_STEPS = 160  # steps along the route for obstacles and walls, chosen: 8 cm on 12 m
FINE_STEPS = 1600  # the same when a route is judged
RESERVE = 0.004  # m, chosen: more than a disc of 1 m comes nearer between two search steps (sagitta of step and path)
SEARCH_CELLS = 60  # intervals of the speed profile in a search, chosen
_STANDING = 1e-6  # of the mean rate: a slower place has no direction of travel
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(4)


@dataclass(frozen=True)
class Corridor:
    """Free ground: ``y`` between two walls (m; None: no walls) and outside discs ``obstacles`` (x,
    y, radius), m."""

    y: tuple[float, float] | None = None
    obstacles: tuple[tuple[float, float, float], ...] = ()

    def rooms(self, x: Any, y: Any, radius: float) -> list[Any]:
        """Room (m, negative inside) of a disc of ``radius`` at places of any shape, or symbols, to
        each obstacle."""
        found = [np.sqrt((x - a) ** 2 + (y - b) ** 2) - (r + radius) for a, b, r in self.obstacles]
        if self.y is not None:
            found += [y - (self.y[0] + radius), (self.y[1] - radius) - y]
        return found


@dataclass(frozen=True, eq=False)
class RouteObjective:
    """Length (m) or least duration (s) of a spline route over its free knots.

    ``values`` (size, 2): control values of ``basis``, m. ``free``: which of them a search moves,
    and ``bounds`` (2 len(free), 2) between which numbers: decision variables are x, y of each in
    turn. ``radius``: of the disc that covers the robot, m. ``cells``: of the speed profile in a
    search. Durations start and end at rest.
    """

    kind: Literal["length", "duration"]
    basis: SplineBasis
    values: Array
    free: tuple[int, ...]
    bounds: Array
    robot: Robot
    limits: tuple[Limit, ...] = ()
    corridor: Corridor = Corridor()
    radius: float = 0.0
    cells: int = SEARCH_CELLS

    @property
    def dimension(self) -> int:
        return 2 * len(self.free)

    @property
    def constrained(self) -> bool:
        return bool(self.corridor.obstacles) or self.corridor.y is not None

    @property
    def provides(self) -> frozenset[Capability]:
        return frozenset(
            {Capability.BATCH} | ({Capability.SYMBOLIC} if self.kind == "length" else set())
        )

    def coordinates(self, z: Any) -> tuple[Any, Any]:
        """Control values of x and y, each (size, n), for decision variables (d, n): arrays or
        symbols."""
        column = 0 * z[0:1]
        place = {knot: k for k, knot in enumerate(self.free)}
        rows: tuple[list[Any], list[Any]] = ([], [])
        for knot, fixed in enumerate(self.values):
            for axis in (0, 1):
                at = 2 * place[knot] + axis if knot in place else -1
                rows[axis].append(column + fixed[axis] if at < 0 else z[at : at + 1])
        return np.vstack(rows[0]), np.vstack(rows[1])

    def path(self, candidate: Array) -> Path:
        """The route of one candidate (d,)."""
        x, y = self.coordinates(np.asarray(candidate, dtype=np.float64)[:, None])
        return Path(self.basis, np.column_stack([x[:, 0], y[:, 0]]))

    # -- what searches see
    # ------------------------------------------------------------------------------

    @cached_property
    def _steps(self) -> Array:
        return self.basis.matrix(
            np.linspace(self.basis.knots[0], self.basis.knots[-1], SEARCH_STEPS + 1)
        )

    @cached_property
    def _cells(self) -> tuple[Array, list[Array], Array, Array]:
        """Grid (G,), its matrices of derivatives 0 to 3, and matrix and weights of Gauss points in
        its cells.

        Inner knots, where the third derivative jumps, are there twice: a cell of no length lies
        between.
        """
        knots = np.array(self.basis.knots)
        cells = max(4, self.cells // (len(knots) - 1))
        parts = [np.linspace(a, b, cells + 1) for a, b in pairwise(knots)]
        for part in parts:
            part[-1] = np.nextafter(part[-1], -np.inf)
        u = np.concatenate(parts)
        half = np.diff(u)[:, None] / 2
        gauss = u[:-1, None] + half * (1 + _GAUSS_X)
        return (
            u,
            [self.basis.matrix(u, k) for k in range(4)],
            self.basis.matrix(gauss.ravel(), 1),
            (half * _GAUSS_W).ravel(),
        )

    def evaluate(self, candidates: Array) -> Evaluation:
        """Cost and violation of candidates (n, d). Routes without a direction of travel cost
        inf."""
        x, y = self.coordinates(np.asarray(candidates, dtype=np.float64).T)
        violation = self._depth(self._steps @ x, self._steps @ y, RESERVE)
        _, _, gauss, weights = self._cells
        rate = np.hypot(gauss @ x, gauss @ y)
        if self.kind == "length":
            return Evaluation(weights @ rate, violation)
        return Evaluation(self._durations(x, y, rate), violation)

    def _depth(self, x: Array, y: Array, reserve: float) -> Array:
        """(n,): how deep the disc is inside something, at the worst of the places in columns (k,
        n), m."""
        rooms = self.corridor.rooms(x, y, self.radius)
        if not rooms:
            return np.zeros(x.shape[1])
        return np.asarray(np.maximum(reserve - np.min([r.min(axis=0) for r in rooms], axis=0), 0.0))

    def _durations(self, x: Array, y: Array, rate: Array) -> Array:
        """(n,): least durations (s) on the search grid, rows of all limits for all candidates at
        once."""
        u, matrices, _, weights = self._cells
        n, points = x.shape[1], len(u)
        speed = np.hypot(matrices[1] @ x, matrices[1] @ y)
        good = np.flatnonzero(speed.min(axis=0) > _STANDING * speed.mean(axis=0))
        found = np.full(n, np.inf)
        if not len(good):
            return found
        x, y = x[:, good], y[:, good]
        pieces = (weights[:, None] * rate[:, good]).reshape(points - 1, -1, len(good)).sum(axis=1)
        s = np.vstack([np.zeros(len(good)), np.cumsum(pieces, axis=0)]).T
        derivatives = [
            np.stack([(m @ x).T, (m @ y).T, np.zeros((len(good), points))], axis=-1).reshape(-1, 3)
            for m in matrices
        ]
        samples = along_tangent(s.ravel(), np.tile(u, len(good)), derivatives)
        rows = assemble(samples, self.limits, self.robot)
        shape = (len(good), points)
        rest = np.zeros(len(good))
        a, b, c = (m.reshape(*shape, -1) for m in (rows.a, rows.b, rows.c))
        sd2, failed = fastest_profiles(s, a, b, c, rows.sd2_max.reshape(shape), rest, rest)
        sd = np.sqrt(sd2)
        with np.errstate(divide="ignore", invalid="ignore"):
            total = (2 * np.diff(s, axis=1) / (sd[:, 1:] + sd[:, :-1])).sum(axis=1)
        found[good] = np.where((failed < 0) & np.isfinite(total), total, np.inf)
        return found

    # -- what counts
    # ------------------------------------------------------------------------------------

    def score(self, candidate: Array) -> Evaluation:
        """Cost of the path itself and violation on a grid ten times finer, without reserve."""
        path = self.path(candidate)
        p = path.position(np.linspace(path.start, path.end, FINE_STEPS + 1))
        depth = self._depth(p[:, :1], p[:, 1:2], 0.0)
        if self.kind == "length":
            return Evaluation(np.array([path.length]), depth)
        if not path.length > 0:
            return Evaluation(np.full(1, np.inf), np.full(1, np.inf))
        try:
            return Evaluation(
                np.array([time_scale(path, self.limits, robot=self.robot).duration]), depth
            )
        except InfeasibleError:
            return Evaluation(np.full(1, np.inf), np.full(1, np.inf))

    def terms(self, candidate: Array) -> dict[str, float]:
        """The cost by name: length (m) or duration (s)."""
        return {self.kind: float(self.score(candidate).cost[0])}

    # -- the length on symbols
    # --------------------------------------------------------------------------

    def symbolic(self, z: Any, parameters: Any) -> SymbolicProblem:  # noqa: ARG002 - the protocol's signature
        """Least length with room >= reserve to every obstacle and wall at every search step."""
        x, y = self.coordinates(z)
        _, _, gauss, weights = self._cells
        cost = np.sum(weights[:, None] * np.sqrt((gauss @ x) ** 2 + (gauss @ y) ** 2))
        rooms = self.corridor.rooms(self._steps @ x, self._steps @ y, self.radius)
        count = len(rooms) * (SEARCH_STEPS + 1)
        return SymbolicProblem(
            cost,
            np.vstack(rooms) if rooms else None,
            np.full(count, RESERVE),
            np.full(count, np.inf),
        )

    def parameters_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)

    def slacks_at(self, start: Array) -> Array:  # noqa: ARG002
        return np.zeros(0)
