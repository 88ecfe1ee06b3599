"""The robot on split offset casters in a physics engine, along a reference ([udengaard2008],
section 4.3).

The controller is that of trajopt.systems.asoc.tracking; wheels follow velocity commands, driven
axles the tilt that the ground asks for.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from trajopt.arrays import Array, BoolArray
from trajopt.control.measured import Measured, Targets
from trajopt.errors import SimulationError
from trajopt.simulate.engine import Command, Engine, Observation, Recording
from trajopt.simulate.sensors import Sense, Sensors
from trajopt.simulate.stepping import drive
from trajopt.systems.asoc.modules import AsocGeometry, asoc_robot
from trajopt.systems.asoc.reference import Reference
from trajopt.systems.asoc.tracking import (
    FRICTION,
    STEP,
    Knowledge,
    body_twist,
    commanded_twist,
    ground_angles,
    moved_poses,
    wheel_commands,
)
from trajopt.world.height_map import HeightMap
from trajopt.world.scene import Scene


@dataclass(frozen=True, eq=False)
class AsocRun:
    """``recording`` of a run, the ``wanted`` position (n, 2) and the distance from the path (n,),
    m."""

    recording: Recording
    wanted: Array
    cross_track: Array

    @property
    def rms(self) -> float:
        """RMS distance (m) from the point of the path that was due at the time."""
        off = self.recording.pose[:, :2] - self.wanted
        return float(np.sqrt(np.mean(np.sum(off**2, axis=1))))

    @property
    def rms_across(self) -> float:
        """RMS distance (m) from the nearest point of the path."""
        return float(np.sqrt(np.mean(self.cross_track**2)))

    @property
    def touch(self) -> BoolArray:
        """(n, W): which wheels stand on the ground."""
        return self.recording.loads > 0.0

    @property
    def losses(self) -> int:
        """How often a wheel lost the ground."""
        return int(np.sum(self.touch[:-1] & ~self.touch[1:]))

    @property
    def airborne_share(self) -> float:
        """Share of time a wheel is off the ground, mean over wheels."""
        return float(1.0 - self.touch.mean())


@dataclass(frozen=True, eq=False)
class _Felt(Measured):
    """Encoders, pose updates, and what the robot feels of the ground under its modules: ``tilt``
    (N,) and inclination ``slope`` (N, 2), rad; 0 where it does not."""

    tilt: Array = field(default_factory=lambda: np.zeros(0))
    slope: Array = field(default_factory=lambda: np.zeros(0))


def drive_asoc(
    geometry: AsocGeometry,
    ground: HeightMap,
    reference: Reference,
    *,
    friction: float = FRICTION,
    driven_pivots: bool = False,
    knowledge: Knowledge | None = None,
    engine: str | Engine = "auto",
) -> AsocRun:
    """Drive the robot along ``reference`` on ``ground``; pose and ground are known unless
    ``knowledge`` says otherwise (between updates the pose is that of odometry, from wheel speeds
    and module angles). Raises as ``simulate.drive``, and SimulationError when the numbers leave
    physics, the robot tips over or leaves the height map."""
    robot = asoc_robot(geometry)
    if driven_pivots:
        robot = robot.replace({"pivots.all.tilt": "driven"})
    known = knowledge or Knowledge()
    place, velocity = reference.at(0.0)
    command = Command(
        np.array([0.0, reference.duration]),
        np.zeros((2, 2 * geometry.modules)),
        None,
        (float(place[0]), float(place[1]), 0.0),
        start_swivels=np.full(geometry.modules, float(np.arctan2(velocity[1], velocity[0]))),
    )
    recording = drive(
        robot, Scene(friction, ground), command, engine=engine,
        controller=_Tracking(geometry, reference, driven_pivots),
        sense=_felt(geometry, ground, known),
    )  # fmt: skip
    if recording.exploded:
        raise SimulationError(f"{recording.reason}, {recording.times[-1]:.3g} s after the start")
    wanted = np.array([reference.at(float(t))[0] for t in recording.times])
    return AsocRun(recording, wanted, reference.distance(recording.pose[:, :2]))


def _felt(geometry: AsocGeometry, ground: HeightMap, known: Knowledge) -> Sense:
    """Exact measurements of what is ``known``."""
    located = Sensors(known.update_period, 0.0, 0.0).sense(np.random.default_rng(0))
    level = np.zeros((geometry.modules, 2))

    def sense(t: float, seen: Observation) -> _Felt:
        tilt, slope = level[:, 0], level
        if known.terrain:
            tilt, slope, _ = ground_angles(geometry, ground, seen.pose, seen.swivels)
        return _Felt(**vars(located(t, seen)), tilt=tilt, slope=slope)

    return sense


class _Tracking:
    """Feedback of the estimated pose; see ``control.measured.Controller``."""

    def __init__(self, geometry: AsocGeometry, reference: Reference, driven: bool) -> None:
        self.geometry, self.reference, self.driven = geometry, reference, driven
        self.estimate = np.zeros(3)

    def step(self, t: float, measured: Measured) -> Targets:
        assert isinstance(measured, _Felt)
        geometry, alpha = self.geometry, measured.swivels
        tilt, slope = measured.tilt, measured.slope
        if measured.pose is not None:
            self.estimate = measured.pose
        else:
            rims = measured.wheel_speeds.reshape(-1, 2) * geometry.wheel_radius
            moved = body_twist(geometry, alpha, rims, tilt, slope)
            self.estimate = moved_poses(self.estimate[None], moved[None], STEP)[0]
        twist = commanded_twist(self.estimate[None], *self.reference.at(t))[0]
        rims = wheel_commands(geometry, alpha, twist, tilt, slope)
        angles = tilt if self.driven else np.zeros(0)
        return Targets((rims / geometry.wheel_radius).ravel(), angles)
