"""What is driven along: a path on a ground, by a robot whose wheels stand as the path has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from trajopt.arrays import Array
from trajopt.errors import ArgumentError
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, sample_at
from trajopt.robots.robot import Robot
from trajopt.robots.start import start_angles
from trajopt.robots.steering import Steering, WheelStates, steering_of
from trajopt.timing.turning import Turning, turning_along
from trajopt.timing.wheels import WheelTable, wheel_table
from trajopt.world.ground import Ground
from trajopt.world.laid import LaidPath, lay
from trajopt.world.posture import frame_on, samples_of, samples_on, twist_bend
from trajopt.world.terrain import Flat


@dataclass(frozen=True, eq=False)
class Track:
    """``path`` lies on ``ground`` (see ``track``). ``start_steering``: angles (rad) by wheel at the
    start of the path, of castors and steered wheels; castors that are not named start as the file
    draws them, steered wheels as the path begins. ``rests`` (R,): spline parameters where the robot
    rests, so that steered wheels may turn."""

    path: Path
    robot: Robot | None
    ground: Ground
    start_steering: Mapping[str, float] = field(default_factory=dict)
    rests: Array = field(default_factory=lambda: np.zeros(0))

    def samples(self, s: Array, u: Array) -> PathSamples:
        """Geometry and wheel states at spline parameters (N,) whose path parameters are known."""
        found, bend = self.motion(s, u)
        if self.robot is None:
            return found
        return replace(found, wheel_states=lambda: self._states(found, bend))

    def motion(self, s: Array, u: Array) -> tuple[PathSamples, Array | None]:
        """Samples without wheel states, and the second derivative of the twist where it counts."""
        if self.steers:
            frame = frame_on(self.ground, self.path, u, self._contacts, 4)
            return samples_of(frame, s, u), twist_bend(frame)
        if self.ground.level:
            return sample_at(self.path, s, u), None
        return samples_on(self.ground, self.path, s, u, self._contacts), None

    def _states(self, samples: PathSamples, bend: Array | None) -> WheelStates:
        steering = self.steering
        if not steering.turns:
            return steering.rigid(samples.twist, samples.twist_rate)
        angles = self.turning.at(samples, bend)
        found = steering.states(samples.twist, samples.twist_rate, bend, angles)
        return replace(found, group_jump=self._jumps(samples.u)) if self.steers else found

    def _jumps(self, u: Array) -> Array:
        """(N, G): by how much the rates of steering jump at spline parameters (N,) that are knots,
        or next before one."""
        knots = np.asarray(self.path.basis.knots[1:-1])
        after = np.where(np.isin(u, knots), u, np.nextafter(u, np.inf))
        found = np.zeros((len(u), len(self.steering.groups)))
        at = np.flatnonzero(np.isin(after, knots))
        if len(at):
            sides = np.concatenate([np.nextafter(after[at], -np.inf), after[at]])
            samples, bend = self.motion(self.path.parameter(sides), sides)
            assert bend is not None
            motion = samples.twist, samples.twist_rate, bend
            rate, _ = self.steering.turning_rates(self.steering.group_place, *motion)
            found[at] = np.abs(rate[len(at) :] - rate[: len(at)])
        return found

    @property
    def steering(self) -> Steering:
        """The robot's wheels as arrays."""
        assert self.robot is not None
        return steering_of(self.robot)

    @property
    def steers(self) -> bool:
        """Whether a robot drives here, and steers."""
        return self.robot is not None and len(self.steering.steered) > 0

    @property
    def _contacts(self) -> Array | None:
        """(K, 2): where wheels stand when the posture is that of wheels on the ground, castors at
        their pivots."""
        return None if self.robot is None else self.steering.place

    @cached_property
    def turning(self) -> Turning:
        """How castors and steered wheels turn along the path.

        Raises ArgumentError for a start angle that no wheel can have, InfeasibleError with place
        where a wheel cannot steer as the path needs.
        """
        steering = self.steering
        start = start_angles(steering, self.start_steering)
        return turning_along(self.path, steering, self.motion, start, self.rests)

    @cached_property
    def wheels(self) -> WheelTable:
        """Spin angles of all wheels along the path."""
        return wheel_table(self.path, self.steering, self.motion, self.turning)


def track(
    path: Path,
    robot: Robot | None = None,
    ground: Ground | None = None,
    start_steering: Mapping[str, float] | None = None,
) -> Track:
    """The track along a plane path laid on ``ground``, or a path in space that lies on it. Without
    ground, or with ``Flat``, the path itself is the ground.

    Raises InfeasibleError where the path does not lie on the ground, or cannot be driven there, and
    ArgumentError for start angles that no wheel can have.
    """
    given = {} if start_steering is None else start_steering
    if not isinstance(given, Mapping):
        raise ArgumentError("start_steering", given, "angles, rad, by name of the wheel")
    if given and robot is None:
        raise ArgumentError("start_steering", dict(given), "a robot whose wheels those are")
    if given and robot is not None:
        start_angles(steering_of(robot), given)
    shape: Ground = Flat() if ground is None else ground
    if isinstance(path, LaidPath) and (ground is None or path.ground is ground):
        assert path.ground is not None
        shape = path.ground
    elif isinstance(shape, Flat) or (shape.level and path.coordinates.shape[1] == 2):
        shape.check(path)
    else:
        path = lay(path, shape)
    return Track(path, robot, shape, dict(given))
