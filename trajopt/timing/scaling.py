"""Time scaling: the fastest motion along a path that keeps all limits."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from trajopt.errors import ArgumentError, InfeasibleError, MissingDependencyError
from trajopt.limits.limit import Limit
from trajopt.paths.path import Path
from trajopt.paths.samples import sample_at
from trajopt.robots.platform import Platform
from trajopt.timing.compiled import compiled_profile, is_compiled
from trajopt.timing.feasibility import require_motion
from trajopt.timing.grid import initial_grid, insert, split
from trajopt.timing.linear import linear_profile
from trajopt.timing.stages import Check, FineRows, Stages, check, fine_rows, refined, stages_of
from trajopt.timing.toppra import toppra_profile
from trajopt.timing.trajectory import Trajectory
from trajopt.world.terrain import Flat, Terrain

Array = NDArray[np.float64]
Engine = Callable[[Stages, float, float], Array]

ENGINES: dict[str, Engine] = {"compiled": compiled_profile, "toppra": toppra_profile}

REFINE_ABOVE = 1e-5  # violation of s'^2 between gridpoints, relative, that is refined away if it can; chosen
REFINE_ROUNDS = 4  # rounds spent on that; chosen
MOST_ROUNDS = 16  # rounds before giving up on a violation above the largest slow-down; chosen
LARGEST_SLOWDOWN = 1.001  # of time; DESIGN: at most 0.1 %
_KEPT = 1e-9  # relative violation that counts as none


def time_scale(path: Path, limits: Sequence[Limit], *, robot: Platform | None = None,
               terrain: Terrain | None = None, start_speed: float = 0.0, end_speed: float = 0.0,
               gridpoints: int | ArrayLike | None = None, engine: str = "auto") -> Trajectory:
    """Fastest motion along ``path`` within ``limits``, from ``start_speed`` to ``end_speed`` (s', m/s).

    ``engine``: "toppra", "compiled" (needs numba), "auto" (compiled where numba is installed, else toppra),
    or "linear" (one factor for the whole motion, uniform in the spline parameter; it has the end speeds
    that the path gives it). ``gridpoints``: how many, or path parameters (m); more are added where limits are
    broken between them. What is left is removed by slowing the whole motion, end speeds included, by at
    most 0.1 % (``Trajectory.slowdown``).

    Raises ArgumentError for bad arguments, InfeasibleError (limit and place) where no motion exists, and
    MissingDependencyError for "compiled" without numba.
    """
    terrain = Flat() if terrain is None else terrain
    _require_arguments(path, limits, start_speed, end_speed, engine)
    name = ("compiled" if is_compiled() else "toppra") if engine == "auto" else engine
    terrain.check(path)
    u = initial_grid(path, gridpoints)
    _require_drivable(path, u, robot)
    if name == "linear":
        return _linear(path, tuple(limits), robot, terrain, u)
    fine, sd2, found = _refined(path, u, limits, robot, ENGINES[name], start_speed**2, end_speed**2)
    factor = max(1.0, float(found.factor.max()))
    return _slowed(path, tuple(limits), robot, terrain, fine, sd2, factor, name)


def _require_arguments(path: Path, limits: Sequence[Limit], start: float, end: float, engine: str) -> None:
    if not isinstance(path, Path):
        raise ArgumentError("path", path, "a Path")
    if not len(limits):
        raise ArgumentError("limits", limits, "at least one limit")
    names = [limit.name for limit in limits]
    if len(set(names)) < len(names):
        raise ArgumentError("limits", names, "limits with different names (pass name=...)")
    for argument, speed in (("start_speed", start), ("end_speed", end)):
        if not (np.isfinite(speed) and speed >= 0):
            raise ArgumentError(argument, speed, "a finite path speed >= 0 m/s")
    if engine not in ("auto", "linear", *ENGINES):
        raise ArgumentError("engine", engine, "one of auto, linear, " + ", ".join(ENGINES))
    if engine == "compiled" and not is_compiled():
        raise MissingDependencyError("numba", "speed", "engine='compiled'")
    if engine == "linear" and (start or end):
        raise ArgumentError("start_speed", (start, end), "0: linear scaling takes the path's own end speeds")


def _require_drivable(path: Path, u: Array, robot: Platform | None) -> None:
    """Raises InfeasibleError where the robot's wheels forbid the path's twist."""
    twist = sample_at(path, path.parameter(u), u).twist
    if robot is None:
        return
    slipping = twist - twist @ robot.admissible @ robot.admissible.T
    bad = np.abs(slipping).max(axis=1) > 1e-6 * np.abs(twist).max(axis=1)
    if bad.any():
        place = float(path.parameter(u[bad][:1])[0])
        raise InfeasibleError("rolling", place, f"the wheels of '{robot.name}' cannot roll along this path; "
                              "leave its heading to the direction of travel")


def _refined(path: Path, u: Array, limits: Sequence[Limit], robot: Platform | None, engine: Engine,
             start: float, end: float) -> tuple[FineRows, Array, Check]:
    """Rows, s'^2 and its check, after refining the grid where limits are broken between gridpoints."""
    fine = fine_rows(path, u, limits, robot)
    if fine.edges:
        fine = refined(path, fine, insert(path, u, np.asarray(fine.edges)), limits, robot)
    for done in range(MOST_ROUNDS):
        stages = stages_of(fine)
        profile = engine(stages, start, end)
        require_motion(stages, profile)
        sd2 = profile[stages.kept]
        found = check(fine, sd2)
        excess = np.maximum(found.factor - 1, -found.slack.min(axis=1))
        worst = float(excess.max())
        if worst <= REFINE_ABOVE or (done >= REFINE_ROUNDS and worst <= LARGEST_SLOWDOWN - 1):
            return fine, sd2, found
        if done < MOST_ROUNDS - 1:
            fine = refined(path, fine, split(fine.u, excess > REFINE_ABOVE, 3), limits, robot)
    at = int(np.argmax(excess))
    limit = limits[int(np.argmin(found.slack[at]))].name
    raise InfeasibleError(limit, float(fine.s[at]), "it is broken between gridpoints, however fine the grid: "
                          "it jumps here, or falls to zero too fast to be followed")


def _slowed(path: Path, limits: tuple[Limit, ...], robot: Platform | None, terrain: Terrain, fine: FineRows,
            sd2: Array, factor: float, engine: str) -> Trajectory:
    """The trajectory, slowed uniformly so that every limit holds on the fine grid."""
    sd2 = sd2 / factor
    slack = check(fine, sd2).slack
    for limit, least, at in zip(limits, slack.min(axis=0), slack.argmin(axis=0), strict=True):
        if least < -_KEPT:  # slowing does not help a limit that needs speed, or that rest breaks
            raise InfeasibleError(limit.name, float(fine.s[at]), f"it is broken by {-least:.2g} of its size, and "
                                  "slowing down does not help (rest breaks it, or nearly)")
    return Trajectory(path, limits, robot, terrain, fine.u, fine.s, np.sqrt(sd2),
                      np.diff(sd2) / (2 * np.diff(fine.s)), engine, max(1.0, float(np.sqrt(factor))))


def _linear(path: Path, limits: tuple[Limit, ...], robot: Platform | None, terrain: Terrain,
            u: Array) -> Trajectory:
    fine = fine_rows(path, u, limits, robot)
    sd2 = linear_profile(path, u)
    found = check(fine, sd2)
    worst = float(found.factor.max())
    if not np.isfinite(worst) or worst <= 0:
        at = int(np.argmax(found.factor))
        limit = limits[int(np.argmin(found.slack[at]))].name
        raise InfeasibleError(limit, float(fine.s[at]), "no factor keeps the limits: nothing bounds the "
                              "motion, or a limit is zero here")
    return _slowed(path, limits, robot, terrain, fine, sd2 / worst, 1.0, "linear")
