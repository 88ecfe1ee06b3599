"""The terminal cost of whole swarms with a prescribed heading, as a numba kernel.

Where the heading is the same for all candidates, everything trigonometric is too: each step's wheel
travel, half the change of its wheel rates and its displacement are affine in the free control
points, with coefficients that are computed once a problem. What remains a candidate and a step is
the actuator, the small rotation by which the lost wheel travel turned the robot, and sums.
Candidates run in blocks of LANES, so that the innermost loop is one vector instruction after the
other. A test holds the result together with ``rollout.roll_out`` to 1e-12.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numba
import numpy as np

from trajopt.arrays import Array, IntArray
from trajopt.kernels import kernel
from trajopt.objectives.rollout import GAUSS_WEIGHTS, Kinematics, StepGrid
from trajopt.robots.actuator import SMALL_SPAN, Actuator

S3, S5, S7, S9 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880  # Taylor coefficients of the sine
C2, C4, C6, C8, C10 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800  # and of the cosine
MAX_INCREMENT = 0.2  # rad; the first dropped term of the series is below 1e-17 there
# Fast-math without reassociation, which would cancel (m + h) - (m - h) to 2 h and lose the digits
# of short spans.
STRICT = {"nsz", "contract"}
LANES = (
    4  # candidates a block: one vector of doubles (AVX2); 8 and 16 measured slower, registers spill
)
# Rows of a block's state, each LANES long.
_Y1, _X2, _Y2, _SAT, _DZ, _TINY, _COS, _SIN, _TURN = (LANES * i for i in range(1, 10))
_SUM_X, _SUM_Y, _SUM_YAW, _W0, _W1, _W2, _W3 = (LANES * i for i in range(10, 17))
_ROWS = 17
_SUMS = 10  # first row that is added up over the steps


@numba.njit(inline="always", fastmath=STRICT)
def step_travel(d, h, sat, dz, tiny):  # type: ignore[no-untyped-def]  # numba infers
    """Actuator.step_mean in wheel travel: mean d, half-span h, limits as travel a step.

    Half-spans below ``tiny`` are widened to it, which changes nothing but exactly at a kink of the
    actuator.
    """
    half = max(abs(h), tiny)
    low, high = d - half, d + half
    size_low, size_high = abs(low), abs(high)
    cut_low, cut_high = min(size_low, sat), min(size_high, sat)
    a, b = max(cut_low, dz), max(cut_high, dz)
    total = 0.5 * (b - a) * (b + a) + sat * ((size_high - size_low) - (cut_high - cut_low))
    return total / (high - low)


@numba.njit(inline="always", fastmath=STRICT)
def turned(c, s, a):  # type: ignore[no-untyped-def]  # numba infers
    """(cos, sin) turned by the angle a, exact to rounding up to MAX_INCREMENT."""
    q = a * a
    sin = a * (1.0 + q * (S3 + q * (S5 + q * (S7 + q * S9))))
    cos = 1.0 + q * (C2 + q * (C4 + q * (C6 + q * (C8 + q * C10))))
    return c * cos - s * sin, s * cos + c * sin


@kernel(fastmath=STRICT)
def _block(co, inverse, forward, st):  # type: ignore[no-untyped-def]  # numba infers
    """All steps of one block of candidates; ``st`` (_ROWS * LANES,) is read and changed in
    place."""
    i00, i01, i10, i11 = inverse[0, 0], inverse[0, 1], inverse[1, 0], inverse[1, 1]
    i20, i21, i30, i31 = inverse[2, 0], inverse[2, 1], inverse[3, 0], inverse[3, 1]
    f00, f01, f02, f03 = forward[0, 0], forward[0, 1], forward[0, 2], forward[0, 3]
    f10, f11, f12, f13 = forward[1, 0], forward[1, 1], forward[1, 2], forward[1, 3]
    f20, f21, f22, f23 = forward[2, 0], forward[2, 1], forward[2, 2], forward[2, 3]
    for i in range(co.shape[0]):
        a0, a1, a2, a3, a4 = co[i, 0], co[i, 1], co[i, 2], co[i, 3], co[i, 4]
        b0, b1, b2, b3, b4 = co[i, 5], co[i, 6], co[i, 7], co[i, 8], co[i, 9]
        g0, g1, g2, g3, g4 = co[i, 10], co[i, 11], co[i, 12], co[i, 13], co[i, 14]
        h0, h1, h2, h3, h4 = co[i, 15], co[i, 16], co[i, 17], co[i, 18], co[i, 19]
        p0, q0, p1, p2, cm, sm = co[i, 20], co[i, 21], co[i, 22], co[i, 23], co[i, 24], co[i, 25]
        u0, u1, u2, u3 = co[i, 26], co[i, 27], co[i, 28], co[i, 29]
        v0, v1, v2, v3 = co[i, 30], co[i, 31], co[i, 32], co[i, 33]
        for j in range(LANES):
            x1, y1, x2, y2 = st[j], st[_Y1 + j], st[_X2 + j], st[_Y2 + j]
            sat, dz, tiny = st[_SAT + j], st[_DZ + j], st[_TINY + j]
            bx = a0 + a1 * x1 + a2 * y1 + a3 * x2 + a4 * y2
            by = b0 + b1 * x1 + b2 * y1 + b3 * x2 + b4 * y2
            ex = g0 + g1 * x1 + g2 * y1 + g3 * x2 + g4 * y2
            ey = h0 + h1 * x1 + h2 * y1 + h3 * x2 + h4 * y2
            d0, d1 = u0 + i00 * bx + i01 * by, u1 + i10 * bx + i11 * by
            d2, d3 = u2 + i20 * bx + i21 * by, u3 + i30 * bx + i31 * by
            s0 = step_travel(d0, v0 + i00 * ex + i01 * ey, sat, dz, tiny)
            s1 = step_travel(d1, v1 + i10 * ex + i11 * ey, sat, dz, tiny)
            s2 = step_travel(d2, v2 + i20 * ex + i21 * ey, sat, dz, tiny)
            s3 = step_travel(d3, v3 + i30 * ex + i31 * ey, sat, dz, tiny)
            st[_W0 + j] += s0
            st[_W1 + j] += s1
            st[_W2 + j] += s2
            st[_W3 + j] += s3
            l0, l1, l2, l3 = s0 - d0, s1 - d1, s2 - d2, s3 - d3
            lx = f00 * l0 + f01 * l1 + f02 * l2 + f03 * l3
            ly = f10 * l0 + f11 * l1 + f12 * l2 + f13 * l3
            lt = f20 * l0 + f21 * l1 + f22 * l2 + f23 * l3
            # From the last step's middle to this one's: half of either step's lost turn.
            c, s = turned(st[_COS + j], st[_SIN + j], 0.5 * (lt + st[_TURN + j]))
            st[_COS + j], st[_SIN + j], st[_TURN + j] = c, s, lt
            st[_SUM_YAW + j] += lt
            mx = p0 + p1 * x1 + p2 * x2 + cm * lx - sm * ly
            my = q0 + p1 * y1 + p2 * y2 + sm * lx + cm * ly
            st[_SUM_X + j] += c * mx - s * my
            st[_SUM_Y + j] += s * mx + c * my


@kernel()
def _swarm(co, inverse, forward, z, places, fixed, limits, start, out):  # type: ignore[no-untyped-def]  # numba infers
    """Fill ``out`` (7, n) for candidates ``z`` (n, d): final x, y, yaw and the travel of four
    wheels.

    ``places`` (5,): where x1, y1, x2, y2 and the duration stand in a candidate, or -1 for
    ``fixed``'s value.
    """
    n = z.shape[0]
    steps = co.shape[0]
    st = np.empty(_ROWS * LANES)
    for first in range(0, n, LANES):
        for j in range(LANES):
            i = min(first + j, n - 1)
            for r in range(4):
                st[r * LANES + j] = z[i, places[r]] if places[r] >= 0 else fixed[r]
            dt = (z[i, places[4]] if places[4] >= 0 else fixed[4]) / steps
            st[_SAT + j], st[_DZ + j], st[_TINY + j] = (
                limits[0] * dt,
                limits[1] * dt,
                0.5 * limits[2] * dt,
            )
            st[_COS + j] = 1.0
            for r in range(_SUMS - 2, _ROWS):
                st[r * LANES + j] = 0.0
        _block(co, inverse, forward, st)
        for j in range(min(LANES, n - first)):
            for r in range(7):
                out[r, first + j] = start[r] + st[(_SUMS + r) * LANES + j]


@kernel()
def terminal_costs(end, pose, gains, wanted, wheel_gains, period, cost):  # type: ignore[no-untyped-def]  # numba infers
    """Table 4.4 of [guzman2015] from final states ``end`` (7, n)."""
    for i in range(end.shape[1]):
        total = 0.0
        for r in range(3):
            total += gains[r] * abs(end[r, i] - pose[r])
        for r in range(4):
            error = end[3 + r, i] - wanted[r]
            total += wheel_gains[r] * abs(error - period * np.floor(error / period + 0.5))
        cost[i] = total


@dataclass(frozen=True)
class Goal:
    """What the cost compares with: final pose (3,), wheel travel (4,), their gains, and the period,
    rad."""

    pose: Array
    gains: Array
    travel: Array
    wheel_gains: Array  # zero for wheels that are not critical
    period: float


@dataclass(frozen=True)
class CompiledSwarm(ABC):
    """Prediction and cost of candidates of one problem, by a kernel over constants of each step."""

    coefficients: Array  # (steps, ...)
    inverse: Array
    forward: Array
    places: IntArray
    fixed: Array
    limits: Array
    start: Array  # (7,)

    @abstractmethod
    def fits(self, candidates: Array) -> bool:
        """Whether the kernel applies to candidates (n, d)."""

    @abstractmethod
    def _fill(self, z: Array, out: Array) -> None:
        """Final states of candidates ``z`` (n, d) into ``out`` (7, n)."""

    def predict(self, candidates: Array) -> Array:
        """(7, n): final x, y (m), yaw and wheel travel (rad) of candidates (n, d)."""
        z = np.ascontiguousarray(candidates, dtype=np.float64)
        out = np.empty((7, len(z)))
        self._fill(z, out)
        return out

    def cost(self, candidates: Array, goal: Goal) -> Array:
        """(n,): terminal cost of candidates (n, d)."""
        cost = np.empty(len(candidates))
        terminal_costs(
            self.predict(candidates),
            goal.pose,
            goal.gains,
            goal.travel,
            goal.wheel_gains,
            goal.period,
            cost,
        )
        return cost


@dataclass(frozen=True)
class PrescribedSwarm(CompiledSwarm):
    """For a prescribed heading; ``prepared`` makes it."""

    def fits(self, candidates: Array) -> bool:  # noqa: ARG002
        """Always: nothing that a candidate holds turns the robot."""
        return True

    def _fill(self, z: Array, out: Array) -> None:
        _swarm(
            self.coefficients,
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
) -> PrescribedSwarm:
    """Coefficients for control values ``x``, ``y``, ``yaw`` (4,), of which P1 and P2 may be
    replaced.

    ``places`` (5,): positions of x1, y1, x2, y2 and the duration in a candidate, -1 where they keep
    the given value. Needs four wheels and four control points.
    """
    half = grid.width / 2
    mean_x = np.zeros((grid.steps, 8))  # body displacement a step, as a row over (x0..x3, y0..y3)
    mean_y = np.zeros((grid.steps, 8))
    for value, rate, weight in zip(grid.gauss_value, grid.gauss_rate, GAUSS_WEIGHTS, strict=True):
        row_x, row_y = _body_rows(value @ yaw, rate)
        mean_x, mean_y = mean_x + weight * half * row_x, mean_y + weight * half * row_y
    node_x, node_y = _body_rows(grid.node_value @ yaw, grid.node_rate)
    span_x, span_y = (half * np.diff(rows, axis=0) for rows in (node_x, node_y))
    shift = np.diff(grid.node_value, axis=0)
    middle = grid.middle_value @ yaw
    turn, turn_span = np.diff(grid.node_value @ yaw), half * np.diff(grid.node_rate @ yaw)
    spin = kinematics.inverse[:, 2]
    parts = [_affine(rows, x, y) for rows in (mean_x, mean_y, span_x, span_y)]
    ends = np.column_stack(
        [shift[:, [0, 3]] @ x[[0, 3]], shift[:, [0, 3]] @ y[[0, 3]], shift[:, 1], shift[:, 2]]
    )
    table = np.column_stack(
        [
            *parts,
            ends,
            np.cos(middle),
            np.sin(middle),
            turn[:, None] * spin,
            turn_span[:, None] * spin,
        ]
    )
    limits = np.array([min(actuator.saturation, 1e300), actuator.dead_zone, SMALL_SPAN])
    start = np.array([x[0], y[0], yaw[3], 0.0, 0.0, 0.0, 0.0])
    return PrescribedSwarm(
        np.ascontiguousarray(table),
        np.ascontiguousarray(kinematics.inverse),
        np.ascontiguousarray(kinematics.forward),
        places,
        np.array([x[1], y[1], x[2], y[2], duration]),
        limits,
        start,
    )


def _body_rows(angle: Array, rate: Array) -> tuple[Array, Array]:
    """(steps, 8) rows over (x0..x3, y0..y3) of the body-frame rate of the position at headings
    ``angle``."""
    c, s = np.cos(angle)[:, None], np.sin(angle)[:, None]
    return np.hstack([c * rate, s * rate]), np.hstack([-s * rate, c * rate])


def _affine(rows: Array, x: Array, y: Array) -> Array:
    """(steps, 5): constant part and coefficients of x1, y1, x2, y2."""
    constant = rows[:, [0, 3]] @ x[[0, 3]] + rows[:, [4, 7]] @ y[[0, 3]]
    return np.column_stack([constant, rows[:, 1], rows[:, 5], rows[:, 2], rows[:, 6]])
