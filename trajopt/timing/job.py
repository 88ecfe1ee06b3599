"""What a time scaling is asked for, checked."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, as_numbers, require_not_negative
from trajopt.errors import ArgumentError, InfeasibleError
from trajopt.limits.limit import Limit, is_linear
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, require_moving
from trajopt.robots.robot import Robot
from trajopt.timing.engines import is_second_order, require_engine
from trajopt.timing.rests import AT
from trajopt.timing.track import Track, track
from trajopt.world.ground import Ground

_JUMP = 1e-2  # of a wheel speed, at a line of the ground; chosen: as much as tyres give way
FASTEST = 1e6  # m/s, chosen: beyond it is an input error, and squares stay far from overflow


@dataclass(frozen=True, eq=False)
class Job:
    """What to scale. Ends are s' (m/s); ``stops`` are path parameters where the robot comes to
    rest."""

    track: Track
    limits: tuple[Limit, ...]
    start: float
    end: float
    stops: Array
    engine: str
    start_wheels: Array

    @property
    def path(self) -> Path:
        return self.track.path

    @property
    def squares(self) -> tuple[float, float]:
        """s'^2 at both ends."""
        return self.start**2, self.end**2

    def drives_anywhere(self) -> bool:
        """Whether the robot's wheels allow every twist of a path of this kind, on level ground."""
        if not (self.track.ground.level and self.path.plain):
            return False
        robot = self.track.robot
        if robot is None:
            return True
        free = robot.drivable
        needed = np.eye(3) if self.path.heading is not None else np.eye(3)[[0, 2]]
        return bool(np.allclose(needed @ free @ free.T, needed, atol=1e-9))

    def require_drivable(self, u: Array) -> None:
        """Raises InfeasibleError where the path has no direction, or the robot's wheels forbid its
        twist."""
        require_moving(self.path)
        s, along = self.path.parameter(u), self.track
        twist = along.motion(s, u)[0].twist
        if along.robot is None:
            return
        along.robot.require_rolling(twist, s)
        if along.ground.lines:
            before = along.motion(s[1:-1], np.nextafter(u[1:-1], -np.inf))[0].twist
            jump = np.abs((before - twist[1:-1]) * [1.0, 1.0, along.robot.turning_length]).max(
                axis=1
            )
            if jump.max() > _JUMP * np.abs(twist).max():
                raise InfeasibleError(
                    "ground",
                    float(s[1:-1][int(np.argmax(jump))]),
                    "the ground's curvature jumps where the path crosses it at an angle, and with it "
                    'the wheel speeds: give the ramp smooth edges (edge = "smooth")',
                )


def require_given(path: object, limits: object, robot: object, ground: object) -> None:
    """Raises ArgumentError for what is no path, no limits with different names, no robot, or no
    ground."""
    if not isinstance(path, Path):
        raise ArgumentError("path", path, "a Path")
    if not isinstance(limits, (list, tuple)):
        raise ArgumentError("limits", limits, "a list or tuple of limits")
    for limit in limits:
        if not hasattr(limit, "rows") or isinstance(limit, type):
            raise ArgumentError("limits", limit, "limits, as Speed(1.0)")
        if not isinstance(limit.name, str):
            raise ArgumentError("limits", limit, "limits whose name is a text")
    if robot is not None and not isinstance(robot, Robot):
        raise ArgumentError("robot", robot, "a Robot, as robot('car'), or None")
    if ground is not None and not hasattr(ground, "check"):
        raise ArgumentError("ground", ground, "the shape of the ground, as Flat(), or None")
    names = [limit.name for limit in limits]
    if len(set(names)) < len(names):
        raise ArgumentError("limits", names, "limits with different names (pass name=...)")


def checked_job(
    path: Path,
    limits: Sequence[Limit],
    robot: Robot | None,
    ground: Ground | None,
    speeds: tuple[float, float],
    engine: str,
    stops: ArrayLike,
    start: tuple[ArrayLike, Mapping[str, float] | None] = ((), None),
) -> Job:
    """The checked arguments. Raises ArgumentError."""
    require_given(path, limits, robot, ground)
    if not limits:
        raise ArgumentError("limits", limits, "a list or tuple of at least one limit")
    for argument, speed in zip(("start_speed", "end_speed"), speeds, strict=True):
        if require_not_negative(argument, speed, "m/s") > FASTEST:
            raise ArgumentError(argument, speed, f"a path speed from 0 to {FASTEST:g} m/s")
    require_engine(engine)
    bent = [limit.name for limit in limits if not is_linear(limit)]
    if bent and not is_second_order(engine):
        raise ArgumentError("engine", engine, f"auto: '{bent[0]}' is not linear in s'' and s'^2")
    along = track(path, robot, ground, start[1])
    path = along.path
    expected = f"path parameters between 0 and {path.length:.6g} m"
    places = np.atleast_1d(as_numbers("stops", stops, expected))
    if places.ndim != 1 or not np.all((places > 0) & (places < path.length)):
        raise ArgumentError("stops", stops, expected)
    places = _with_joints(path, places)
    if engine == "linear" and (any(speeds) or len(places)):
        raise ArgumentError(
            "start_speed, end_speed, stops",
            (*speeds, *places),
            "0 and none, and a path of one piece: linear scaling takes the path's own speeds",
        )
    wheels = as_numbers("start_wheels", start[0], "wheel angles, rad")
    _require_steady(along, limits, places)
    return Job(along, tuple(limits), *speeds, places, engine, wheels)


def _with_joints(path: Path, stops: Array) -> Array:
    """Path parameters (m) of stops that are given, and of those where pieces of the path meet."""
    joints = path.parameter(path.joints)
    apart = np.abs(stops[:, None] - joints).min(axis=1, initial=np.inf) > AT * path.length
    return np.sort(np.concatenate([stops[apart], joints]))


def _require_steady(along: Track, limits: Sequence[Limit], stops: Array) -> None:
    """Raises InfeasibleError where the path's curvature jumps, the robot does not stop, and it
    steers or a limit bounds what the jump makes infinite: any whose rows depend on how fast the
    twist changes."""
    path, u = along.path, along.path.jumps
    s = path.parameter(u)
    on = np.abs(s[:, None] - stops).min(axis=1, initial=np.inf) > AT * path.length
    if not on.any():
        return
    u, s = u[on][:1], s[on][:1]
    place = float(s[0])
    before = along.motion(s, np.nextafter(u, -np.inf))[0]
    after = along.motion(s, u)[0]
    jump = (
        f"the curvature jumps from {before.curvature[0]:.4g} to {after.curvature[0]:.4g} 1/m here"
    )
    remedy = f"stop here (stops = [{place!r}]), or lead over with a clothoid"
    if along.steers:
        raise InfeasibleError("steering", place, f"{jump}, and with it steering angles: {remedy}")
    still = replace(before, twist_rate=0 * before.twist_rate, turning_rate=0 * before.turning_rate)
    turn = np.array([[0.0, 0.0, 1.0]])
    turning = replace(still, twist_rate=turn, turning_rate=turn)
    for limit in limits:
        rows = [limit.rows(_with_wheels(along, m), along.robot) for m in (still, turning)]
        (a, b, c), others = ((r.a, r.b, r.c) for r in rows)
        if not all(map(np.array_equal, (a, b, c), others)):
            reason = f"{jump}, and with it wheel speeds, which '{limit.name}' forbids: {remedy}"
            raise InfeasibleError(limit.name, place, reason)


def _with_wheels(along: Track, samples: PathSamples) -> PathSamples:
    """Samples with wheels as the robot's file draws them."""
    if along.robot is None:
        return samples
    twists = samples.twist, samples.twist_rate
    return replace(samples, wheel_states=lambda: along.steering.rigid(*twists))
