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
from itertools import pairwise, product
from typing import Any, Literal

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.errors import InfeasibleError
from trajopt.limits.limit import Limit
from trajopt.objectives.base import Capability, Evaluation
from trajopt.paths.path import Path
from trajopt.paths.samples import along_tangent
from trajopt.paths.spline import SplineBasis
from trajopt.robots.robot import Robot
from trajopt.timing.compiled import fastest_profiles
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import assemble

MOST_SIDES = 6  # obstacles whose two sides are told apart in starts, chosen: 64 routes
SEARCH_STEPS = 200  # steps along the route for obstacles and walls, chosen: 6 cm on 12 m
FINE_STEPS = 1600  # the same when a route is judged
RESERVE = 2e-4  # m, chosen: more than a parabola through three search steps misses on calm routes
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
        smooth = {Capability.GRADIENT} if self.kind == "length" else set()
        kept = {Capability.JACOBIAN} if self.constrained else set()
        return frozenset({Capability.BATCH} | smooth | kept)

    def prepare(self) -> None:
        """Compile what ``evaluate`` uses, which is no part of a search."""
        self.evaluate(self.bounds.mean(axis=1)[None])

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
        _, _, gauss, weights = self._cells
        rate = np.hypot(gauss @ x, gauss @ y)
        cost = weights @ rate if self.kind == "length" else self._durations(x, y, rate)
        if not self.constrained:
            return Evaluation(cost, np.zeros(len(cost)))
        rooms = self._rooms(x, y)[0].T
        limits = np.stack([np.full(rooms.shape[1], RESERVE), np.full(rooms.shape[1], np.inf)])
        violation = np.maximum(RESERVE - rooms.min(axis=1), 0.0)
        return Evaluation(cost, violation, rooms, limits)

    @cached_property
    def _reach(self) -> Array:
        """(m,): what squared distances and heights leave less of, m: of each obstacle and wall."""
        found = [r for _, _, r in self.corridor.obstacles]
        if self.corridor.y is not None:
            found += [self.corridor.y[0], -self.corridor.y[1]]
        return np.array(found) + self.radius

    def _rooms(self, x: Array, y: Array) -> tuple[Array, IndexArray, Array]:
        """Least room (m, n) of the disc to each obstacle and wall on routes with control values
        (size, n), m; at which step it is, and the shares (3, m, n) of that step and its neighbours
        in it.

        Between steps, a parabola through three squared distances (heights over a wall) has it: the
        least is smooth in the control values, and closer than a step.
        """
        px, py = self._steps @ x, self._steps @ y
        measures = [(px - a) ** 2 + (py - b) ** 2 for a, b, _ in self.corridor.obstacles]
        if self.corridor.y is not None:
            measures += [py, -py]
        q = np.array(measures)
        at = np.clip(q.argmin(axis=1), 1, len(px) - 2)
        near = np.stack([np.take_along_axis(q, at[:, None] + k, axis=1)[:, 0] for k in (-1, 0, 1)])
        bend, fall = near[0] - 2 * near[1] + near[2], near[0] - near[2]
        t = np.where(bend > 0, 0.5 * fall / np.where(bend > 0, bend, 1.0), np.sign(fall))
        t = np.clip(t, -1.0, 1.0)
        shares = np.stack([0.5 * t * (t - 1), 1 - t * t, 0.5 * t * (t + 1)])
        least = (shares * near).sum(axis=0)
        n = len(self.corridor.obstacles)
        least[:n] = np.sqrt(np.maximum(least[:n], 0.0))
        return least - self._reach[:, None], at, shares

    def starts(self) -> Array:
        """(k, d): routes that pass the obstacles on either side of each, where local searches may
        begin; of the nearest MOST_SIDES obstacles where there are more."""
        start, goal = self.values[0], self.values[-1]
        along = (goal - start) / max(float(np.hypot(*(goal - start))), 1e-300)
        across = np.array([-along[1], along[0]])
        discs = [(np.array(o[:2]) - start, o[2] + self.radius) for o in self.corridor.obstacles]
        places = [(float(p @ along), float(p @ across), r) for p, r in discs]
        places = sorted(sorted(places, key=lambda o: abs(o[1]) - o[2])[:MOST_SIDES])
        at = np.array([0.0, *(p for p, _, _ in places), float((goal - start) @ along)])
        knots = self.values[list(self.free)]
        found = []
        for sides in product((1.0, -1.0), repeat=len(places)):
            beside = [s * max(0.0, s * y + r) for s, (_, y, r) in zip(sides, places, strict=True)]
            off = np.interp((knots - start) @ along, at, [0.0, *beside, 0.0])
            line = start + ((knots - start) @ along)[:, None] * along
            found.append((line + off[:, None] * across).ravel())
        return np.asarray(np.clip(found, *self.bounds.T))

    # -- derivatives

    def gradient(self, candidate: Array) -> Array:
        """(d,): of the length."""
        x, y = self.coordinates(np.asarray(candidate, dtype=np.float64)[:, None])
        _, _, gauss, weights = self._cells
        dx, dy = gauss @ x[:, 0], gauss @ y[:, 0]
        share = weights / np.maximum(np.hypot(dx, dy), 1e-300)
        return self._of_variables((share * dx) @ gauss, (share * dy) @ gauss)

    def jacobian(self, candidate: Array) -> Array:
        """(m, d): of the room to each obstacle and wall."""
        x, y = self.coordinates(np.asarray(candidate, dtype=np.float64)[:, None])
        rooms, at, shares = self._rooms(x, y)
        n = len(self.corridor.obstacles)
        basis = self._steps[at[:, 0] + np.array([-1, 0, 1])[:, None]]  # (3, m, size)
        distance = np.maximum(rooms[:n, 0] + self._reach[:n], 1e-300)
        slopes = np.zeros((2, len(rooms), basis.shape[-1]))
        for axis, values in enumerate((x[:, 0], y[:, 0])):
            centre = np.array([o[axis] for o in self.corridor.obstacles])
            off = (basis[:, :n] @ values - centre) * shares[:, :n, 0] / distance
            slopes[axis, :n] = (off[..., None] * basis[:, :n]).sum(axis=0)
        sign = np.array([1.0, -1.0])[: len(rooms) - n]
        slopes[1, n:] = ((shares[:, n:, 0] * sign)[..., None] * basis[:, n:]).sum(axis=0)
        return np.moveaxis(slopes[..., list(self.free)], 0, -1).reshape(len(rooms), -1)

    def _of_variables(self, dx: Array, dy: Array) -> Array:
        """(d,): the slopes over control values (size,) of the free ones, x and y in turn."""
        return np.column_stack([dx, dy])[list(self.free)].ravel()

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
        rooms = self.corridor.rooms(p[:, 0], p[:, 1], self.radius)
        depth = np.array([max(0.0, -float(np.min(rooms, initial=np.inf)))])
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
