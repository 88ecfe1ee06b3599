"""MuJoCo, the second opinion: same robot, same scene, same recording as Bullet."""

from __future__ import annotations

import importlib.metadata
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, IndexArray, fold
from trajopt.errors import ArgumentError, MissingDependencyError, SimulationError
from trajopt.simulate.engine import (
    Camera,
    Command,
    Controller,
    Observation,
    Recording,
    SimRobot,
)
from trajopt.simulate.mjcf import Solver, scene_mjcf
from trajopt.simulate.scene import Scene
from trajopt.simulate.stepping import Pace, drive


@dataclass(frozen=True)
class MuJoCo:
    """Options of the MuJoCo engine (values measured on the LOC8 over 5 m unless said otherwise)."""

    step: float = 0.002  # s; at 10 ms the robot drifts by 5-13 %
    stride: int = 5  # steps between two records; 10 ms, the thesis's step
    contact_time: float = 0.004  # s; solref time constant, the shortest that 2 ms steps allow
    contact_damping: float = 1.0  # solref damping ratio, critical
    wheel_gain: float = 20.0  # N m s/rad; velocity servo of a wheel
    iterations: int = 100  # at most, of the Newton solver; MuJoCo's default

    def __post_init__(self) -> None:
        """Raise ArgumentError for options that MuJoCo cannot use."""
        Pace(self.step, self.stride)
        if not self.contact_time >= 2.0 * self.step:
            raise ArgumentError(
                "contact_time", self.contact_time, f"at least two steps = {2 * self.step:g} s"
            )
        for name in ("contact_damping", "wheel_gain", "iterations"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ArgumentError(name, getattr(self, name), "a positive number")

    @property
    def name(self) -> str:
        """Name in the registry."""
        return "mujoco"

    def run(
        self,
        robot: SimRobot,
        scene: Scene,
        command: Command,
        *,
        settle: float = 0.2,
        picture: Camera | None = None,
        controller: Controller | None = None,
    ) -> Recording:
        """Drive ``robot`` through ``scene``; arguments and errors of ``stepping.drive``.

        Also raises MissingDependencyError without mujoco, and SimulationError when MuJoCo cannot
        build the model or has no graphics for a picture.
        """
        mujoco = load_mujoco()
        solver = Solver(
            self.step, self.contact_time, self.contact_damping, self.wheel_gain, self.iterations
        )
        try:
            model = mujoco.MjModel.from_xml_string(scene_mjcf(robot, scene, solver, picture))
        except ValueError as error:
            raise SimulationError(
                f"mujoco could not build the robot {robot.name!r}: {error}"
            ) from error
        return drive(
            _session(mujoco, model, command),
            robot,
            command,
            Pace(self.step, self.stride),
            label=(self.name, importlib.metadata.version("mujoco")),
            settle=settle,
            picture=picture,
            controller=controller,
        )


def load_mujoco() -> Any:
    """The mujoco module. Raises MissingDependencyError without it."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependencyError("mujoco", "simulate", "the physics engine 'mujoco'") from error
    return mujoco


@dataclass(frozen=True, eq=False)
class _MuJoCoSession:
    """Model and state; fulfils ``engine.Session``."""

    mujoco: Any
    model: Any
    data: Any
    wheel_positions: IndexArray
    wheel_velocities: IndexArray
    angle_offset: Array

    def advance(self, wheel_speeds: Array) -> None:
        """One time step with these wheel speed targets (4,) [rad/s]."""
        self.data.ctrl[:] = wheel_speeds
        self.mujoco.mj_step(self.model, self.data)

    def observe(self) -> Observation:
        """State now."""
        data = self.data
        rotation = np.empty(9)
        self.mujoco.mju_quat2Mat(rotation, data.qpos[3:7])
        touching = data.contact.dist[data.contact.dist <= 0.0]
        return Observation(
            position=data.qpos[:3].copy(),
            rotation=rotation.reshape(3, 3),
            velocity=data.qvel[:3].copy(),
            wheel_angles=data.qpos[self.wheel_positions] + self.angle_offset,
            wheel_speeds=data.qvel[self.wheel_velocities].copy(),
            wheel_torques=data.actuator_force.copy(),
            contacts=len(touching),
            penetration=max(0.0, -float(touching.min(initial=0.0))),
        )

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3) by MuJoCo's OpenGL renderer. Raises SimulationError without
        graphics."""
        place = self.data.qpos[:3]
        view = self.mujoco.MjvCamera()
        view.lookat[:] = camera.target if camera.target is not None else (place[0], place[1], 0.08)
        view.distance = camera.distance
        view.azimuth = 90.0 + math.degrees(camera.yaw)
        view.elevation = math.degrees(camera.pitch)
        try:
            renderer = self.mujoco.Renderer(self.model, camera.height, camera.width)
        except Exception as error:  # the OpenGL back ends raise what they like
            advice = "set MUJOCO_GL=egl or osmesa, or take the picture with pybullet"
            raise SimulationError(
                f"mujoco found no graphics for a picture ({error}): {advice}"
            ) from error
        try:
            renderer.update_scene(self.data, view)
            image: NDArray[np.uint8] = renderer.render().copy()
        finally:
            renderer.close()
        return image


def _session(mujoco: Any, model: Any, command: Command) -> _MuJoCoSession:
    data = mujoco.MjData(model)
    x, y, yaw = command.start_pose
    joints = [
        mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_JOINT, f"wheel_{index}") for index in range(4)
    ]
    positions = np.array([model.jnt_qposadr[joint] for joint in joints], dtype=np.intp)
    velocities = np.array([model.jnt_dofadr[joint] for joint in joints], dtype=np.intp)
    start = np.array(command.start_wheel_angles, dtype=np.float64)
    # small angles keep their digits: whole turns are added when reading
    folded = fold(start)
    data.qpos[:7] = (x, y, 0.0, math.cos(yaw / 2.0), 0.0, 0.0, math.sin(yaw / 2.0))
    data.qpos[positions] = folded
    mujoco.mj_forward(model, data)
    return _MuJoCoSession(mujoco, model, data, positions, velocities, start - folded)
