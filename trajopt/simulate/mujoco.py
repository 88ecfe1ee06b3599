"""MuJoCo, built through MjSpec: the same model, stage and session as any other engine."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from trajopt.arrays import Array, IndexArray, fold
from trajopt.errors import ArgumentError, MissingDependencyError, SimulationError
from trajopt.simulate.engine import Camera, Contacts, Motion, Start
from trajopt.simulate.mjspec import STEERING_RATE, SpecBuilder
from trajopt.simulate.model import Model, cross, quaternion_of
from trajopt.simulate.motors import Motors
from trajopt.simulate.plates import Plates
from trajopt.simulate.scene import Stage
from trajopt.simulate.stepping import Pace
from trajopt.simulate.tyres import RIM_SAG, TYRE_SAG, give

# Why this process has no graphics, once known: asked a second time, GLFW aborts the process.
_NO_GRAPHICS: list[str] = []
# Impedance of soft contacts, chosen: the closer to 1, the more they act like mass, which rings under
# wheels (measured: at 0.9 the loads of a swerve drive scatter by 8 % of its weight, at 0.01 by 1 %).
IMPEDANCE = 0.01
# 1/s at which friction of soft contacts brings sliding to rest, chosen: sliding at v, MuJoCo lifts the
# contact by about friction rate v impedance / (1 - impedance) of the mass above it
FRICTION_RATE = 400.0
AWAY = (0.0, 0.0, -100.0)  # m, where an obstacle is that is out of the world


@dataclass(frozen=True)
class MuJoCo:
    """Options of the MuJoCo engine (values measured on a Mecanum robot of 20 kg over 5 m unless
    said otherwise)."""

    step: float = 0.002  # s; at 10 ms the robot drifts by 5-13 %
    stride: int = 5  # steps between two records; 10 ms, the thesis's step
    contact_time: float = 0.004  # s; solref time constant, the shortest that 2 ms steps allow
    contact_damping: float = 1.0  # solref damping ratio, critical
    motor_impedance: float = 0.999  # solimp of a motor: its lag is what is missing to 1
    iterations: int = 100  # at most, of the Newton solver; MuJoCo's default

    def __post_init__(self) -> None:
        """Raise ArgumentError for options that MuJoCo cannot use."""
        Pace(self.step, self.stride)
        if not self.contact_time >= 2.0 * self.step:
            raise ArgumentError(
                "contact_time", self.contact_time, f"at least two steps = {2 * self.step:g} s"
            )
        for name in ("contact_damping", "iterations"):
            if not 0.0 < getattr(self, name) < math.inf:
                raise ArgumentError(name, getattr(self, name), "a positive number")
        if not 0.0 < self.motor_impedance < 1.0:
            raise ArgumentError("motor_impedance", self.motor_impedance, "a share in (0, 1)")

    @property
    def name(self) -> str:
        """Name in the registry."""
        return "mujoco"

    @contextmanager
    def open(
        self, model: Model, stage: Stage, start: Start, picture: Camera | None
    ) -> Iterator[_Session]:
        """See ``engine.Engine``; SimulationError where MuJoCo cannot compile the model."""
        mujoco = load_mujoco()
        built = SpecBuilder(mujoco, self, model, stage)
        if picture is not None:
            built.spec.visual.global_.offwidth = picture.width
            built.spec.visual.global_.offheight = picture.height
        try:
            compiled = built.spec.compile()
        except ValueError as error:
            raise SimulationError(
                f"mujoco could not build the robot {model.name!r}: {error}"
            ) from error
        session = _Session(mujoco, compiled, model, stage)
        if not stage.broken:
            session.soften(stage.uneven)
        session.place(start)
        yield session


def load_mujoco() -> Any:
    """The mujoco module. Raises MissingDependencyError without it."""
    try:
        import mujoco
    except ImportError as error:
        raise MissingDependencyError("mujoco", "simulate", "the physics engine 'mujoco'") from error
    return mujoco


class _Session:
    """Model and state; fulfils ``engine.Session``."""

    def __init__(self, mujoco: Any, compiled: Any, model: Model, stage: Stage) -> None:
        self.mujoco, self.compiled, self.model, self.stage = mujoco, compiled, model, stage
        self.data = mujoco.MjData(compiled)
        body = [compiled.body(f"link_{i}").id for i in range(len(model.links))]
        joint = {
            i: compiled.joint(f"link_{i}").id
            for i, link in enumerate(model.links)
            if link.parent >= 0 and link.joint.role != "fixed"
        }
        self.body: IndexArray = np.array(body, dtype=np.intp)
        self.angle = {i: int(compiled.jnt_qposadr[j]) for i, j in joint.items()}
        self.rate = {i: int(compiled.jnt_dofadr[j]) for i, j in joint.items()}
        self.offset = dict.fromkeys(joint, 0.0)
        self.driven = np.array(model.driven, dtype=bool)
        # steps by which each target lags behind an angle that changes evenly
        lag = 2.0 / (STEERING_RATE * compiled.opt.timestep)
        servo = [model.links[t].joint.drive == "position" for t in model.targets]
        self.lag = np.where(servo, lag, 0.0)
        self.before: Array | None = None
        self.motors = [s for s, driven in zip(model.spins, model.driven, strict=True) if driven]
        self.rotors = [int(compiled.joint(f"rotor_link_{s}").dofadr[0]) for s in self.motors]
        self.tendons = [int(compiled.tendon(f"motor_link_{s}").id) for s in self.motors]
        self.torques = Motors(model)
        # of every geom: the robot's link, the stage's solid; -1 for none
        owner = {b: i for i, b in enumerate(body)}
        self.link_of = np.array([owner.get(int(b), -1) for b in compiled.geom_bodyid])
        self.solid_of = np.full(compiled.ngeom, -1)
        self.plates = Plates(model, stage) if stage.plates else None
        names = [f"plate_{k}" for k in range(len(model.feet) if stage.plates else 0)]
        self.mocap = [int(compiled.body(name).mocapid[0]) for name in names]
        for i in range(len(stage.solids)):
            self.solid_of[compiled.geom(f"solid_{i}").id] = i

    def soften(self, uneven: bool) -> None:
        """Makes tyres, and on ``uneven`` ground rollers, as soft as ``tyres.give`` says.

        Solref's direct form k, b acts in acceleration, through the regularisation R = (1 - d)/d A of
        a body with the inverse weight A: force = (k r + b v) / ((1 - d) A), with d the impedance.
        The contact is halfway between two surfaces: half the sag more radius keeps the lever.
        """
        compiled, kinds = self.compiled, self.mujoco.mjtGeom
        sags = {int(kinds.mjGEOM_SPHERE): TYRE_SAG, int(kinds.mjGEOM_CAPSULE): RIM_SAG}
        for pair, geom in enumerate(compiled.pair_geom2):
            link = self.model.links[self.link_of[geom]]
            soft = give(self.model, link)
            if soft is None or (link.joint.role == "roller" and not uneven):
                continue
            kind = int(compiled.geom_type[geom])
            contacts = 2.0 if kind == kinds.mjGEOM_CAPSULE else 1.0  # one at each end
            weight = (1.0 - IMPEDANCE) * compiled.body_invweight0[compiled.geom_bodyid[geom], 0]
            compiled.pair_solref[pair] = [-k * weight / contacts for k in soft]
            compiled.pair_solimp[pair] = [IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0]
            compiled.pair_solreffriction[pair] = [2.0 / (IMPEDANCE * FRICTION_RATE), 1.0]
            if kind in sags:
                compiled.geom_size[geom, 0] += sags[kind] / 2.0
                compiled.geom_rbound[geom] += sags[kind] / 2.0

    def place(self, start: Start) -> None:
        """Put the robot where it begins. Small angles keep their digits: whole turns are added
        when reading."""
        self.data.qpos[:7] = (*start.place, *quaternion_of(start.rotation))
        for link, angle in start.angles.items():
            self.data.qpos[self.angle[link]] = fold(angle)
            self.offset[link] = angle - fold(angle)
        self.turns = np.array([self.offset[t] for t in self.model.targets])
        self.mujoco.mj_forward(self.compiled, self.data)

    def advance(self, wheel_speeds: Array, angles: Array) -> None:
        """See ``engine.Session``."""
        if self.plates is not None:
            self.plates.move(self.data.xpos[self.body[list(self.model.feet)]])
            self.data.mocap_pos[self.mocap] = self.plates.place
            self.data.mocap_quat[self.mocap] = self.plates.quaternions()
        self.data.qvel[self.rotors] = wheel_speeds[self.driven]
        if self.torques.curves:
            speeds = self.data.qvel[[self.rate[i] for i in self.motors]]
            self.compiled.tendon_frictionloss[self.tendons] = self.torques.most(
                speeds, wheel_speeds[self.driven]
            )
        self.data.ctrl[:] = self._leading(angles)
        self.mujoco.mj_step(self.compiled, self.data)

    def _leading(self, angles: Array) -> Array:
        """What servos are told: as far ahead of ``angles`` as they lag behind what turns evenly."""
        before = angles if self.before is None else self.before
        self.before = angles.copy()
        return np.asarray(angles - self.turns + self.lag * (angles - before))

    def base(self) -> Motion:
        """See ``engine.Session``."""
        turn = np.empty(9)
        self.mujoco.mju_quat2Mat(turn, self.data.qpos[3:7])
        rotation = turn.reshape(1, 3, 3)
        spin = rotation[0] @ self.data.qvel[3:6]  # MuJoCo gives it in the body's axes
        return Motion(
            self.data.qpos[:3].copy()[None], rotation, self.data.qvel[:3].copy()[None], spin[None]
        )

    def motion(self, links: tuple[int, ...]) -> Motion:
        """See ``engine.Session``; as of the start of the last step, like ``contacts``."""
        data, bodies = self.data, self.body[list(links)]
        place, spatial = data.xpos[bodies].copy(), data.cvel[bodies]
        spin = spatial[:, :3].copy()
        # cvel is that of the point at the centre of gravity of the whole robot
        arm = place - data.subtree_com[self.compiled.body_rootid[bodies]]
        velocity = spatial[:, 3:] + cross(spin, arm)
        return Motion(place, data.xmat[bodies].reshape(-1, 3, 3).copy(), velocity, spin)

    def joints(self, links: tuple[int, ...]) -> tuple[Array, Array, Array]:
        """See ``engine.Session``."""
        rates = [self.rate[i] for i in links]
        turns = np.array([self.offset[i] for i in links])
        angles = self.data.qpos[[self.angle[i] for i in links]] + turns
        # rows of friction come first after equalities, which there are none of
        motors = dict(zip(self.motors, self.data.efc_force[: self.data.nf], strict=True))
        torques = np.array([motors.get(i, 0.0) for i in links])
        return angles, self.data.qvel[rates].copy(), torques

    def contacts(self) -> Contacts:
        """See ``engine.Session``."""
        found, data = self.data.contact, self.data
        used = np.flatnonzero(found.efc_address >= 0)
        pair = found.geom[used]
        mine = self.link_of[pair]
        first = mine[:, 0] >= 0  # MuJoCo's normal points from the first geom to the second
        other = np.where(first, pair[:, 1], pair[:, 0])
        normal = found.frame[used, :3] * np.where(first, -1.0, 1.0)[:, None]
        return Contacts(
            mine.max(axis=1, initial=-1),
            self.solid_of[other],
            found.pos[used].copy(),
            normal,
            data.efc_force[found.efc_address[used]].copy(),  # elliptic cone: its first is normal
            np.maximum(-found.dist[used], 0.0),
        )

    def move(self, name: str, place: tuple[float, float] | None) -> None:
        """See ``engine.Session``."""
        for i, solid in enumerate(self.stage.solids):
            if solid.name == name and solid.meets == "obstacles":
                at = self.compiled.body(f"solid_{i}").mocapid[0]
                x, y, _ = solid.shape.pose.place
                to = AWAY if place is None else (place[0] - x, place[1] - y, 0.0)
                self.data.mocap_pos[at] = to

    def render(self, camera: Camera) -> NDArray[np.uint8]:
        """Picture (H, W, 3) by MuJoCo's OpenGL renderer. Raises SimulationError without
        graphics."""
        place = self.data.qpos[:3]
        view = self.mujoco.MjvCamera()
        view.lookat[:] = camera.target or (place[0], place[1], place[2] + 0.08)
        view.distance = camera.distance
        view.azimuth = 90.0 + math.degrees(camera.yaw)
        view.elevation = math.degrees(camera.pitch)
        if _NO_GRAPHICS:
            raise SimulationError(_NO_GRAPHICS[0])
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # what is missing is said below, in one line
                renderer = self.mujoco.Renderer(self.compiled, camera.height, camera.width)
        except Exception as error:  # the OpenGL back ends raise what they like
            advice = "set MUJOCO_GL=egl or osmesa, or take the picture with pybullet"
            _NO_GRAPHICS.append(f"mujoco found no graphics for a picture ({error}): {advice}")
            raise SimulationError(_NO_GRAPHICS[0]) from error
        try:
            renderer.update_scene(self.data, view)
            image: NDArray[np.uint8] = renderer.render().copy()
        finally:
            renderer.close()
        return image
