"""One cell of a route's program in symbols: cost, rows and discs, with first and second derivatives.

A cell's variables are its four control points and the speeds at its two ends. All rows are scaled so
that their bound is 1. See ``program``.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.optimize.symbols import casadi
from trajopt.robots.robot import STANDARD_GRAVITY
from trajopt.routes.envelope import Envelope

CELLS = 5  # to a segment of the spline; unaligned or coarser nodes lose up to 0.2 % of time
SLOWEST, FASTEST = 0.4, 2.5  # bounds of |q'| as shares of its mean: no cusps, no jumps
_STILL = 1e-9  # m/s; added to sums of speeds, so that no time is infinite
_TINY = 1e-12  # under roots of sums of squares that may vanish
_FIXED = 16  # shared numbers before the rows of rates, of cones and of planes


@dataclass(frozen=True)
class Kind:
    """Which rows there are: whether the heading is ``free``; of each rate whether it is the
    ``norms`` of two components, and whether its change is bounded (``changes``); how many
    ``cones`` and ``planes``, in how many ``powers`` of curvature; ``steers``."""

    free: bool
    norms: tuple[bool, ...]
    changes: tuple[bool, ...]
    cones: int
    planes: int
    powers: int
    steers: bool

    @property
    def axes(self) -> int:
        return 3 if self.free else 2


def kind_of(envelope: Envelope) -> Kind:
    """The kind of rows that an envelope has."""
    norms = tuple(bool(row.any()) for row in envelope.second)
    changes = tuple(bool(c > 0) for c in envelope.changes)
    cones, powers = envelope.cones.shape[:2]
    steers = bool(np.isfinite(envelope.turning))
    return Kind(envelope.free, norms, changes, cones, len(envelope.planes), powers, steers)


def shared_numbers(envelope: Envelope, kind: Kind, cost: list[float]) -> Array:
    """What all cells share: weights of time, length, bend and evenness, mean |q'|, then limits."""
    e = envelope
    inverse = [1 / v for v in (*e.box, e.curvature)]
    rest = [e.base, 1 / e.turning if kind.steers else 0.0, e.length, *e.cog, *e.down]
    rows = [e.first, e.second, e.changes, e.cones, e.planes]
    return np.concatenate([cost, inverse, rest, *(part.ravel() for part in rows)])


@dataclass(frozen=True, eq=False)
class Symbols:
    """Compiled functions of one cell, and of the discs at its right end, with the places (row,
    column) of their nonzeros. ``bounds`` (rows,), lower and upper."""

    locals: int
    points: int
    shared: int
    rows: int
    bounds: tuple[Array, Array]
    node_rows: IndexArray  # of a cell's weights, those that the discs need
    cost: Any
    rows_of: Any
    gradient: Any
    slopes: Any
    bends: Any
    spots: Any
    disc_slopes: Any
    disc_bends: Any
    slope_places: tuple[IndexArray, IndexArray]
    bend_places: tuple[IndexArray, IndexArray]
    disc_slope_places: tuple[IndexArray, IndexArray]
    disc_bend_places: tuple[IndexArray, IndexArray]


@dataclass(frozen=True, eq=False)
class _End:
    """The motion at one end of a cell, per unit of the path parameter."""

    rate: Any  # |q'|
    first: Any  # (x, y[, yaw]) by s
    second: Any
    twist: Any  # of the body, by s
    bend: Any  # curvature
    cos: Any
    sin: Any

    def acceleration(self, u: Any, v: Any) -> tuple[Any, Any]:
        """Along and across the body, m/s^2."""
        x, y = (self.first[k] * u + self.second[k] * v**2 for k in (0, 1))
        return self.cos * x + self.sin * y, self.cos * y - self.sin * x


@lru_cache(maxsize=16)
def symbols_of(kind: Kind, discs: int) -> Symbols:
    """The functions of a kind of cell."""
    ca = casadi()
    axes, rates = kind.axes, len(kind.norms)
    points = 4 * axes
    z, w = ca.SX.sym("z", points + 2), ca.SX.sym("w", 28)
    forces = kind.powers * (16 * kind.cones + 4 * kind.planes)
    shared = ca.SX.sym("s", _FIXED + 7 * rates + forces)
    cost, rows, low, high = _cell(ca, kind, z, w, shared)
    sigma, lam = ca.SX.sym("sigma"), ca.SX.sym("lam", rows.numel())
    gradient, slopes = ca.densify(ca.gradient(cost, z)), ca.jacobian(rows, z)
    bends = ca.triu(ca.hessian(sigma * cost + ca.dot(lam, rows), z)[0])
    at, wn, centres = ca.SX.sym("at", points), ca.SX.sym("wn", 8), ca.SX.sym("c", 2 * discs)
    spots = _spots(ca, kind, at, wn, centres, discs)
    weight = ca.SX.sym("lam", discs)
    d = [ca.SX.sym(f"d{k}", discs) for k in range(5)]
    whole = ca.jacobian(spots, at)
    jx, jy = whole[0::2, :], whole[1::2, :]
    disc_slopes = ca.diag(d[0]) @ jx + ca.diag(d[1]) @ jy
    curved = ca.hessian(ca.dot(weight * d[0], spots[0::2]) + ca.dot(weight * d[1], spots[1::2]), at)
    xx, xy, yy = (ca.diag(weight * d[k]) for k in (2, 3, 4))
    mixed = jx.T @ xy @ jy
    disc_bends = ca.triu(curved[0] + jx.T @ xx @ jx + mixed + mixed.T + jy.T @ yy @ jy)
    inputs = [z, w, shared]
    return Symbols(
        points + 2,
        points,
        shared.numel(),
        rows.numel(),
        (low, high),
        np.array([*range(12, 20)]),
        ca.Function("cost", inputs, [cost]),
        ca.Function("rows", inputs, [rows]),
        ca.Function("gradient", inputs, [gradient]),
        ca.Function("slopes", inputs, [slopes]),
        ca.Function("bends", [*inputs, sigma, lam], [bends]),
        ca.Function("spots", [at, wn, centres], [spots]),
        ca.Function("disc_slopes", [at, wn, centres, d[0], d[1]], [disc_slopes]),
        ca.Function("disc_bends", [at, wn, centres, weight, *d], [disc_bends]),
        _places(slopes),
        _places(bends),
        _places(disc_slopes),
        _places(disc_bends),
    )


def _places(matrix: Any) -> tuple[IndexArray, IndexArray]:
    row, column = matrix.sparsity().get_triplet()
    return np.array(row, dtype=np.intp), np.array(column, dtype=np.intp)


def _cell(ca: Any, kind: Kind, z: Any, w: Any, shared: Any) -> tuple[Any, Any, Array, Array]:
    """Cost, rows, and the rows' bounds."""
    axes, rates = kind.axes, len(kind.norms)
    length = shared[10]
    control = ca.reshape(z[: 4 * axes], axes, 4)
    va, vb = z[4 * axes], z[4 * axes + 1]
    q = [control @ w[4 * k : 4 * k + 4] for k in range(7)]
    left, right = (_end(ca, kind, q[k], q[k + 1], q[k + 2], length) for k in (0, 3))
    ds = (left.rate + 4 * _rate(ca, kind, q[6], length) + right.rate) / (6 * CELLS)
    time = 2 * ds / (va + vb + _STILL)
    u = (vb**2 - va**2) / (2 * ds)
    bend = (left.bend**2 + right.bend**2) / 2
    even = (right.rate / shared[4] - 1) ** 2
    cost = shared[0] * time + shared[1] * ds + shared[2] * bend * ds + shared[3] * even
    rows: list[Any] = []
    low: list[float] = []
    high: list[float] = []

    def keep(row: Any, least: float, most: float) -> None:
        rows.append(row)
        low.append(least)
        high.append(most)

    mean = (va + vb) / (2 * ds)  # of change over a cell to change in time
    turning = (right.twist[2] * vb - left.twist[2] * va) * mean
    for end, v in ((left, va), (right, vb)):
        _keep_forces(ca, kind, end, shared, (u, v, turning), keep)
    if kind.free:
        speeds = [ca.sqrt(e.twist[0] ** 2 + e.twist[1] ** 2 + _TINY) for e in (left, right)]
        u = (speeds[1] * vb - speeds[0] * va) * mean
    keep(u * shared[5], -np.inf, 1.0)
    keep(u * shared[6], -1.0, np.inf)
    keep(right.rate / shared[4], SLOWEST, FASTEST)
    if not kind.free:
        keep(left.bend * shared[7], -1.0, 1.0)
        keep(right.bend * shared[7], -1.0, 1.0)
    first = ca.reshape(shared[_FIXED : _FIXED + 3 * rates], 3, rates)
    second = ca.reshape(shared[_FIXED + 3 * rates : _FIXED + 6 * rates], 3, rates)
    for k, norm in enumerate(kind.norms):
        ends = []
        for end, v in ((left, va), (right, vb)):
            a, b = ca.dot(first[:, k], end.twist), ca.dot(second[:, k], end.twist)
            ends.append((a, b, v))
        a, b, v = ends[1]
        keep(*(((a**2 + b**2) * v**2, -np.inf, 1.0) if norm else (a * v, -1.0, 1.0)))
        if kind.changes[k]:
            size = [ca.sqrt(a**2 + b**2 + _TINY) * v if norm else a * v for a, b, v in ends]
            change = (size[1] - size[0]) * mean
            keep(change * shared[_FIXED + 6 * rates + k], -1.0, 1.0)
    if kind.steers:
        angle = [ca.atan(shared[8] * end.bend) for end in (left, right)]
        keep((angle[1] - angle[0]) * mean * shared[9], -1.0, 1.0)
    return cost, ca.vertcat(*rows), np.array(low), np.array(high)


def _keep_forces(
    ca: Any, kind: Kind, end: _End, shared: Any, motion: tuple[Any, Any, Any], keep: Any
) -> None:
    """Rows of cones and planes at one end, with s'', s' and the yaw acceleration there."""
    u, v, turning = motion
    along, across = end.acceleration(u, v)
    square = (end.twist[2] * v) ** 2  # at the centre of gravity, not at the origin
    x, y, z = (shared[k] for k in (13, 14, 15))
    w = ca.vertcat(
        along - square * shared[11] - STANDARD_GRAVITY * (end.cos * x + end.sin * y),
        across - square * shared[12] - STANDARD_GRAVITY * (end.cos * y - end.sin * x),
        turning,
        z,
    )
    at = _FIXED + 7 * len(kind.norms)
    for rows, count in ((4, kind.cones), (1, kind.planes)):
        for _ in range(count):
            value: Any = 0
            for power in range(kind.powers):
                matrix = ca.reshape(shared[at : at + 4 * rows], 4, rows).T
                value, at = value + end.bend**power * (matrix @ w), at + 4 * rows
            if rows == 4:
                keep(value[0] ** 2 + value[1] ** 2 + value[2] ** 2 - value[3] ** 2, -np.inf, 0.0)
            else:
                keep(value, 0.0, np.inf)


def _rate(ca: Any, kind: Kind, d1: Any, length: Any) -> Any:
    square = d1[0] ** 2 + d1[1] ** 2
    return ca.sqrt(square + (length * d1[2]) ** 2 if kind.free else square)


def _end(ca: Any, kind: Kind, q: Any, d1: Any, d2: Any, length: Any) -> _End:
    g = _rate(ca, kind, d1, length)
    dot = d1[0] * d2[0] + d1[1] * d2[1]
    if kind.free:
        dot += length**2 * d1[2] * d2[2]
    first, second = d1 / g, (d2 - d1 * (dot / g**2)) / g**2
    if not kind.free:
        bend = (d1[0] * d2[1] - d1[1] * d2[0]) / g**3
        return _End(g, first, second, ca.vertcat(1, 0, bend), bend, first[0], first[1])
    cos, sin = ca.cos(q[2]), ca.sin(q[2])
    x, y = cos * first[0] + sin * first[1], cos * first[1] - sin * first[0]
    bend = ca.sqrt(second[0] ** 2 + second[1] ** 2 + (length * second[2]) ** 2 + _TINY)
    return _End(g, first, second, ca.vertcat(x, y, first[2]), bend, cos, sin)


def _spots(ca: Any, kind: Kind, at: Any, w: Any, centres: Any, discs: int) -> Any:
    """x, y of the discs in turn, of a body at the place with weights of value and derivative."""
    control = ca.reshape(at, kind.axes, 4)
    place, d1 = control @ w[:4], control @ w[4:]
    if kind.free:
        cos, sin = ca.cos(place[2]), ca.sin(place[2])
    else:
        g = ca.sqrt(d1[0] ** 2 + d1[1] ** 2)
        cos, sin = d1[0] / g, d1[1] / g
    found = []
    for k in range(discs):
        x, y = centres[2 * k], centres[2 * k + 1]
        found += [place[0] + cos * x - sin * y, place[1] + sin * x + cos * y]
    return ca.vertcat(*found)
