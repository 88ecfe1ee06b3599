"""Driving a planned trajectory in a physics engine, and comparing plan and motion."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import numpy as np

from trajopt.arrays import Array
from trajopt.control.approach import SETTLE, Mode, approach_controller
from trajopt.control.measured import Controller
from trajopt.control.tracking import Tracker, TrackingController
from trajopt.errors import ArgumentError, SimulationError
from trajopt.limits.wheel_speed import WheelSpeed
from trajopt.robots.robot import Robot
from trajopt.shown import Shown
from trajopt.simulate.build import build
from trajopt.simulate.engine import Camera, Engine, Hit, Recording
from trajopt.simulate.plan import WheelPlan, area_of, open_loop, wheel_plan
from trajopt.simulate.sensors import Sensors
from trajopt.simulate.stepping import drive
from trajopt.timing.trajectory import Trajectory
from trajopt.world.scene import Scene
from trajopt.world.terrain import Flat

LONGEST = 2000.0  # s; chosen: a million commands and records
FASTER = 1.2  # than the fastest planned wheel, times: what feedback may ask of wheels; chosen
LOADED = 0.03  # of the weight, below which a wheel's slip does not count; chosen
SLIP_TIME = 0.05  # s over which slip is averaged: contacts chatter; chosen


@dataclass(frozen=True, eq=False, repr=False)
class ValidationReport(Shown):
    """How far the simulated motion is from the plan. Angles rad, lengths m.

    ``along`` and ``across``: final position error along and across the planned final direction of
    travel; ``yaw``: final heading error; ``wheel_deviation`` (W,): final wheel angle minus planned;
    ``path_rms`` and ``path_max``: distance from the planned position at the same time, until the
    plan ends (what a controller bends on purpose counts too). ``contacts``: obstacles that were
    touched, which, when, where. ``slip`` (A,): largest speed (m/s) over the ground, in the
    directions in which it holds, of each of ``wheels``, the names of all wheels of the robot's
    file. ``planned`` (N, 3) and ``wheel_plan`` are what the plan has at the recording's times,
    ``steering`` (N, A) are measured angles. ``control`` and ``seed`` say what was switched on;
    None: the planned wheel speeds.
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
    wheel_plan: WheelPlan = field(repr=False)
    steering: Array = field(repr=False)
    control: Mode | None = None
    seed: int = 0

    def __repr__(self) -> str:
        return (
            f"ValidationReport({self.engine}, {1e3 * self.final_distance:.3g} mm and "
            f"{1e3 * self.yaw:.3g} mrad off at the end, {len(self.contacts)} obstacles touched)"
        )

    @property
    def final_distance(self) -> float:
        """Distance of the final position from the planned one, m."""
        return float(np.hypot(self.along, self.across))

    @property
    def steering_error(self) -> Array:
        """(A,): largest difference, rad, between each wheel's steering or castor angle and the
        plan's."""
        return np.asarray(np.abs(self.steering - self.wheel_plan.steering).max(axis=0))

    @property
    def slip_share(self) -> float:
        """Largest mean slip of a wheel over ``SLIP_TIME``, by load, over the plan's largest speed: a
        wheel that slides in MuJoCo hops, and slips while it bears. A wheel that carries less than
        ``LOADED`` of the weight then, as a castor in hard braking, may flutter."""
        t, places = self.recording.times, self.planned[:, :2]
        top = float((np.hypot(*np.diff(places, axis=0).T) / np.diff(t)).max())
        count = max(round(SLIP_TIME / float(t[1] - t[0])), 1)
        loads = self.recording.loads
        both = np.hstack([self.recording.slip * loads, loads])
        total = np.cumsum(np.vstack([np.zeros((1, both.shape[1])), both]), axis=0)
        slid, borne = np.split((total[count:] - total[:-count]) / count, 2, axis=1)
        bears = borne > LOADED * loads.sum(axis=1).mean()
        return float((slid / np.where(bears, borne, np.inf)).max()) / top

    @property
    def spin_error(self) -> Array:
        """(A,): final spin angle minus planned, rad, of all wheels."""
        return np.asarray(self.recording.spin_angles[-1] - self.wheel_plan.spin[-1])


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
    if trajectory.duration > LONGEST:
        expected = f"a motion of at most {LONGEST:g} s, to drive it in real steps"
        raise ArgumentError("trajectory", f"{trajectory.duration:.6g} s", expected)
    first = trajectory.at(0.0).pose[0]
    pose = first if start is None else np.asarray(start, dtype=np.float64)
    camera, area = Camera() if picture else None, area_of(trajectory, pose)
    command = open_loop(trajectory, build(robot), pose)
    end, clock = trajectory.duration, None
    if control is None:
        recording = drive(robot, scene, command, engine=engine, picture=camera, area=area)
    else:
        followed = _followed(trajectory, robot, control, critical)
        end, clock = float(followed.times[-1]), followed
        assert command.angles is not None
        command = replace(
            command, times=np.array([0.0, end + followed.settle]),
            wheel_speeds=np.zeros((2, len(robot.wheels))), angles=command.angles[[0, 0]],
        )  # fmt: skip
        recording = drive(
            robot, scene, command, engine=engine, picture=camera, controller=followed.controller,
            sense=Sensors().sense(np.random.default_rng(seed)), area=area,
        )  # fmt: skip
    if recording.exploded:
        raise SimulationError(
            f"{recording.engine}: the simulation left physics after {recording.times[-1]:.3g} s: "
            + recording.reason
        )
    times = recording.times
    if clock is not None:
        times = np.interp(times, clock.times, clock.planned)
    return _compared(trajectory, times, recording, end, control, seed)


def _driven_robot(trajectory: Trajectory, scene: Scene) -> Robot:
    robot = trajectory.robot
    if not isinstance(robot, Robot):
        raise ArgumentError(
            "trajectory.robot", robot, "a Robot (robot('car'), Robot.load(file) or a builder)"
        )
    if not robot.driven:
        raise ArgumentError("trajectory.robot", robot.name, "a robot with a motor")
    if isinstance(scene.ground, Flat) and trajectory.path.position(trajectory.u)[:, 2].any():
        raise ArgumentError(
            "scene.ground",
            scene.ground,
            "the ground that gives the path its height: Ramps or a map",
        )
    return robot


@dataclass(frozen=True, eq=False)
class _Followed:
    """A controller that follows the plan: at ``times`` (N,), s, it is where the trajectory is at
    ``planned`` (N,); ``settle`` (s): how long it goes on after the end."""

    controller: Controller
    times: Array
    planned: Array
    settle: float


def _followed(
    trajectory: Trajectory, robot: Robot, mode: Mode, critical: tuple[int, ...]
) -> _Followed:
    steers = any(wheel.kind in ("steered", "castor") for wheel in robot.rolling)
    if mode == "pose" and (steers or not robot.holonomic):
        rims = trajectory.at(trajectory.times).wheel_speeds * [w.radius for w in robot.wheels]
        tracker = Tracker(wheel_speed=FASTER * float(np.abs(rims).max()))
        tracking = TrackingController(trajectory, tracker, robot)
        return _Followed(tracking, tracking.times, tracking.times, tracker.settle)
    if mode == "wheel servo" and steers:
        raise ArgumentError("control", mode, f"pose: '{robot.name}' also steers")
    if mode == "pose and phase" and (steers or not robot.holonomic):
        raise ArgumentError("control", mode, "wheel servo or pose for a robot that has to turn")
    if mode == "pose and phase" and not critical:
        raise ArgumentError("critical", critical, "the wheels whose final angles count")
    caps = [limit.largest for limit in trajectory.limits if isinstance(limit, WheelSpeed)]
    cap = float(np.min(caps, initial=math.inf))
    approach = approach_controller(
        trajectory, robot, trajectory.start_wheels, critical, cap=cap, mode=mode
    )
    times = approach.reference.times
    planned = np.linspace(0.0, trajectory.duration, len(times))
    return _Followed(approach, times, planned, SETTLE)


def _compared(
    trajectory: Trajectory,
    times: Array,
    recording: Recording,
    end: float,
    control: Mode | None,
    seed: int,
) -> ValidationReport:
    """Against the plan at ``times`` (N,) of the trajectory, one for each of the recording's; the
    plan ends at ``end`` (s)."""
    robot = trajectory.robot
    assert robot is not None
    state = trajectory.at(np.minimum(times, trajectory.duration))
    planned = state.pose
    error = recording.pose - planned
    distance = np.hypot(error[:, 0], error[:, 1])[recording.times <= end]
    heading = _final_direction(planned)
    dx, dy = error[-1, :2]
    return ValidationReport(
        recording.engine,
        float(np.cos(heading) * dx + np.sin(heading) * dy),
        float(-np.sin(heading) * dx + np.cos(heading) * dy),
        float(error[-1, 2]),
        recording.wheel_angles[-1] - state.wheel_angles[-1],
        float(np.sqrt(np.mean(distance**2))),
        float(distance.max()),
        float(np.sum(np.hypot(*np.diff(planned[:, :2], axis=0).T))),
        recording.hits,
        tuple(wheel.name for wheel in robot.description.wheels),
        recording.slip.max(axis=0),
        recording.real_time_factor,
        planned,
        recording,
        wheel_plan(trajectory, times),
        build(robot).steering(recording.angles, recording.swivels),
        control,
        seed,
    )


def _final_direction(poses: Array) -> float:
    """Direction of travel over the last 2 cm (rad), or over the whole motion where it is shorter
    than that."""
    before = np.flatnonzero(np.hypot(*(poses[:, :2] - poses[-1, :2]).T) > 0.02)
    x, y = poses[-1, :2] - poses[before[-1] if before.size else 0, :2]
    return float(np.arctan2(y, x))
