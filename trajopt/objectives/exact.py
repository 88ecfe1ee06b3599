"""The same prediction without a time grid's error, for scoring one candidate.

Step averages are exact only where no wheel crosses saturation or dead-zone inside a step. Here the
crossing times are located, the motion is cut there, and every piece, on which the integrand is
smooth, is integrated by Gauss quadrature: heading first, then displacement with the heading that
the wheels really produced. The result does not depend on a step size beyond rounding, so it is what
solutions are judged by.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trajopt.arrays import Array, IndexArray
from trajopt.objectives.rollout import Kinematics, Terminal
from trajopt.paths.spline import SplineBasis
from trajopt.robots.actuator import Actuator

_NODES = 6
_GAUSS_X, _GAUSS_W = np.polynomial.legendre.leggauss(_NODES)
_UNIT_X, _UNIT_W = (1 + _GAUSS_X) / 2, _GAUSS_W / 2


def _integration_matrix() -> Array:
    """(nodes, nodes): integral from 0 to each Gauss node of the interpolant through the nodes, on
    [0, 1]."""
    powers = np.vander(_UNIT_X, increasing=True)
    integrals = np.column_stack([_UNIT_X ** (k + 1) / (k + 1) for k in range(_NODES)])
    return integrals @ np.linalg.inv(powers)


_TO_NODES = _integration_matrix()


def exact_terminal(
    basis: SplineBasis,
    kinematics: Kinematics,
    actuator: Actuator,
    x: Array,
    y: Array,
    yaw: Array,
    duration: float,
    cells: int = 60,
) -> Terminal:
    """Final state of one motion executed at uniform spline speed in ``duration`` s.

    ``x``, ``y`` (m) and ``yaw`` (rad) are the control values (K,) of a natural spline. ``cells``
    equal cells are cut further at every crossing of a wheel's speed with +-saturation and
    +-dead-zone; two crossings of one wheel inside one cell stay unseen, so keep cells well below
    the number of oscillations of the wheel speeds.
    """
    speed = (basis.knots[-1] - basis.knots[0]) / duration

    knots = np.asarray(basis.knots)
    cubics = basis.polynomials(np.column_stack([x, y, yaw]))

    def body(u: Array) -> tuple[Array, Array, Array, Array]:
        """Heading and body twist at spline parameters u (n,)."""
        i = np.clip(np.searchsorted(knots, u, side="right") - 1, 0, len(knots) - 2)
        t, (a, b, c, d) = (u - knots[i])[:, None], cubics[i].transpose(1, 0, 2)
        rate = ((3.0 * d * t + 2.0 * c) * t + b) * speed
        angle = ((d[:, 2] * t[:, 0] + c[:, 2]) * t[:, 0] + b[:, 2]) * t[:, 0] + a[:, 2]
        cos, sin = np.cos(angle), np.sin(angle)
        return (
            angle,
            cos * rate[:, 0] + sin * rate[:, 1],
            cos * rate[:, 1] - sin * rate[:, 0],
            rate[:, 2],
        )

    def wheel_speeds(u: Array) -> Array:
        _, vx, vy, wz = body(u)
        return np.column_stack([vx, vy, wz]) @ kinematics.inverse.T

    nodes = _nodes(basis, cells)
    cuts = nodes if actuator.is_ideal else _with_crossings(nodes, wheel_speeds, actuator)
    width = np.diff(cuts)
    points = cuts[:-1, None] + width[:, None] * _UNIT_X
    angle, vx, vy, wz = body(points.ravel())
    commanded = np.column_stack([vx, vy, wz]) @ kinematics.inverse.T
    actual = np.asarray(actuator.output(commanded))
    seconds = width / speed
    twist = actual @ kinematics.forward.T
    turn = (twist[:, 2] - wz).reshape(points.shape)  # deviation from the planned yaw rate
    inside = turn @ _TO_NODES.T * seconds[:, None]
    gained = turn @ _UNIT_W * seconds
    before = np.concatenate([[0.0], np.cumsum(gained)[:-1]])
    heading = angle.reshape(points.shape) + before[:, None] + inside
    lost = twist - np.column_stack([vx, vy, wz])
    weights = (seconds[:, None] * _UNIT_W).ravel()
    h, planned = heading.ravel(), angle
    # Planned displacement turned by the deviation, plus what the wheels lost: exact when nothing is
    # lost.
    dev_cos, dev_sin = np.cos(h - planned) - 1.0, np.sin(h - planned)
    world_x = np.cos(planned) * vx - np.sin(planned) * vy
    world_y = np.sin(planned) * vx + np.cos(planned) * vy
    end_x = x[-1] + weights @ (
        dev_cos * world_x - dev_sin * world_y + np.cos(h) * lost[:, 0] - np.sin(h) * lost[:, 1]
    )
    end_y = y[-1] + weights @ (
        dev_sin * world_x + dev_cos * world_y + np.sin(h) * lost[:, 0] + np.cos(h) * lost[:, 1]
    )
    return Terminal(end_x, end_y, yaw[-1] + gained.sum(), tuple(weights @ actual))


def _nodes(basis: SplineBasis, cells: int) -> Array:
    """Cell borders: ``cells`` equal cells in all, knots included."""
    per_segment = max(1, cells // (len(basis.knots) - 1))
    parts = [
        np.linspace(a, b, per_segment, endpoint=False)
        for a, b in zip(basis.knots[:-1], basis.knots[1:], strict=True)
    ]
    return np.concatenate([*parts, [basis.knots[-1]]])


def _with_crossings(
    nodes: Array, wheel_speeds: Callable[[Array], Array], actuator: Actuator
) -> Array:
    """Nodes together with every place where a wheel speed crosses a level of the actuator."""
    speeds = wheel_speeds(nodes)
    levels = np.array([v for v in (actuator.saturation, actuator.dead_zone) if 0 < v < np.inf])
    levels = np.concatenate([levels, -levels])
    above = speeds[:, :, None] > levels
    cell, wheel, level = np.nonzero(above[1:] != above[:-1])
    if not cell.size:
        return nodes
    roots = _locate(wheel_speeds, wheel, levels[level], nodes[cell], nodes[cell + 1])
    return np.unique(np.concatenate([nodes, roots]))


def _locate(
    wheel_speeds: Callable[[Array], Array],
    wheel: IndexArray,
    level: Array,
    low: Array,
    high: Array,
) -> Array:
    """Roots of wheel_speed - level in [low, high], all at once: regula falsi (Illinois) to
    rounding."""
    rows = np.arange(len(wheel))

    def value(u: Array) -> Array:
        return np.asarray(wheel_speeds(u)[rows, wheel] - level)

    f_low, f_high = value(low), value(high)
    first, last = low, high
    root = low
    for _ in range(12):
        slope = f_high - f_low
        root = np.where(
            slope == 0, high, (low * f_high - high * f_low) / np.where(slope == 0, 1.0, slope)
        )
        f_root = value(root)
        if np.all(np.abs(f_root) < 1e-12 * np.maximum(1.0, np.abs(level))):
            break
        same = np.sign(f_root) == np.sign(f_high)
        f_low = np.where(same, f_low * 0.5, f_high)  # Illinois: halve the end that stays
        low = np.where(same, low, high)
        high, f_high = root, f_root
    return np.clip(root, first, last)
