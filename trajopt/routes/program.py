"""Least time over control points and speed profile at once, as one program for IPOPT.

A clamped uniform cubic B-spline with ``n`` control points of x, y (and yaw, where the robot chooses
it), and speeds v at N + 1 nodes, CELLS to a segment, aligned with its knots. Lengths ds of the cells
by Simpson's rule; the time is the sum of 2 ds / (v_k + v_k+1), accelerations are differences of
v^2 / 2 over ds. A cell depends on four control points and two speeds only: ``cells`` holds its cost
and rows with both derivatives, compiled once and mapped over all cells here. Distances from
obstacles, with derivatives, come from a ``Field`` at each call, so a program is built once for a
robot's kinds of rows and a number of points, and solved in any scene. A general optimizer
has no words for what is differentiated cell by cell.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.optimize.symbols import QUIET, casadi
from trajopt.routes.cells import (
    CELLS,
    FASTEST,
    SLOWEST,
    Kind,
    Symbols,
    shared_numbers,
    symbols_of,
)
from trajopt.routes.cover import Cover
from trajopt.routes.envelope import Envelope
from trajopt.routes.field import Field
from trajopt.routes.mapping import cell_weights, field_call, summing

_EVEN = 2e-3  # of the cost: weight of the mean square of |q'| less its mean, relative; chosen
_CRAWL = 1e-3  # m/s, everywhere where speeds are left out
# Every row that does not bind costs as much as the barrier's last parameter: with thousands of them
# a tolerance of 1e-4 loses 1 % of time. So it is small, and what ends a search is that nothing is
# gained.
_SETTINGS = {
    **QUIET,
    "calc_lam_p": False,
    "calc_lam_x": False,
    "no_nlp_grad": True,
    "ipopt.mu_init": 1e-2,
    "ipopt.max_iter": 150,
    "ipopt.tol": 1e-6,
    "ipopt.acceptable_tol": 1e-2,
    "ipopt.acceptable_constr_viol_tol": 1e-5,
    "ipopt.acceptable_compl_inf_tol": 2e-6,
    "ipopt.acceptable_obj_change_tol": 1e-4,
    "ipopt.acceptable_iter": 3,
    "ipopt.bound_relax_factor": 0.0,
}
_ROUGH = {"ipopt.tol": 1e-4, "ipopt.acceptable_compl_inf_tol": 1e-4}  # without speeds: a start


@dataclass(frozen=True)
class Weights:
    """Of the cost: time (1/s), length (1/m), squared curvature along the length (m); without time,
    speeds are left out."""

    time: float
    length: float = 0.0
    bend: float = 0.0


@dataclass(frozen=True, eq=False)
class Solved:
    """``points`` (n, 2 or 3) of the B-spline, ``speeds`` (N+1,), m/s; whether IPOPT got to its
    tolerance, in how many iterations, and its own ``status``."""

    points: Array
    speeds: Array
    solved: bool = False
    status: str = ""
    iterations: int = 0


@lru_cache(maxsize=16)
def program_of(kind: Kind, points: int, discs: int) -> Program:
    """The program, built once."""
    return Program(kind, points, discs)


class Program:
    """One compiled program for ``points`` control points and ``discs`` in the outline's place."""

    def __init__(self, kind: Kind, points: int, discs: int) -> None:
        self.kind, self.points, self.discs = kind, points, discs
        self.cells = CELLS * (points - 3)
        self.symbols = symbols_of(kind, discs)
        self.field: Field | None = None
        self.seen: tuple[Array, Array] | None = None
        axes, first = kind.axes, np.arange(self.cells) // CELLS
        near = (first[:, None] + np.arange(4))[:, :, None] * axes + np.arange(axes)
        speeds = points * axes + np.arange(self.cells)[:, None] + np.arange(2)
        self.places = np.concatenate([near.reshape(self.cells, -1), speeds], axis=1)
        self.weights = cell_weights(points)
        self.size = points * axes + self.cells + 1
        self.solver = self._build()

    def solve(
        self,
        start: Solved,
        ends: tuple[Array, Array],
        envelope: Envelope,
        cover: Cover,
        field: Field,
        weights: Weights,
        room: Array,
    ) -> Solved:
        """From ``start`` to a local optimum between two poses (3,); at the inner nodes discs keep
        ``room`` (N-1,), m."""
        axes, count = self.kind.axes, self.points
        self.field, self.seen = field, None
        mean = float(np.linalg.norm(np.diff(start.points[:, :2], axis=0), axis=1).mean())
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        for at, pose in ((0, ends[0]), (count - 1, ends[1])):
            here = slice(at * axes, at * axes + axes)
            fixed = pose.copy()
            if axes == 3 and at:
                fixed[2] = start.points[-1, 2]
            lower[here] = upper[here] = fixed[:axes]
        v = slice(count * axes, None)
        lower[v], upper[v] = 0.0, envelope.speed
        speeds = np.clip(start.speeds, _CRAWL, 0.95 * envelope.speed)
        if weights.time == 0:
            lower[v] = upper[v] = speeds = np.full(self.cells + 1, _CRAWL)
        else:
            upper[v][[0, -1]] = 0.0
        cost = [weights.time, weights.length, weights.bend]
        scale = _EVEN * float(
            weights.time * 2 * mean * count / max(float(np.mean(speeds)), _CRAWL)
            if weights.time
            else weights.length * mean * count
        )
        shared = shared_numbers(envelope, self.kind, [*cost, scale / self.cells, mean])
        directions = [f(pose[2]) for pose in ends for f in (np.cos, np.sin)]
        radii = (room[:, None] + cover.radii).ravel()
        parameters = np.concatenate([shared, cover.centres.ravel(), radii, directions])
        low, high = self._bounds(mean)
        found = self.solver(
            x0=np.concatenate([start.points.ravel(), speeds]),
            p=parameters,
            lbx=lower,
            ubx=upper,
            lbg=low,
            ubg=high,
        )
        x = np.asarray(found["x"], dtype=np.float64).ravel()
        stats = self.solver.stats()
        good = bool(np.isfinite(x).all())
        return Solved(
            x[: count * axes].reshape(count, axes) if good else start.points,
            x[v] if good else start.speeds,
            bool(stats["success"]) and good,
            str(stats["return_status"]),
            int(stats["iter_count"]),
        )

    def _bounds(self, mean: float) -> tuple[Array, Array]:
        low, high = self.symbols.bounds
        low, high = np.tile(low, self.cells), np.tile(high, self.cells)
        free = self.discs * (self.cells - 1)
        parts = [low, np.zeros(free)], [high, np.full(free, np.inf)]
        if not self.kind.free:  # a ray is a third of the rate at its end
            ray = mean / 3
            parts[0].append(np.array([0.0, SLOWEST * ray, 0.0, SLOWEST * ray]))
            parts[1].append(np.array([0.0, FASTEST * ray, 0.0, FASTEST * ray]))
        return np.concatenate(parts[0]), np.concatenate(parts[1])

    # -- putting together ------------------------------------------------------------------------

    def _build(self) -> Any:
        """IPOPT's solver with its functions put together from those of a cell."""
        ca = casadi()
        s, n, discs = self.symbols, self.cells, self.discs
        x = ca.MX.sym("x", self.size)
        count = [s.shared, 2 * discs, discs * (n - 1), 4]
        p = ca.MX.sym("p", sum(count))
        shared, centres, radii, directions = ca.vertsplit(p, np.cumsum([0, *count]).tolist())
        local = ca.reshape(x[self.places.ravel().tolist()], s.locals, n)
        weights = ca.DM(self.weights)
        nodes = slice(0, n - 1)  # the right ends of the cells but the last: both ends are given
        at = ca.reshape(x[self.places[nodes, : s.points].ravel().tolist()], s.points, n - 1)
        node_weights = ca.DM(self.weights[s.node_rows][:, nodes])
        spots = s.spots.map(n - 1)(at, node_weights, ca.repmat(centres, 1, n - 1))
        self._call = field_call(ca, self, discs * (n - 1))
        seen = self._call(ca.reshape(spots, 2, discs * (n - 1)))
        d = [ca.reshape(seen[k, :], discs, n - 1) for k in range(6)]
        inputs = (local, weights, ca.repmat(shared, 1, n))
        rows = s.rows_of.map(n)(*inputs)
        ends, end_slopes, end_places = self._ends(ca, x, directions)
        g = ca.vertcat(
            ca.vec(rows),
            ca.vec(d[0]) - radii,
            *([] if ends is None else [ends]),
        )
        f = ca.sum2(s.cost.map(n)(*inputs))
        gradient, jacobian = s.gradient.map(n)(*inputs), s.slopes.map(n)(*inputs)
        disc = s.disc_slopes.map(n - 1)(at, node_weights, ca.repmat(centres, 1, n - 1), d[1], d[2])
        row, column = self._jacobian_places(s, end_places)
        vector = ca.vertcat(jacobian.nz[:], disc.nz[:], *([] if ends is None else [end_slopes]))
        order = np.lexsort((row, column))
        pattern = ca.Sparsity.triplet(
            g.numel(), self.size, row[order].tolist(), column[order].tolist()
        )
        jac = ca.MX(pattern, vector[order.tolist()])
        summed = summing(ca, self.places.ravel(), self.size)
        grad = summed @ ca.vec(gradient)
        sigma, lam = ca.MX.sym("sigma"), ca.MX.sym("lam", g.numel())
        split = ca.vertsplit(
            lam, np.cumsum([0, s.rows * n, discs * (n - 1), 0 if self.kind.free else 4]).tolist()
        )
        bent = s.bends.map(n)(*inputs, ca.repmat(sigma, 1, n), ca.reshape(split[0], s.rows, n))
        disc_bent = s.disc_bends.map(n - 1)(
            at,
            node_weights,
            ca.repmat(centres, 1, n - 1),
            ca.reshape(split[1], discs, n - 1),
            *d[1:],
        )
        hess = self._hessian(ca, s, ca.vertcat(bent.nz[:], disc_bent.nz[:]))
        names = ["x", "p"]
        functions = {
            "grad_f": ca.Function("nlp_grad_f", [x, p], [f, grad], names, ["f", "grad_f_x"]),
            "jac_g": ca.Function("nlp_jac_g", [x, p], [g, jac], names, ["g", "jac_g_x"]),
            "hess_lag": ca.Function(
                "nlp_hess_l",
                [x, p, sigma, lam],
                [hess],
                [*names, "lam_f", "lam_g"],
                ["triu_hess_gamma_x_x"],
            ),
        }
        rough = not (self.kind.norms or self.kind.cones or self.kind.planes)
        return ca.nlpsol(
            "route",
            "ipopt",
            {"x": x, "p": p, "f": f, "g": g},
            {**_SETTINGS, **(_ROUGH if rough else {}), **functions},
        )

    def _ends(self, ca: Any, x: Any, directions: Any) -> tuple[Any, Any, list[tuple[int, int]]]:
        """Rows that hold the first and last rays on the headings: across, along; their derivatives
        and places in the Jacobian (row counted from the first of these)."""
        if self.kind.free:
            return None, None, []
        rows, slopes, places = [], [], []
        last = 2 * (self.points - 1)
        for k, (a, b) in enumerate(((0, 2), (last - 2, last))):
            cos, sin = directions[2 * k], directions[2 * k + 1]
            dx, dy = x[b] - x[a], x[b + 1] - x[a + 1]
            rows += [dx * sin - dy * cos, dx * cos + dy * sin]
            slopes += [-sin, cos, sin, -cos, -cos, -sin, cos, sin]
            places += [(2 * k + r, c) for r in (0, 1) for c in (a, a + 1, b, b + 1)]
        return ca.vertcat(*rows), ca.vertcat(*slopes), places

    def _jacobian_places(
        self, s: Symbols, ends: Sequence[tuple[int, int]]
    ) -> tuple[IndexArray, IndexArray]:
        """Row and column of every value of the Jacobian, as they come."""
        n, discs = self.cells, self.discs
        i, j = s.slope_places
        row = (np.arange(n)[:, None] * s.rows + i).ravel()
        column = self.places[:, j].ravel()
        i, j = s.disc_slope_places
        row = np.append(row, (s.rows * n + np.arange(n - 1)[:, None] * discs + i).ravel())
        column = np.append(column, self.places[: n - 1, j].ravel())
        first = s.rows * n + discs * (n - 1)
        for r, c in ends:
            row, column = np.append(row, first + r), np.append(column, c)
        return row, column

    def _hessian(self, ca: Any, s: Symbols, values: Any) -> Any:
        """Upper half of the Hessian, values that meet in a place summed."""
        i, j = s.bend_places
        row, column = self.places[:, i].ravel(), self.places[:, j].ravel()
        i, j = s.disc_bend_places
        row = np.append(row, self.places[: self.cells - 1, i].ravel())
        column = np.append(column, self.places[: self.cells - 1, j].ravel())
        keys, where = np.unique(column * self.size + row, return_inverse=True)
        pattern = ca.Sparsity.triplet(
            self.size, self.size, (keys % self.size).tolist(), (keys // self.size).tolist()
        )
        return ca.MX(pattern, summing(ca, where, len(keys)) @ values)
