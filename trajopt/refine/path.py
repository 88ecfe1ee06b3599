"""Path and timing together: control points move inside a corridor while the speed profile adapts.

Two stages (a path, then its time-optimal profile) leave time on the table where a wider bend would
be faster. Here both are variables of one nonlinear program, solved in steps: the rows of all limits
and the lengths of the grid's intervals are linearised in the control variables z (central
differences of the same NumPy code that time scaling uses, so any limit works), which leaves rows (a
+ A z) u + (b + B z) x <= c + C z in s'' = u and s'^2 = x, bilinear, for IPOPT. A step counts only
if time scaling along the new path is really faster; otherwise the trust region shrinks.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, require_finite, require_positive, require_whole
from trajopt.errors import ArgumentError, TrajoptError
from trajopt.limits.limit import Limit
from trajopt.optimize.symbols import (
    matrix,
    numpy_on_symbols,
    solve_program,
    stacked,
    total,
    variables,
)
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.timing.scaling import time_scale
from trajopt.timing.stages import assemble
from trajopt.timing.track import track
from trajopt.timing.trajectory import Trajectory
from trajopt.world.ground import Ground

Builder = Callable[[Array], Path]

GRID_CELLS = (
    120  # intervals of the program; chosen, as time scaling checks the result on its own grid
)
_STEP = 1e-4  # m; central differences of the rows with respect to control variables
_SHRINK, _GROW = 0.35, 1.5  # of the trust region after a refused and an accepted step; chosen
_LEAST_TRUST = 1e-3  # share of the first trust region at which the search ends
_LEAST_GAIN = 1e-5  # relative gain in time at which it ends


@dataclass(frozen=True, eq=False)
class JointResult:
    """``variables`` (d,), m; the timed motion along the new path; the two-stage duration (s) it
    started from; the durations (s) of the accepted steps."""

    variables: Array
    trajectory: Trajectory
    two_stage_duration: float
    history: tuple[float, ...]

    @property
    def gain(self) -> float:
        """Share of the two-stage duration that is saved."""
        return 1 - self.trajectory.duration / self.two_stage_duration


def corridor(path: Path) -> Builder:
    """Paths whose inner knots are moved sideways by z (K - 2,), m, left positive; ends stay as they
    are.

    Raises ArgumentError for a path with a heading of its own or without inner knots.
    """
    knots = np.asarray(path.basis.knots)
    if path.heading is not None or len(knots) < 3 or not path.plain:
        expected = "one spline along its heading, with inner knots"
        raise ArgumentError("path", f"{len(knots)} knots", expected)
    d = path.position(knots[1:-1], 1)[:, :2]
    normal = np.column_stack([-d[:, 1], d[:, 0]]) / np.hypot(d[:, 0], d[:, 1])[:, None]

    def build(z: Array) -> Path:
        moved = path.coordinates.copy()
        moved[1 : len(knots) - 1, :2] += z[:, None] * normal
        return Path(path.basis, moved)

    return build


def optimize_path(
    build: Builder,
    bounds: ArrayLike,
    limits: Callable[[Path], Sequence[Limit]] | Sequence[Limit],
    *,
    robot: Robot | None = None,
    ground: Ground | None = None,
    trust: float = 0.3,
    steps: int = 12,
) -> JointResult:
    """Least time over control variables z (d,) in ``bounds`` (d, 2), m, and the speed profile, from
    z = 0.

    ``build`` makes the path (``corridor``, or any function of z); ``limits`` are fixed, or a
    function of the path where they depend on it. ``trust`` (m) is the first trust region, ``steps``
    the most programs solved. Locally optimal; never slower than two stages. Raises ArgumentError
    for bounds that exclude 0, and InfeasibleError when the path at z = 0 cannot be timed.
    """
    box = require_finite("bounds", bounds, "(d, 2) with 0 inside, m", (None, 2))
    if np.any(box[:, 0] > 0) or np.any(box[:, 1] < 0):
        raise ArgumentError("bounds", box.tolist(), "(d, 2) with 0 inside")
    require_positive("trust", trust, "m")
    require_whole("steps", steps, 1, "a whole number >= 1")
    z = np.zeros(len(box))

    def used(path: Path) -> Sequence[Limit]:
        return limits(path) if callable(limits) else limits

    def timed(at: Array) -> Trajectory:
        path = build(at)
        return time_scale(path, used(path), robot=robot, ground=ground)

    best = timed(z)
    first, history, radius = best.duration, [best.duration], trust
    for _ in range(steps):
        fresh = _step(build, used, best, z, box, radius)
        try:
            trial = timed(fresh)
        except TrajoptError:  # outside of what can be driven: a shorter step
            trial = best
        if trial.duration < best.duration * (1 - _LEAST_GAIN):
            best, z, radius = trial, fresh, min(radius * _GROW, 2 * trust)
            history.append(best.duration)
        else:
            radius *= _SHRINK
            if radius < _LEAST_TRUST * trust:
                break
    return JointResult(z, best, first, tuple(history))


@dataclass(frozen=True, eq=False)
class _Linearised:
    """Values and derivatives along z (last axis) of the rows at the ends of the intervals, and
    their lengths."""

    lengths: tuple[Array, Array]
    a: tuple[Array, Array]
    b: tuple[Array, Array]
    c: tuple[Array, Array]
    cap: tuple[Array, Array]  # 1 / largest s'^2


@numpy_on_symbols(False)
def _step(
    build: Builder,
    used: Callable[[Path], Sequence[Limit]],
    now: Trajectory,
    z: Array,
    box: Array,
    radius: float,
) -> Array:
    """The control variables that the linearised program likes best within ``radius`` of z."""
    path = now.path
    places = np.linspace(0.0, path.length, GRID_CELLS + 1)
    u = np.unique(np.concatenate([path.locate(places), np.asarray(path.basis.knots)]))
    u = u[np.concatenate([[True], np.diff(u) > 1e-9 * (path.end - path.start)])]
    table = _linearised(build, used, (now.robot, now.ground), z, u)
    n, d = len(u) - 1, len(z)
    x_now = np.interp(path.parameter(u), now.s, now.sd**2)
    symbols = variables(n + 1 + d)
    x, dz = symbols[: n + 1], symbols[n + 1 :]

    def at(part: tuple[Array, Array], index: slice) -> Any:
        return part[0][index] + matrix(part[1][index]) @ dz

    ds = at(table.lengths, slice(None))
    rate = (x[1:] - x[:-1]) / (2 * ds)
    floor = 1e-6 * float(x_now.max())
    time = 2 * ds / ((x[:-1] + floor) ** 0.5 + (x[1:] + floor) ** 0.5)
    cost = total(time)
    rows = []
    for k in range(table.a[0].shape[1]):
        for end, square in ((0, x[:-1]), (1, x[1:])):
            pick = slice(end, n + end)
            a, b, c = (
                at((part[0][:, k], part[1][:, k]), pick) for part in (table.a, table.b, table.c)
            )
            rows.append(a * rate + b * square - c)
    rows.append(at(table.cap, slice(None)) * x - 1)
    constraints = stacked(rows)
    count = 2 * n * table.a[0].shape[1] + n + 1
    lower = np.concatenate([np.zeros(n + 1), np.maximum(box[:, 0] - z, -radius)])
    upper = np.concatenate([np.full(n + 1, np.inf), np.minimum(box[:, 1] - z, radius)])
    for k in (0, n):
        lower[k] = upper[k] = x_now[k]
    result = solve_program(
        symbols,
        cost,
        constraints,
        start=np.concatenate([0.98 * x_now, np.zeros(d)]),
        lower=lower,
        upper=upper,
        constraint_lower=np.full(count, -np.inf),
        constraint_upper=np.zeros(count),
        tolerance=1e-6,
        max_iterations=120,
    )
    return np.asarray(np.clip(z + result.x[n + 1 :], box[:, 0], box[:, 1]))


def _linearised(
    build: Builder,
    used: Callable[[Path], Sequence[Limit]],
    on: tuple[Robot | None, Ground | None],
    z: Array,
    u: Array,
) -> _Linearised:
    """Central differences of everything that depends on z."""

    def values(at: Array) -> tuple[Array, Array, Array, Array, Array]:
        path = build(at)
        along = track(path, *on)
        s = along.path.parameter(u)
        rows = assemble(along.samples(s, u), tuple(used(path)), along.robot)
        return np.diff(s), rows.a, rows.b, rows.c, 1 / rows.sd2_max

    middle = values(z)
    slopes: list[list[Array]] = [[] for _ in middle]
    for k in range(len(z)):
        step = np.zeros(len(z))
        step[k] = _STEP
        for part, (high, low) in zip(
            slopes, zip(values(z + step), values(z - step), strict=True), strict=True
        ):
            part.append((high - low) / (2 * _STEP))
    pairs = [(value, np.stack(part, axis=-1)) for value, part in zip(middle, slopes, strict=True)]
    return _Linearised(*pairs)
