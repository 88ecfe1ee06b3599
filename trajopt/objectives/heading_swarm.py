"""The terminal cost of whole swarms whose heading is free as well, as a numba kernel.

The formulas are those of ``rollout``, as in ``swarm``: control values enter each step through
constant rows, start and goal through one constant. Sines and cosines are not evaluated: every
rotation is the previous one turned by a small increment (``swarm.turned``), exact to rounding up to
``swarm.MAX_INCREMENT``. Candidates run in blocks of LANES over one flat state, so that the
innermost loop becomes vector instructions. A test holds the result together with
``rollout.roll_out`` to 1e-12. What is alike in ``swarm._block`` stays written out twice: there the
heading is known before the search, which removes most of the work of a step, and both need all
their values in registers.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trajopt.arrays import Array, IntArray
from trajopt.kernels import kernel
from trajopt.objectives.rollout import GAUSS_WEIGHTS, Kinematics, StepGrid
from trajopt.objectives.swarm import (
    LANES,
    MAX_INCREMENT,
    STRICT,
    CompiledSwarm,
    step_travel,
    turned,
)
from trajopt.robots.actuator import SMALL_SPAN, Actuator

# Rows of a block's state, each LANES long: what a candidate gives, the rotations, sums, and last
# wheel rates.
_Y1, _X2, _Y2, _H1, _H2, _SAT, _DZ, _TINY, _C, _S, _ANGLE, _COS, _SIN, _TURN = (
    LANES * i for i in range(1, 15)
)
_SUM_X, _SUM_Y, _SUM_YAW, _W0, _W1, _W2, _W3 = (LANES * i for i in range(15, 22))
_R0, _R1, _R2, _R3 = (LANES * i for i in range(22, 26))
_ROWS, _SUMS = 26, 15


@kernel(fastmath=STRICT)
def _block(co, inverse, forward, st):  # type: ignore[no-untyped-def]  # numba infers
    """All steps of one block of candidates; ``st`` (_ROWS * LANES,) is read and changed in place.

    Rows of ``co``: three Gauss points with heading (constant, h1, h2) and rate times weight (x, y
    constants, row of P1, row of P2); the end of the step with heading, half rates (x, y, heading
    constants, rows); the chord.
    """
    i00, i01, i02 = inverse[0, 0], inverse[0, 1], inverse[0, 2]
    i10, i11, i12 = inverse[1, 0], inverse[1, 1], inverse[1, 2]
    i20, i21, i22 = inverse[2, 0], inverse[2, 1], inverse[2, 2]
    i30, i31, i32 = inverse[3, 0], inverse[3, 1], inverse[3, 2]
    f00, f01, f02, f03 = forward[0, 0], forward[0, 1], forward[0, 2], forward[0, 3]
    f10, f11, f12, f13 = forward[1, 0], forward[1, 1], forward[1, 2], forward[1, 3]
    f20, f21, f22, f23 = forward[2, 0], forward[2, 1], forward[2, 2], forward[2, 3]
    for i in range(co.shape[0]):
        a0, a1, a2, ax, ay, ap, aq = (
            co[i, 0],
            co[i, 1],
            co[i, 2],
            co[i, 3],
            co[i, 4],
            co[i, 5],
            co[i, 6],
        )
        b0, b1, b2, bx, by, bp, bq = (
            co[i, 7],
            co[i, 8],
            co[i, 9],
            co[i, 10],
            co[i, 11],
            co[i, 12],
            co[i, 13],
        )
        e0, e1, e2, ex, ey, ep, eq = (
            co[i, 14],
            co[i, 15],
            co[i, 16],
            co[i, 17],
            co[i, 18],
            co[i, 19],
            co[i, 20],
        )
        n0, n1, n2, nx, ny, na, np_, nq = (
            co[i, 21],
            co[i, 22],
            co[i, 23],
            co[i, 24],
            co[i, 25],
            co[i, 26],
            co[i, 27],
            co[i, 28],
        )
        kx, ky, kp, kq = co[i, 29], co[i, 30], co[i, 31], co[i, 32]
        for j in range(LANES):
            x1, y1, x2, y2 = st[j], st[_Y1 + j], st[_X2 + j], st[_Y2 + j]
            h1, h2, sat, dz, tiny = (
                st[_H1 + j],
                st[_H2 + j],
                st[_SAT + j],
                st[_DZ + j],
                st[_TINY + j],
            )
            first = a0 + a1 * h1 + a2 * h2
            c, s = turned(st[_C + j], st[_S + j], first - st[_ANGLE + j])
            dx, dy = ax + ap * x1 + aq * x2, ay + ap * y1 + aq * y2
            mx, my = c * dx + s * dy, c * dy - s * dx
            middle = b0 + b1 * h1 + b2 * h2
            cm, sm = turned(c, s, middle - first)
            dx, dy = bx + bp * x1 + bq * x2, by + bp * y1 + bq * y2
            mx, my = mx + cm * dx + sm * dy, my + cm * dy - sm * dx
            last = e0 + e1 * h1 + e2 * h2
            c, s = turned(cm, sm, last - middle)
            dx, dy = ex + ep * x1 + eq * x2, ey + ep * y1 + eq * y2
            mx, my = mx + c * dx + s * dy, my + c * dy - s * dx
            end = n0 + n1 * h1 + n2 * h2
            c, s = turned(c, s, end - last)
            turn = end - st[_ANGLE + j]
            st[_C + j], st[_S + j], st[_ANGLE + j] = c, s, end
            dx, dy = nx + np_ * x1 + nq * x2, ny + np_ * y1 + nq * y2
            da = na + np_ * h1 + nq * h2
            vx, vy = c * dx + s * dy, c * dy - s * dx
            r0, r1 = i00 * vx + i01 * vy + i02 * da, i10 * vx + i11 * vy + i12 * da
            r2, r3 = i20 * vx + i21 * vy + i22 * da, i30 * vx + i31 * vy + i32 * da
            d0, d1 = i00 * mx + i01 * my + i02 * turn, i10 * mx + i11 * my + i12 * turn
            d2, d3 = i20 * mx + i21 * my + i22 * turn, i30 * mx + i31 * my + i32 * turn
            s0 = step_travel(d0, r0 - st[_R0 + j], sat, dz, tiny)
            s1 = step_travel(d1, r1 - st[_R1 + j], sat, dz, tiny)
            s2 = step_travel(d2, r2 - st[_R2 + j], sat, dz, tiny)
            s3 = step_travel(d3, r3 - st[_R3 + j], sat, dz, tiny)
            st[_R0 + j], st[_R1 + j], st[_R2 + j], st[_R3 + j] = r0, r1, r2, r3
            st[_W0 + j] += s0
            st[_W1 + j] += s1
            st[_W2 + j] += s2
            st[_W3 + j] += s3
            l0, l1, l2, l3 = s0 - d0, s1 - d1, s2 - d2, s3 - d3
            lx = f00 * l0 + f01 * l1 + f02 * l2 + f03 * l3
            ly = f10 * l0 + f11 * l1 + f12 * l2 + f13 * l3
            lt = f20 * l0 + f21 * l1 + f22 * l2 + f23 * l3
            c, s = turned(st[_COS + j], st[_SIN + j], 0.5 * (lt + st[_TURN + j]))
            st[_COS + j], st[_SIN + j], st[_TURN + j] = c, s, lt
            st[_SUM_YAW + j] += lt
            gx = kx + kp * x1 + kq * x2 + cm * lx - sm * ly
            gy = ky + kp * y1 + kq * y2 + sm * lx + cm * ly
            st[_SUM_X + j] += c * gx - s * gy
            st[_SUM_Y + j] += s * gx + c * gy


@kernel()
def _swarm(co, first, inverse, forward, z, places, fixed, limits, start, out):  # type: ignore[no-untyped-def]  # numba infers
    """Fill ``out`` (7, n) for candidates ``z`` (n, d): final x, y, yaw and the travel of four
    wheels.

    ``places`` (7,): where x1, y1, x2, y2, h1, h2 and the duration stand in a candidate, -1 for
    ``fixed``'s value. ``first`` (6,): start heading, then half rates at the start as in
    ``_block``'s rows (x, y, heading, P1, P2).
    """
    n, steps = z.shape[0], co.shape[0]
    st = np.empty(_ROWS * LANES)
    for block in range(0, n, LANES):
        for j in range(LANES):
            i = min(block + j, n - 1)
            for r in range(6):
                st[r * LANES + j] = z[i, places[r]] if places[r] >= 0 else fixed[r]
            dt = (z[i, places[6]] if places[6] >= 0 else fixed[6]) / steps
            st[_SAT + j], st[_DZ + j], st[_TINY + j] = (
                limits[0] * dt,
                limits[1] * dt,
                0.5 * limits[2] * dt,
            )
            c, s = np.cos(first[0]), np.sin(first[0])
            st[_C + j], st[_S + j], st[_ANGLE + j] = c, s, first[0]
            st[_COS + j], st[_SIN + j], st[_TURN + j] = 1.0, 0.0, 0.0
            for r in range(_SUMS, _ROWS):
                st[r * LANES + j] = 0.0
            dx = first[1] + first[4] * st[j] + first[5] * st[_X2 + j]
            dy = first[2] + first[4] * st[_Y1 + j] + first[5] * st[_Y2 + j]
            da = first[3] + first[4] * st[_H1 + j] + first[5] * st[_H2 + j]
            vx, vy = c * dx + s * dy, c * dy - s * dx
            for w in range(4):
                st[_R0 + w * LANES + j] = (
                    inverse[w, 0] * vx + inverse[w, 1] * vy + inverse[w, 2] * da
                )
        _block(co, inverse, forward, st)
        for j in range(min(LANES, n - block)):
            for r in range(7):
                out[r, block + j] = start[r] + st[(_SUMS + r) * LANES + j]


@dataclass(frozen=True)
class HeadingSwarm(CompiledSwarm):
    """For a heading that may be free; ``prepared`` makes it."""

    first: Array  # (6,), as ``_swarm`` says
    ends: Array  # (2,) start and goal heading, rad
    width: float  # of a step, in spline parameter

    def fits(self, candidates: Array) -> bool:
        """Whether every heading increment inside a step is small enough for the kernel's
        rotations."""
        h1, h2 = (
            candidates[:, p] if p >= 0 else self.fixed[4 + k]
            for k, p in enumerate(self.places[4:6])
        )
        steepest = np.max(np.abs([h1 - self.ends[0], h2 - h1, self.ends[1] - h2]), initial=0.0)
        return bool(
            3.0 * steepest * self.width < MAX_INCREMENT
        )  # a natural cubic: at most 3 times its chord's slope

    def _fill(self, z: Array, out: Array) -> None:
        _swarm(
            self.coefficients,
            self.first,
            self.inverse,
            self.forward,
            z,
            self.places,
            self.fixed,
            self.limits,
            self.start,
            out,
        )


def prepared(
    grid: StepGrid,
    kinematics: Kinematics,
    actuator: Actuator,
    x: Array,
    y: Array,
    yaw: Array,
    duration: float,
    places: IntArray,
) -> HeadingSwarm:
    """Rows for control values ``x``, ``y``, ``yaw`` (4,), of which P1, P2 and their headings may be
    replaced.

    ``places`` (7,): positions of x1, y1, x2, y2, yaw1, yaw2 and the duration in a candidate, -1
    where they keep the given value. Needs four wheels and four control points.
    """
    half = grid.width / 2
    parts = []
    for value, rate, weight in zip(grid.gauss_value, grid.gauss_rate, GAUSS_WEIGHTS, strict=True):
        scaled = weight * half * rate
        parts += [
            _constant(value, yaw),
            value[:, 1],
            value[:, 2],
            _constant(scaled, x),
            _constant(scaled, y),
            scaled[:, 1],
            scaled[:, 2],
        ]
    node, rate = grid.node_value, half * grid.node_rate
    parts += [
        _constant(node[1:], yaw),
        node[1:, 1],
        node[1:, 2],
        *(_constant(rate[1:], values) for values in (x, y, yaw)),
        rate[1:, 1],
        rate[1:, 2],
    ]
    chord = np.diff(node, axis=0)
    parts += [_constant(chord, x), _constant(chord, y), chord[:, 1], chord[:, 2]]
    first = np.array(
        [
            yaw[0],
            *(_constant(rate[:1], values)[0] for values in (x, y, yaw)),
            rate[0, 1],
            rate[0, 2],
        ]
    )
    limits = np.array([min(actuator.saturation, 1e300), actuator.dead_zone, SMALL_SPAN])
    start = np.array([x[0], y[0], yaw[3], 0.0, 0.0, 0.0, 0.0])
    return HeadingSwarm(
        np.ascontiguousarray(np.column_stack(parts)),
        np.ascontiguousarray(kinematics.inverse),
        np.ascontiguousarray(kinematics.forward),
        places,
        np.array([x[1], y[1], x[2], y[2], yaw[1], yaw[2], duration]),
        limits,
        start,
        first,
        yaw[[0, 3]],
        grid.width,
    )


def _constant(rows: Array, values: Array) -> Array:
    """(steps,): what the fixed ends contribute to rows @ control values."""
    return np.asarray(rows[:, [0, 3]] @ values[[0, 3]])
