"""What only the pages beside [udengaard2008] need: full factorials, tops of sampled
curves, the square at one speed."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_positive
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.systems.asoc.design import BOUNDS, LEVELS, AsocDesign, grid
from trajopt.systems.asoc.modules import (
    AsocGeometry,
    largest_pivot,
    wheel_positions,
    workspace_radius,
)
from trajopt.systems.asoc.reference import SPEED, Reference, checked_corners
from trajopt.world.height_map import HeightMap
from trajopt.world.wheel_contact import wheel_contact


def full_factorial(design: AsocDesign, levels: int = LEVELS) -> tuple[Array, float]:
    """The best feasible design (4,) and its J among levels^4 on the design's bounds (section 3.2).

    The open grid lets each formula run only over the variables it has. Raises ArgumentError for
    fewer than 2 levels or when no design is feasible.
    """
    if levels < 2:
        raise ArgumentError("levels", levels, "at least 2 levels a variable")
    columns = grid(design.bounds, levels)
    value = np.where(np.minimum(*design.slack(*columns)) >= 0, design.total(*columns), -np.inf)
    best = np.unravel_index(int(np.argmax(value)), value.shape)
    if not np.isfinite(value[best]):
        raise ArgumentError(
            "levels", levels, "a grid that holds a feasible design; take more levels"
        )
    return np.array([column.ravel()[i] for column, i in zip(columns, best, strict=True)]), float(
        value[best]
    )


def best_width(design: AsocDesign, offset: float, split: float, radius: float) -> float:
    """Width (m) of the widest range at given other sizes: only d_max depends on it. Resolution 0.01
    mm."""
    low, high = BOUNDS[3]
    widths = np.arange(low, high, 1e-5)
    distance = design.terms(offset, split, radius - offset, widths)[3]
    return float(widths[int(np.argmax(distance))])


def best_ratio(values: Array, ratios: Array) -> tuple[float, float]:
    """Ratio and value at the top of a sampled curve, by a parabola through the three highest
    neighbours."""
    i = int(np.clip(np.argmax(values), 1, len(values) - 2))
    left, middle, right = values[i - 1 : i + 2]
    bend = left - 2 * middle + right
    shift = 0.0 if bend == 0 else float(np.clip((left - right) / (2 * bend), -1.0, 1.0))
    return float(ratios[i] + shift * (ratios[i + 1] - ratios[i])), float(
        middle - (left - right) * shift / 4
    )


SIDE = 4.5  # m, square of [udengaard2008], section 4.3


def square_corners(side: float = SIDE) -> Array:
    """(5, 2): corners of the square, counter-clockwise from the origin, m."""
    return side * np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]])


def constant_speed(corners: ArrayLike, speed: float = SPEED) -> Reference:
    """The thesis's command: one speed along every side, turned in no time at the corners."""
    points = checked_corners(corners)
    require_positive("speed", speed, "m/s")
    sides = np.diff(points, axis=0)
    length = np.linalg.norm(sides, axis=1)
    times = np.concatenate([[0.0], np.cumsum(length / speed)])
    return Reference(
        times, points, np.vstack([sides / length[:, None] * speed, np.zeros(2)]), points
    )


def wheel_frame(
    geometry: AsocGeometry, module: int, wheel: int, alpha: float, beta: float, drop: float = 0.0
) -> Array:
    """(4, 4): frame 5_(n,m) of a wheel in the body frame 1, eqs. 12-16; ``module`` 0.., ``wheel`` 1
    or 2.

    ``drop`` (m): h, how far the axle hangs below the body frame. Corrected against the print: eq.
    12 translates by (r cos, r sin, 0); alpha counts counter-clockwise; wheel 1 is on the right, as
    eq. 18 needs.
    """
    if wheel not in (1, 2) or not 0 <= module < geometry.modules:
        raise ArgumentError(
            "wheel", (module, wheel), f"module 0..{geometry.modules - 1} and wheel 1 or 2"
        )
    zeta = float(geometry.angles[module])
    joints = (
        (0.0, zeta, geometry.module_radius, 0.0),  # Table VIII: d, angle, a, twist
        (-drop, alpha - zeta - np.pi / 2, 0.0, np.pi / 2),
        (geometry.offset, -beta, 0.0, 0.0),
        (0.0, 0.0, geometry.split / 2 * (1 if wheel == 1 else -1), 0.0),
    )
    frame = np.eye(4)
    for distance, angle, length, twist in joints:
        frame = frame @ _joint(distance, angle, length, twist)
    return frame


def _joint(d: float, angle: float, a: float, twist: float) -> Array:
    """Denavit-Hartenberg transformation: rotate about z, shift (a along the new x, d along z),
    twist about x."""
    c, s, ct, st = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array(
        [
            [c, -s * ct, s * st, a * c],
            [s, c * ct, -c * st, a * s],
            [0.0, st, ct, d],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )


def workspaces_clear(geometry: AsocGeometry) -> bool:
    """Whether neighbouring modules can never touch: d_a >= 2 r (section 3.1.1)."""
    return geometry.axis_distance >= 2 * workspace_radius(geometry)


def require_pivots(
    geometry: AsocGeometry, ground: HeightMap, reference: Reference, *, every: float = 0.02
) -> float:
    """Largest tilt (rad) that the ground asks of a module along the path, body level, modules
    trailing.

    Raises InfeasibleError, with place (m along the path) and angle, where it is more than eq. 8
    allows.
    """
    allowed = float(largest_pivot(geometry.offset, geometry.split, geometry.wheel_radius))
    worst, done = 0.0, 0.0
    for a, b in pairwise(reference.corners):
        length, heading = float(np.linalg.norm(b - a)), float(np.arctan2(*(b - a)[::-1]))
        s = np.linspace(0.0, length, int(length / every) + 2)
        centres = a + s[:, None] * (b - a) / length
        local = wheel_positions(geometry, np.full(geometry.modules, heading))
        places = (local + centres[:, None, None]).reshape(-1, 2)
        heights = wheel_contact(
            ground, places[:, 0], places[:, 1], heading, geometry.wheel_radius
        ).centre_height
        tilt = np.abs(np.arctan(np.diff(heights.reshape(-1, 2), axis=1) / geometry.split)).reshape(
            len(s), -1
        )
        i, module = np.unravel_index(int(np.argmax(tilt)), tilt.shape)
        if tilt[i, module] > allowed:
            x, y = places.reshape(len(s), -1, 2, 2)[i, module].mean(axis=0)
            raise InfeasibleError(
                "pivot",
                done + float(s[i]),
                f"module {module} at ({x:.3g}, {y:.3g}) m must tilt "
                f"{np.degrees(tilt[i, module]):.3g} deg, the pivots allow "
                f"{np.degrees(allowed):.3g} deg",
            )
        worst, done = max(worst, float(tilt[i, module])), done + length
    return worst
