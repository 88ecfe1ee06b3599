"""Kinematic prediction: where a spline motion ends, and with which wheel angles, through real
actuators.

One set of formulas on component arrays, used for a single candidate, for a swarm (candidates in
columns) and, unchanged, on CasADi expressions. Steps run along axis 0.

The mean wheel speed of a step is the exact integral (Gauss quadrature) of W R(-psi) p', so without
actuator limits the final wheel angles are exact on any grid. Inside a step the wheel speed is taken
as linear, with that mean and the span of the nodal speeds, and passed through the actuator exactly.
What the actuator takes away turns and shifts the robot: heading deviations add up, and
displacements are rotated by the deviation at mid-step.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.paths.spline import SplineBasis
from trajopt.robots.actuator import Actuator

_GAUSS_X, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(
    3
)  # step means exact to 1e-12 rad at 250 steps


@dataclass(frozen=True)
class Kinematics:
    """Wheel rates = inverse @ body twist; body twist = forward @ wheel rates: (W, 3) and (3, W)."""

    inverse: Array
    forward: Array


@dataclass(frozen=True)
class StepGrid:
    """Spline matrices at the nodes, middles and Gauss points of equal steps along the spline
    parameter."""

    steps: int
    width: float  # of one step, in spline parameter
    node_value: Array  # (steps + 1, K)
    node_rate: Array  # (steps + 1, K), per spline parameter
    middle_value: Array  # (steps, K)
    gauss_value: tuple[Array, ...]  # each (steps, K)
    gauss_rate: tuple[Array, ...]


@lru_cache(maxsize=32)
def step_grid(basis: SplineBasis, steps: int) -> StepGrid:
    """Constant matrices of ``steps`` equal steps over the whole spline.

    ``steps`` must be a multiple of the number of segments (equal ones), because a step across a
    knot would cost the quadrature its order; ArgumentError otherwise.
    """
    segments = np.diff(basis.knots)
    if steps < 1 or steps % len(segments) or not np.allclose(segments, segments[0], rtol=1e-12):
        raise ArgumentError(
            "steps", steps, f"a positive multiple of the {len(segments)} equal spline segments"
        )
    nodes = np.linspace(basis.knots[0], basis.knots[-1], steps + 1)
    width = float(nodes[1] - nodes[0])
    gauss = [nodes[:-1] + width * (1 + x) / 2 for x in _GAUSS_X]
    return StepGrid(
        steps,
        width,
        basis.matrix(nodes),
        basis.matrix(nodes, 1),
        basis.matrix(nodes[:-1] + width / 2),
        tuple(basis.matrix(u) for u in gauss),
        tuple(basis.matrix(u, 1) for u in gauss),
    )


@dataclass(frozen=True)
class Terminal:
    """Final state of n candidates: x, y (m), yaw (rad), and the wheel angles gained, one entry a
    wheel (rad)."""

    x: Any
    y: Any
    yaw: Any
    wheels: tuple[Any, ...]


def wheel_travel(grid: StepGrid, kinematics: Kinematics, x: Any, y: Any, yaw: Any) -> list[Any]:
    """Wheel rotation in each step, rad: W lists of (steps, n). ``x``, ``y``, ``yaw`` are control
    values (K, n)."""
    body_x, body_y = 0.0, 0.0
    for value, rate, weight in zip(grid.gauss_value, grid.gauss_rate, GAUSS_WEIGHTS, strict=True):
        angle = value @ yaw
        cos, sin, dx, dy = np.cos(angle), np.sin(angle), rate @ x, rate @ y
        scale = float(weight * grid.width / 2)
        body_x = body_x + scale * (cos * dx + sin * dy)
        body_y = body_y + scale * (cos * dy - sin * dx)
    node = grid.node_value @ yaw
    turn = node[1:] - node[:-1]
    return [a * body_x + b * body_y + c * turn for a, b, c in kinematics.inverse.tolist()]


def wheel_span(grid: StepGrid, kinematics: Kinematics, x: Any, y: Any, yaw: Any) -> list[Any]:
    """Half the change of each wheel's rate over each step, rad per unit of spline parameter."""
    angle = grid.node_value @ yaw
    cos, sin = np.cos(angle), np.sin(angle)
    dx, dy, turn = grid.node_rate @ x, grid.node_rate @ y, grid.node_rate @ yaw
    body_x, body_y = cos * dx + sin * dy, cos * dy - sin * dx
    rates = [a * body_x + b * body_y + c * turn for a, b, c in kinematics.inverse.tolist()]
    return [(rate[1:] - rate[:-1]) / 2 for rate in rates]


def roll_out(
    grid: StepGrid,
    kinematics: Kinematics,
    actuator: Actuator,
    x: Any,
    y: Any,
    yaw: Any,
    duration: Any,
) -> Terminal:
    """Final state of motions executed at uniform spline speed in ``duration`` seconds (scalar or
    (1, n)).

    ``x``, ``y`` (m) and ``yaw`` (rad) are control values (K, n), one column a candidate.
    """
    travel = wheel_travel(grid, kinematics, x, y, yaw)
    if actuator.is_ideal:
        return Terminal(
            x[-1:], y[-1:], yaw[-1:], tuple(np.sum(q, axis=0, keepdims=True) for q in travel)
        )
    step_time = duration / grid.steps
    rate_scale = grid.width / step_time  # spline parameter per second
    span = wheel_span(grid, kinematics, x, y, yaw)
    actual = [
        actuator.step_mean(q / step_time, d * rate_scale) * step_time
        for q, d in zip(travel, span, strict=True)
    ]
    lost = [a - q for a, q in zip(actual, travel, strict=True)]
    shift_x, shift_y, turn = (_weighted(row, lost) for row in kinematics.forward.tolist())
    deviation = np.cumsum(turn, axis=0) - turn / 2  # of the heading, at mid-step
    position_x, position_y = grid.node_value @ x, grid.node_value @ y
    dx, dy = position_x[1:] - position_x[:-1], position_y[1:] - position_y[:-1]
    cos, sin = np.cos(deviation), np.sin(deviation)
    heading = grid.middle_value @ yaw + deviation
    cos_h, sin_h = np.cos(heading), np.sin(heading)
    moved_x = cos * dx - sin * dy + cos_h * shift_x - sin_h * shift_y
    moved_y = sin * dx + cos * dy + sin_h * shift_x + cos_h * shift_y
    return Terminal(
        position_x[:1] + np.sum(moved_x, axis=0, keepdims=True),
        position_y[:1] + np.sum(moved_y, axis=0, keepdims=True),
        yaw[-1:] + np.sum(turn, axis=0, keepdims=True),
        tuple(np.sum(a, axis=0, keepdims=True) for a in actual),
    )


def _weighted(row: list[float], columns: list[Any]) -> Any:
    total: Any = 0.0
    for weight, column in zip(row, columns, strict=True):
        total = total + weight * column
    return total
