"""What is driven along: a path on a ground, by a robot whose wheels stand as the path has them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

from trajopt.arrays import Array
from trajopt.paths.path import Path
from trajopt.paths.samples import PathSamples, sample_at
from trajopt.robots.robot import Robot
from trajopt.robots.steering import WheelStates, steering_of
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
    draws them, steered wheels as the path begins."""

    path: Path
    robot: Robot | None
    ground: Ground
    start_steering: Mapping[str, float] = field(default_factory=dict)

    def samples(self, s: Array, u: Array) -> PathSamples:
        """Geometry and wheel states at spline parameters (N,) whose path parameters are known."""
        found, bend = self.motion(s, u)
        if self.robot is None:
            return found
        return replace(found, wheel_states=lambda: self._states(found, bend))

    def motion(self, s: Array, u: Array) -> tuple[PathSamples, Array | None]:
        """Samples without wheel states, and the second derivative of the twist where it counts."""
        if self.robot is not None and len(steering_of(self.robot).steered):
            frame = frame_on(self.ground, self.path, u, self._contacts, 4)
            return samples_of(frame, s, u), twist_bend(frame)
        if self.ground.level:
            return sample_at(self.path, s, u), None
        return samples_on(self.ground, self.path, s, u, self._contacts), None

    def _states(self, samples: PathSamples, bend: Array | None) -> WheelStates:
        assert self.robot is not None
        steering = steering_of(self.robot)
        if not steering.turns:
            return steering.rigid(samples.twist, samples.twist_rate)
        angles = self.turning.at(samples.s, samples.u, samples.twist)
        return steering.states(samples.twist, samples.twist_rate, bend, angles)

    @property
    def _contacts(self) -> Array | None:
        """(K, 2): where wheels stand when the posture is that of wheels on the ground, castors at
        their pivots."""
        return None if self.robot is None else steering_of(self.robot).place

    @cached_property
    def turning(self) -> Turning:
        """How castors and steered wheels turn along the path.

        Raises ArgumentError for a start angle that no wheel can have, InfeasibleError with place
        where a wheel cannot steer as the path needs.
        """
        assert self.robot is not None
        steering = steering_of(self.robot)
        start = steering.start_angles(self.start_steering)
        return turning_along(self.path, steering, self.motion, start)

    @cached_property
    def wheels(self) -> WheelTable:
        """Spin angles of all wheels along the path."""
        assert self.robot is not None
        return wheel_table(self.path, steering_of(self.robot), self.motion, self.turning)


def track(
    path: Path,
    robot: Robot | None = None,
    ground: Ground | None = None,
    start_steering: Mapping[str, float] | None = None,
) -> Track:
    """The track along a plane path laid on ``ground``, or a path in space that lies on it. Without
    ground, or with ``Flat``, the path itself is the ground.

    Raises InfeasibleError where the path does not lie on the ground, or cannot be driven there.
    """
    shape: Ground = Flat() if ground is None else ground
    if isinstance(path, LaidPath) and (ground is None or path.ground is ground):
        assert path.ground is not None
        shape = path.ground
    elif isinstance(shape, Flat) or (shape.level and path.coordinates.shape[1] == 2):
        shape.check(path)
    else:
        path = lay(path, shape)
    return Track(path, robot, shape, dict(start_steering or {}))
