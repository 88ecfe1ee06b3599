"""The prediction of ``rollout`` as a numba kernel, for swarms and Newton steps.

The formulas are those of ``trajopt.objectives.rollout``; a test holds the two together to 1e-12.
Steps run outside and candidates inside, so that the inner loop has no branches and no trigonometry:
every rotation is the previous one turned by a small increment, with a polynomial that is exact to
rounding for increments up to 0.2 rad (`MAX_INCREMENT`).
"""

from __future__ import annotations

import numba
import numpy as np

from trajopt.arrays import Array
from trajopt.objectives.rollout import GAUSS_WEIGHTS, Kinematics, StepGrid
from trajopt.robots.actuator import SMALL_SPAN, Actuator

S3, S5, S7, S9 = -1 / 6, 1 / 120, -1 / 5040, 1 / 362880  # Taylor coefficients of the sine
C2, C4, C6, C8, C10 = -1 / 2, 1 / 24, -1 / 720, 1 / 40320, -1 / 3628800  # and of the cosine
# Fast-math without reassociation, which would cancel (m + h) - (m - h) to 2 h and lose the digits
# of short spans.
STRICT = {"nsz", "contract"}
MAX_INCREMENT = 0.2  # rad; the first dropped term of the series is below 1e-17 there


@numba.njit(inline="always", fastmath=STRICT)
def _turned(c, s, a):  # type: ignore[no-untyped-def]  # numba infers
    """(cos, sin) turned by the small angle a."""
    q = a * a
    sin = a * (1.0 + q * (S3 + q * (S5 + q * (S7 + q * S9))))
    cos = 1.0 + q * (C2 + q * (C4 + q * (C6 + q * (C8 + q * C10))))
    return c * cos - s * sin, s * cos + c * sin


@numba.njit(inline="always", fastmath=STRICT)
def _step_mean(mean, half, sat, dz):  # type: ignore[no-untyped-def]  # numba infers
    """Actuator.step_mean on scalars, without branches."""
    low, high = mean - half, mean + half
    span = high - low
    small = abs(span) < SMALL_SPAN
    a, b = min(max(low, -sat), sat), min(max(high, -sat), sat)
    p, q = min(max(low, -dz), dz), min(max(high, -dz), dz)
    total = 0.5 * ((b - a) * (b + a) - (q - p) * (q + p)) + sat * (abs(high - b) - abs(low - a))
    clipped = min(max(mean, -sat), sat)
    single = 0.0 if abs(mean) < dz else clipped
    return single if small else total / (1.0 if small else span)


@numba.njit(cache=True, error_model="numpy", fastmath=STRICT)
def _kernel(  # type: ignore[no-untyped-def]  # numba infers
    node,
    rate,
    g0,
    g1,
    g2,
    r0,
    r1,
    r2,
    weights,
    width,
    inverse,
    forward,
    sat,
    dz,
    x,
    y,
    yaw,
    duration,
    out,
):
    """Fill ``out`` (3 + 4, n) with final x, y, yaw and the wheel travel of n candidates (four
    wheels)."""
    steps, n = g0.shape[0], x.shape[1]
    c, s, ang = np.empty(n), np.empty(n), np.empty(n)
    dev_c, dev_s = np.ones(n), np.zeros(n)
    w0, w1, w2, w3 = np.empty(n), np.empty(n), np.empty(n), np.empty(n)
    px, py = np.empty(n), np.empty(n)
    sum_x, sum_y, sum_t = np.zeros(n), np.zeros(n), np.zeros(n)
    t0, t1, t2, t3 = np.zeros(n), np.zeros(n), np.zeros(n), np.zeros(n)
    i00, i01, i02 = inverse[0, 0], inverse[0, 1], inverse[0, 2]
    i10, i11, i12 = inverse[1, 0], inverse[1, 1], inverse[1, 2]
    i20, i21, i22 = inverse[2, 0], inverse[2, 1], inverse[2, 2]
    i30, i31, i32 = inverse[3, 0], inverse[3, 1], inverse[3, 2]
    f00, f01, f02, f03 = forward[0, 0], forward[0, 1], forward[0, 2], forward[0, 3]
    f10, f11, f12, f13 = forward[1, 0], forward[1, 1], forward[1, 2], forward[1, 3]
    f20, f21, f22, f23 = forward[2, 0], forward[2, 1], forward[2, 2], forward[2, 3]
    for j in range(n):
        c[j], s[j], ang[j] = np.cos(yaw[0, j]), np.sin(yaw[0, j]), yaw[0, j]
        dx = (
            rate[0, 0] * x[0, j]
            + rate[0, 1] * x[1, j]
            + rate[0, 2] * x[2, j]
            + rate[0, 3] * x[3, j]
        )
        dy = (
            rate[0, 0] * y[0, j]
            + rate[0, 1] * y[1, j]
            + rate[0, 2] * y[2, j]
            + rate[0, 3] * y[3, j]
        )
        da = (
            rate[0, 0] * yaw[0, j]
            + rate[0, 1] * yaw[1, j]
            + rate[0, 2] * yaw[2, j]
            + rate[0, 3] * yaw[3, j]
        )
        bx, by = c[j] * dx + s[j] * dy, c[j] * dy - s[j] * dx
        w0[j], w1[j] = i00 * bx + i01 * by + i02 * da, i10 * bx + i11 * by + i12 * da
        w2[j], w3[j] = i20 * bx + i21 * by + i22 * da, i30 * bx + i31 * by + i32 * da
        px[j], py[j] = x[0, j], y[0, j]
    half_width = width / 2.0
    k0, k1, k2 = weights[0] * half_width, weights[1] * half_width, weights[2] * half_width
    for i in range(steps):
        a0, a1, a2, a3 = g0[i, 0], g0[i, 1], g0[i, 2], g0[i, 3]
        b0, b1, b2, b3 = g1[i, 0], g1[i, 1], g1[i, 2], g1[i, 3]
        e0, e1, e2, e3 = g2[i, 0], g2[i, 1], g2[i, 2], g2[i, 3]
        p0, p1, p2, p3 = r0[i, 0], r0[i, 1], r0[i, 2], r0[i, 3]
        q0, q1, q2, q3 = r1[i, 0], r1[i, 1], r1[i, 2], r1[i, 3]
        u0, u1, u2, u3 = r2[i, 0], r2[i, 1], r2[i, 2], r2[i, 3]
        n0, n1, n2, n3 = node[i + 1, 0], node[i + 1, 1], node[i + 1, 2], node[i + 1, 3]
        m0, m1, m2, m3 = rate[i + 1, 0], rate[i + 1, 1], rate[i + 1, 2], rate[i + 1, 3]
        for j in range(n):
            x0, x1, x2, x3 = x[0, j], x[1, j], x[2, j], x[3, j]
            y0, y1, y2, y3 = y[0, j], y[1, j], y[2, j], y[3, j]
            h0, h1, h2, h3 = yaw[0, j], yaw[1, j], yaw[2, j], yaw[3, j]
            old = ang[j]
            angle = a0 * h0 + a1 * h1 + a2 * h2 + a3 * h3
            cc, ss = _turned(c[j], s[j], angle - old)
            dx, dy = p0 * x0 + p1 * x1 + p2 * x2 + p3 * x3, p0 * y0 + p1 * y1 + p2 * y2 + p3 * y3
            bx, by = k0 * (cc * dx + ss * dy), k0 * (cc * dy - ss * dx)
            mid = b0 * h0 + b1 * h1 + b2 * h2 + b3 * h3
            cm, sm = _turned(cc, ss, mid - angle)
            dx, dy = q0 * x0 + q1 * x1 + q2 * x2 + q3 * x3, q0 * y0 + q1 * y1 + q2 * y2 + q3 * y3
            bx, by = bx + k1 * (cm * dx + sm * dy), by + k1 * (cm * dy - sm * dx)
            angle = e0 * h0 + e1 * h1 + e2 * h2 + e3 * h3
            cc, ss = _turned(cm, sm, angle - mid)
            dx, dy = u0 * x0 + u1 * x1 + u2 * x2 + u3 * x3, u0 * y0 + u1 * y1 + u2 * y2 + u3 * y3
            bx, by = bx + k2 * (cc * dx + ss * dy), by + k2 * (cc * dy - ss * dx)
            end = n0 * h0 + n1 * h1 + n2 * h2 + n3 * h3
            cc, ss = _turned(cc, ss, end - angle)
            c[j], s[j], ang[j] = cc, ss, end
            turn = end - old
            d0, d1 = i00 * bx + i01 * by + i02 * turn, i10 * bx + i11 * by + i12 * turn
            d2, d3 = i20 * bx + i21 * by + i22 * turn, i30 * bx + i31 * by + i32 * turn
            dx, dy = m0 * x0 + m1 * x1 + m2 * x2 + m3 * x3, m0 * y0 + m1 * y1 + m2 * y2 + m3 * y3
            da = m0 * h0 + m1 * h1 + m2 * h2 + m3 * h3
            vx, vy = cc * dx + ss * dy, cc * dy - ss * dx
            z0, z1 = i00 * vx + i01 * vy + i02 * da, i10 * vx + i11 * vy + i12 * da
            z2, z3 = i20 * vx + i21 * vy + i22 * da, i30 * vx + i31 * vy + i32 * da
            dt = duration[j] / steps
            to_speed, scale = 1.0 / dt, half_width / dt
            s0 = _step_mean(d0 * to_speed, (z0 - w0[j]) * scale, sat, dz) * dt
            s1 = _step_mean(d1 * to_speed, (z1 - w1[j]) * scale, sat, dz) * dt
            s2 = _step_mean(d2 * to_speed, (z2 - w2[j]) * scale, sat, dz) * dt
            s3 = _step_mean(d3 * to_speed, (z3 - w3[j]) * scale, sat, dz) * dt
            w0[j], w1[j], w2[j], w3[j] = z0, z1, z2, z3
            t0[j] += s0
            t1[j] += s1
            t2[j] += s2
            t3[j] += s3
            l0, l1, l2, l3 = s0 - d0, s1 - d1, s2 - d2, s3 - d3
            lx = f00 * l0 + f01 * l1 + f02 * l2 + f03 * l3
            ly = f10 * l0 + f11 * l1 + f12 * l2 + f13 * l3
            lt = f20 * l0 + f21 * l1 + f22 * l2 + f23 * l3
            ec, es = _turned(dev_c[j], dev_s[j], 0.5 * lt)
            dev_c[j], dev_s[j] = _turned(ec, es, 0.5 * lt)
            sum_t[j] += lt
            nx, ny = n0 * x0 + n1 * x1 + n2 * x2 + n3 * x3, n0 * y0 + n1 * y1 + n2 * y2 + n3 * y3
            dx, dy = nx - px[j], ny - py[j]
            px[j], py[j] = nx, ny
            ch, sh = cm * ec - sm * es, sm * ec + cm * es
            sum_x[j] += ec * dx - es * dy + ch * lx - sh * ly
            sum_y[j] += es * dx + ec * dy + sh * lx + ch * ly
    for j in range(n):
        out[0, j], out[1, j], out[2, j] = (
            x[0, j] + sum_x[j],
            y[0, j] + sum_y[j],
            yaw[3, j] + sum_t[j],
        )
        out[3, j], out[4, j], out[5, j], out[6, j] = t0[j], t1[j], t2[j], t3[j]


def fits(grid: StepGrid, kinematics: Kinematics, yaw: Array) -> bool:
    """Whether the kernel applies: four wheels, four control points, small turns a step."""
    if kinematics.inverse.shape != (4, 3) or yaw.shape[0] != 4:
        return False
    steepest = float(np.max(np.abs(np.diff(yaw, axis=0)))) if yaw.size else 0.0
    return (
        3.0 * steepest * grid.width < MAX_INCREMENT
    )  # a natural cubic is at most 3 times its chord's slope


def roll_out_swarm(
    grid: StepGrid,
    kinematics: Kinematics,
    actuator: Actuator,
    x: Array,
    y: Array,
    yaw: Array,
    duration: Array,
) -> Array:
    """(7, n): final x, y, yaw and travel of four wheels of n candidates: see
    ``rollout.roll_out``."""
    n = max(a.shape[1] for a in (x, y, yaw))
    full = [np.ascontiguousarray(np.broadcast_to(a, (4, n))) for a in (x, y, yaw)]
    out = np.empty((7, n))
    saturation = min(actuator.saturation, 1e300)  # inf would give inf - inf
    g0, g1, g2 = grid.gauss_value
    r0, r1, r2 = grid.gauss_rate
    _kernel(
        grid.node_value,
        grid.node_rate,
        g0,
        g1,
        g2,
        r0,
        r1,
        r2,
        GAUSS_WEIGHTS,
        grid.width,
        kinematics.inverse,
        kinematics.forward,
        saturation,
        actuator.dead_zone,
        full[0],
        full[1],
        full[2],
        np.ascontiguousarray(np.broadcast_to(np.ravel(duration), (n,)), dtype=np.float64),
        out,
    )
    return out
