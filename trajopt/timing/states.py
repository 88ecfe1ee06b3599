"""States of a robot at times of its trajectory.

``readable_states`` is the reference, for every ground and robot. On level ground, without steered
wheels, ``motion_kernel`` does the same in one pass.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from trajopt.arrays import Array, BoolArray
from trajopt.paths.path import Path
from trajopt.robots.robot import Robot
from trajopt.robots.steering import steering_of

if TYPE_CHECKING:
    from trajopt.timing.profile import Profile
    from trajopt.timing.trajectory import Trajectory

_PARTS = (
    256  # of a segment, between which no path that follows a surface turns by half a turn; chosen
)


@dataclass(frozen=True, eq=False)
class State:
    """Robot state at N times. Poses are (x, y, yaw) in the world, twists (vx, vy, wz) in the body
    frame, which stands on the ground."""

    pose: Array  # (N, 3) m, m, rad (yaw continuous along the path)
    twist: Array  # (N, 3) m/s, m/s, rad/s
    wheel_angles: Array  # (N, W) rad, from the trajectory's start_wheels; W = 0 without a robot
    wheel_speeds: Array  # (N, W) rad/s
    position: Array  # (N, 3) of the body's origin in the world, m
    rotation: Array  # (N, 3, 3): columns are the body's axes in the world
    spin_angles: Array  # (N, K) rad, of all wheels of the robot's file; those of W are wheel_angles
    spin_rates: Array  # (N, K) rad/s
    steering_angles: (
        Array  # (N, K) rad, of castors and steered wheels from the file's angle, else 0
    )
    steering_rates: Array  # (N, K) rad/s


@dataclass(frozen=True, eq=False)
class Course:
    """What states of a trajectory need once."""

    trajectory: Trajectory

    @cached_property
    def level(self) -> bool:
        """Whether the compiled pass serves."""
        along, path = self.trajectory.track, self.trajectory.path
        flat = along.ground.level and path.plain and path.coordinates.shape[1] == 2
        return bool(flat and not along.steers and not self.trajectory.rests)

    @cached_property
    def yaws(self) -> tuple[Array, Array]:
        """(T,) each: spline parameters, ascending, and the continuous directions there, close enough
        to tell the turn."""
        return yaw_table(self.trajectory.path)

    @cached_property
    def cubics(self) -> tuple[Array, Array]:
        knots, cubics = self.trajectory.path._cubics
        return knots, np.ascontiguousarray(cubics)

    @cached_property
    def starts(self) -> Array:
        """(N+1,): times at which the cells of the profile begin, s."""
        return np.ascontiguousarray(self.trajectory.times)

    @cached_property
    def sigma(self) -> tuple[Array, BoolArray]:
        """As ``motion_kernel.sigma_powers``."""
        from trajopt.timing import motion_kernel as kernels

        profile = self.profile
        length, free = profile.measure.length, self.trajectory.path.heading is not None
        return kernels.sigma_powers(*self.cubics, length, free, profile.u, profile.d)

    @property
    def profile(self) -> Profile:
        assert self.trajectory.profile is not None
        return self.trajectory.profile

    @cached_property
    def inverse(self) -> Array:
        """(K, 3): spin rates of wheels that do not turn from the twist, 0 for others."""
        robot = self.trajectory.robot
        assert robot is not None
        steering = steering_of(robot)
        found = np.zeros((len(steering.names), 3))
        found[steering.rolling] = robot.inverse
        found[steering.castors] = 0.0
        return found


def yaw_table(path: Path) -> tuple[Array, Array]:
    """Continuous yaw at spline parameters close enough to tell the turn."""
    if path.plain and path.heading is None and path.coordinates.shape[1] == 2:
        from trajopt.timing import spread

        knots, cubics = path._cubics
        u = spread.base_cells(knots, np.ascontiguousarray(cubics), 0.0, False)[0]
        u = np.append(u, path.end)
    else:
        u = np.linspace(path.start, path.end, _PARTS * (len(path.basis.knots) - 1) + 1)
    return u, path.yaw(u)


def states_at(trajectory: Trajectory, t: ArrayLike) -> State:
    """State at times t (N,) or one time (N = 1), s. Raises ArgumentError outside [0, duration]."""
    if trajectory.course.level:
        return _level_states(trajectory, t)
    return readable_states(trajectory, t)


def readable_states(trajectory: Trajectory, t: ArrayLike) -> State:
    """The same, on every ground and for every robot."""
    i, after, node, since = trajectory.placed(t)
    found, s, speed, _ = trajectory.moving(i, after, node >= 0)
    grid, track = trajectory.u, trajectory.track
    inside = np.where(i + 2 < len(grid), np.nextafter(grid[i + 1], -np.inf), grid[-1])
    u = np.clip(found, grid[i], inside)
    u = np.where(node >= 0, grid[node], u)
    samples = track.samples(s, u)
    table_u, table_yaw = trajectory.course.yaws
    turns = np.round((np.interp(u, table_u, table_yaw) - samples.yaw) / (2 * np.pi))
    pose = np.column_stack([samples.position[:, :2], samples.yaw + 2 * np.pi * turns])
    twist = samples.twist * speed[:, None]
    place = (samples.position, samples.rotation)
    robot, wheels = trajectory.robot, samples.wheels
    if robot is None or wheels is None:
        none = np.zeros((len(s), 0))
        return State(pose, twist, none, none, *place, none, none, none, none)
    rolling = steering_of(robot).rolling
    angles, rates = track.wheels.at(u), wheels.spin * speed[:, None]
    angles[:, rolling] += trajectory.start_wheels
    turned, turning = wheels.steering.copy(), wheels.steering_rate * speed[:, None]
    for gridpoint, rest in trajectory.resting.items():
        ahead, turning[node == gridpoint] = rest.ahead(since[node == gridpoint])
        turned[node == gridpoint] -= ahead
    spun = (angles[:, rolling], rates[:, rolling])
    return State(pose, twist, *spun, *place, angles, rates, turned, turning)


def _level_states(trajectory: Trajectory, t: ArrayLike) -> State:
    """In one compiled pass."""
    from trajopt.timing import motion_kernel as kernels

    course, path = trajectory.course, trajectory.path
    u, speed = _places(trajectory, t)
    count = len(u)
    pose, twist, position = np.empty((count, 3)), np.empty((count, 3)), np.empty((count, 3))
    rotation, unit = np.empty((count, 3, 3)), np.empty((count, 4))
    free, bent = path.heading is not None, False
    length = path.turning_length
    if trajectory.profile is not None:
        bent = trajectory.profile.measure.bends
        length = trajectory.profile.measure.length
    turns, yaws = (np.zeros(2), np.zeros(2)) if free else course.yaws
    kernels.bodies(
        *course.cubics,
        free,
        length,
        turns,
        yaws,
        u,
        speed,
        bent,
        pose,
        twist,
        position,
        rotation,
        unit,
    )
    robot = trajectory.robot
    if robot is None:
        none = np.zeros((count, 0))
        return State(pose, twist, none, none, position, rotation, none, none, none, none)
    wheels = _wheels(trajectory, robot, u, unit)
    rolling = steering_of(robot).rolling
    spun = (wheels[0][:, rolling], wheels[1][:, rolling])
    return State(pose, twist, *spun, position, rotation, *wheels)


def _places(trajectory: Trajectory, t: ArrayLike) -> tuple[Array, Array]:
    """Spline parameters and sigma' (without a profile s') at times t (N,)."""
    from trajopt.timing import motion_kernel as kernels

    time = trajectory.within(t)
    profile, course = trajectory.profile, trajectory.course
    if profile is None:
        i, after, node, _ = trajectory.placed(time)
        u, _, speed, _ = trajectory.moving(i, after, node >= 0)
        inside = np.where(i + 2 < len(trajectory.u), trajectory.u[i + 1], np.inf)
        return np.minimum(u, np.nextafter(inside, -np.inf)), speed
    u, speed = np.empty(len(time)), np.empty(len(time))
    cells = (profile.u, profile.d, profile.y, profile.first, profile.last)
    left = kernels.places(*cells, *course.sigma, course.starts, time, u, speed)
    rest = np.flatnonzero(left >= 0)
    if len(rest):
        i = left[rest]
        inside = np.where(i + 2 < len(profile.u), np.nextafter(profile.u[i + 1], -np.inf), np.inf)
        u[rest] = np.minimum(profile.place(i, u[rest]), inside)
    return u, speed


def _wheels(
    trajectory: Trajectory, robot: Robot, u: Array, unit: Array
) -> tuple[Array, Array, Array, Array]:
    """(N, K) each: spin angles and rates, steering angles and rates."""
    from trajopt.timing import motion_kernel as kernels

    steering, table = steering_of(robot), trajectory.track.wheels
    start = np.zeros(len(steering.names))
    start[steering.rolling] = trajectory.start_wheels
    shape = (len(u), len(start))
    spin, rate, turned, turning = np.empty(shape), np.empty(shape), np.zeros(shape), np.zeros(shape)
    s = kernels.wheels(
        table.u, table.sums, table.powers, u, unit, trajectory.course.inverse, start, spin, rate
    )
    c = steering.castors
    if len(c):
        known = trajectory.track.turning
        kernels.castors(
            known.s,
            known.castor_powers,
            s,
            unit,
            c,
            steering.place[c],
            steering.trail[c],
            steering.lateral[c],
            steering.radius[c],
            steering.angle[c],
            rate,
            turned,
            turning,
        )
    return spin, rate, turned, turning
