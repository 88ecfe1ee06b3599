"""Driving a planned trajectory in a physics engine, and comparing plan and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from trajopt.arrays import Array
from trajopt.control.approach import SETTLE, Mode, approach_controller
from trajopt.control.measured import Controller
from trajopt.control.tracking import Tracker, TrackingController
from trajopt.errors import ArgumentError, SimulationError
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.robots.robot import Robot
from trajopt.simulate.build import build
from trajopt.simulate.engine import Camera, Command, Engine, Hit, Recording
from trajopt.simulate.sensors import Sensors
from trajopt.simulate.stepping import drive
from trajopt.timing.trajectory import Trajectory
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

SAMPLE_TIME = 0.002  # s between wheel speed commands: the engines' own step
COAST = 0.5  # s after the last command in which the robot comes to rest; chosen


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """How far the simulated motion is from the plan. Angles rad, lengths m.

    ``along`` and ``across``: final position error along and across the planned final direction of
    travel; ``yaw``: final heading error; ``wheel_deviation`` (W,): final wheel angle minus planned;
    ``path_rms`` and ``path_max``: distance from the planned position at the same time, until the
    plan ends (what a controller bends on purpose counts too). ``contacts``: obstacles that were
    touched, which, when, where. ``slip`` (A,): largest speed (m/s) over the ground, in the
    directions in which it holds, of each of ``wheels``, the names of all wheels of the robot's
    file. ``planned`` (N, 3) are the planned poses at the recording's times. ``control`` and
    ``seed`` say what was switched on; None: the planned wheel speeds.
    """

    engine: str
    along: float
    across: float
    yaw: float
    wheel_deviation: Array
    path_rms: float
    path_max: float
    length: float
    contacts: tuple[Hit, ...]
    wheels: tuple[str, ...]
    slip: Array
    real_time_factor: float
    planned: Array = field(repr=False)
    recording: Recording = field(repr=False)
    control: Mode | None = None
    seed: int = 0

    @property
    def final_distance(self) -> float:
        """Distance of the final position from the planned one, m."""
        return float(np.hypot(self.along, self.across))


def validate(
    trajectory: Trajectory,
    scene: Scene,
    *,
    engine: str | Engine = "auto",
    control: Mode | None = None,
    critical: tuple[int, ...] = (),
    seed: int = 0,
    start: tuple[float, float, float] | None = None,
    picture: bool = False,
) -> ValidationReport:
    """Drive ``trajectory.robot`` in ``scene``, from the trajectory's wheel angles, at its wheel
    speeds or under a controller; castors start trailing.

    ``control``: "wheel servo" on the planned wheel angles, "pose" or "pose and phase" feedback; the
    pose is then measured as ``Sensors`` says, blurred by random numbers of ``seed``, and the motion
    compared with the plan as the controller times it. "pose and phase" brings the wheels
    ``critical`` (indices) to their planned angles. ``start``: pose (m, m, rad) at which the robot
    really stands; None: the planned one.

    Raises ArgumentError for what cannot be driven there (it names what), MissingDependencyError
    where the engine is not installed, SimulationError where the run leaves physics.
    """
    robot = _driven_robot(trajectory, scene)
    if seed < 0:
        raise ArgumentError("seed", seed, "a whole number >= 0")
    first = trajectory.at(0.0).pose[0]
    pose = first if start is None else np.asarray(start, dtype=np.float64)
    swivels = trailing(trajectory)
    camera = Camera() if picture else None
    if control is None:
        command = open_loop(trajectory, pose, swivels)
        recording = drive(robot, scene, command, engine=engine, picture=camera)
        planned = trajectory.at(np.minimum(recording.times, trajectory.duration))
        wheels, end = planned.wheel_angles[-1], trajectory.duration
        poses = planned.pose
    else:
        followed = _followed(trajectory, robot, control, critical)
        wheels, end = followed.wheels, float(followed.times[-1])
        still = np.zeros((2, len(robot.wheels)))
        command = Command(
            np.array([0.0, end + followed.settle]), still, None, _triple(pose),
            trajectory.start_wheels, swivels,
        )  # fmt: skip
        recording = drive(
            robot, scene, command, engine=engine, picture=camera, controller=followed.controller,
            sense=Sensors().sense(np.random.default_rng(seed)),
        )  # fmt: skip
        times = followed.times
        poses = np.column_stack(
            [np.interp(recording.times, times, column) for column in followed.pose.T]
        )
    if recording.exploded:
        raise SimulationError(
            f"{recording.engine}: the simulation left physics after {recording.times[-1]:.3g} s: "
            + recording.reason
        )
    return _compared(robot, poses, wheels, recording, end, control, seed)


def open_loop(trajectory: Trajectory, pose: Array, swivels: Array | None = None) -> Command:
    """The planned wheel speeds from ``pose`` (3,) on, then rest. A trajectory that ends in motion
    is stopped: the engine gets zero speed after the last sample."""
    samples = max(2, round(trajectory.duration / SAMPLE_TIME) + 1)
    times = np.linspace(0.0, trajectory.duration, samples)
    speeds = trajectory.at(times).wheel_speeds
    rest = np.zeros((1, speeds.shape[1]))
    moving = not np.allclose(speeds[-1], 0)
    rows = np.vstack([speeds[:-1], rest, rest] if moving else [speeds, rest])
    return Command(
        np.append(times, times[-1] + COAST), rows, None, _triple(pose), trajectory.start_wheels,
        swivels,
    )  # fmt: skip


def _driven_robot(trajectory: Trajectory, scene: Scene) -> Robot:
    robot = trajectory.robot
    if not isinstance(robot, Robot):
        raise ArgumentError(
            "trajectory.robot", robot, "a Robot (robot('car'), Robot.load(file) or a builder)"
        )
    if not robot.driven:
        raise ArgumentError("trajectory.robot", robot.name, "a robot with a motor")
    if isinstance(scene.ground, Flat) and trajectory.path.coordinates.shape[1] > 2:
        raise ArgumentError(
            "scene.ground",
            scene.ground,
            "the ground that gives the path its height: Ramps or a map",
        )
    return robot


def trailing(trajectory: Trajectory) -> Array:
    """Angles (C,) of castors that trail where the plan goes first; those with a motor stand as the
    plan has them, at 0."""
    assert trajectory.robot is not None
    model = build(trajectory.robot)
    times = np.linspace(0.0, trajectory.duration, 101)[1:]
    twists = trajectory.at(times).twist
    vx, vy, wz = twists[int(np.argmax(np.abs(twists).max(axis=1) > 1e-3))]
    driven = {
        k
        for spin, has_motor in zip(model.spins, model.driven, strict=True)
        if has_motor
        for k in model.above(spin)
    }
    found = []
    for link in model.swivels:
        (x, y, _), frame = model.frames[link]
        ahead = math.atan2(vy + wz * x, vx - wz * y) - math.atan2(frame[1, 0], frame[0, 0])
        found.append(0.0 if link in driven else ahead)
    return np.array(found)


@dataclass(frozen=True, eq=False)
class _Followed:
    """A controller, and what it follows: ``times`` (N,), ``pose`` (N, 3), final ``wheels`` (W,);
    ``settle`` (s): how long it goes on after the end."""

    controller: Controller
    times: Array
    pose: Array
    wheels: Array
    settle: float


def _followed(
    trajectory: Trajectory, robot: Robot, mode: Mode, critical: tuple[int, ...]
) -> _Followed:
    if mode == "pose" and not robot.holonomic:
        tracking = TrackingController(trajectory, Tracker(), robot)
        state = tracking.reference
        return _Followed(
            tracking, tracking.times, state.pose, state.wheel_angles[-1], tracking.tracker.settle
        )
    if mode == "pose and phase" and not robot.holonomic:
        raise ArgumentError("control", mode, "wheel servo or pose for a robot that has to turn")
    if mode == "pose and phase" and not critical:
        raise ArgumentError("critical", critical, "the wheels whose final angles count")
    caps = [limit.largest for limit in trajectory.limits if isinstance(limit, WheelSpeed)]
    cap = float(np.min(caps, initial=math.inf))
    approach = approach_controller(
        trajectory, robot, trajectory.start_wheels, critical, cap=cap, mode=mode
    )
    plan = approach.reference
    return _Followed(approach, plan.times, plan.pose, plan.wheels[-1], SETTLE)


def _compared(
    robot: Robot,
    planned: Array,
    wheels: Array,
    recording: Recording,
    end: float,
    control: Mode | None,
    seed: int,
) -> ValidationReport:
    """Against the planned poses (N, 3) at the recording's times and the planned final wheel angles
    (W,); the plan ends at ``end`` (s)."""
    error = recording.pose - planned
    distance = np.hypot(error[:, 0], error[:, 1])[recording.times <= end]
    heading = _final_direction(planned)
    dx, dy = error[-1, :2]
    return ValidationReport(
        recording.engine,
        float(np.cos(heading) * dx + np.sin(heading) * dy),
        float(-np.sin(heading) * dx + np.cos(heading) * dy),
        float(error[-1, 2]),
        recording.wheel_angles[-1] - wheels,
        float(np.sqrt(np.mean(distance**2))),
        float(distance.max()),
        float(np.sum(np.hypot(*np.diff(planned[:, :2], axis=0).T))),
        recording.hits,
        tuple(wheel.name for wheel in robot.description.wheels),
        recording.slip.max(axis=0),
        recording.real_time_factor,
        planned,
        recording,
        control,
        seed,
    )


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _final_direction(poses: Array) -> float:
    """Direction of travel over the last 2 cm (rad), or over the whole motion where it is shorter
    than that."""
    before = np.flatnonzero(np.hypot(*(poses[:, :2] - poses[-1, :2]).T) > 0.02)
    x, y = poses[-1, :2] - poses[before[-1] if before.size else 0, :2]
    return float(np.arctan2(y, x))
